// Counts the queries that have not converged, one invocation each.
//
// Differs from the paper: the paper uses an occlusion query [Paper, §5.2]; WebGPU's only tell whether there are any.
//
// Reads: points, queries, counters, arguments, the position texture and both radius textures. Writes: convergence.

#import frame
#import counting
#import groups
#import radius_search
#import screen

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> queries: array<u32>;
@group(0) @binding(3) var<storage, read> counters: array<u32>;
@group(0) @binding(4) var<storage, read> arguments: Arguments;
@group(0) @binding(5) var<storage, read_write> convergence: array<atomic<u32>>;
@group(0) @binding(6) var positions: texture_2d<f32>;
@group(0) @binding(7) var counts: texture_2d<f32>;
@group(0) @binding(8) var radii: texture_2d<f32>;

@compute @workgroup_size(LARGE_GROUP)
fn count(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = counters[ROUND_FIRST];
    let len = counters[ROUND_LEN];
    let index = group_index(workgroup) * LARGE_GROUP + local;
    var is_unconverged = false;
    if index < len {
        let pixel = pixel_xy(points[queries[first + index]].pixel);
        let known = recall(textureLoad(radii, pixel, 0), textureLoad(counts, pixel, 0));
        let others = f32(counters[VISIBLE] - 1u);
        is_unconverged = !has_ended(advance(known, textureLoad(positions, pixel, 0).w, others));
    }
    count_unconverged(is_unconverged, local);
}
