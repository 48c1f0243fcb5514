// Stores each query's count, mean offset and k-radius from its pixel.
//
// Reads: points, queries, the feedback texture and both radius textures. Writes: neighborhoods, counters.

#import frame
#import ending
#import groups
#import neighborhood
#import screen

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> queries: array<u32>;
@group(0) @binding(3) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> neighborhoods: array<Neighborhood>;
@group(0) @binding(5) var feedback: texture_2d<f32>;
@group(0) @binding(6) var sums: texture_2d<f32>;
@group(0) @binding(7) var furthest: texture_2d<f32>;

@compute @workgroup_size(LARGE_GROUP)
fn keep_mean(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = atomicLoad(&counters[ROUND_FIRST]);
    let len = atomicLoad(&counters[ROUND_LEN]);
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if index >= len {
        return;
    }
    let pixel = pixel_xy(points[queries[first + index]].pixel);
    let sum = textureLoad(sums, pixel, 0);
    let how = textureLoad(feedback, pixel, 0).z;
    neighborhoods[first + index].offset = sum.xyz;
    neighborhoods[first + index].count = sum.w;
    neighborhoods[first + index].k_radius = textureLoad(furthest, pixel, 0).w;
    count_ending(how);
}
