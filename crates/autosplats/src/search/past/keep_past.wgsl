// Stores the k-radii found, as starting radii of the next frame. The maximum is the same point's in every run.
//
// Reads: counters, points, queries, neighborhoods. Writes: past.

#import frame
#import groups
#import neighborhood
#import screen

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(3) var<storage, read> queries: array<u32>;
@group(0) @binding(4) var<storage, read> neighborhoods: array<Neighborhood>;
@group(0) @binding(5) var<storage, read_write> past: array<atomic<u32>>;

@compute @workgroup_size(LARGE_GROUP)
fn keep_past(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if index >= counters[ACTIVE] + counters[RECOVERED] || neighborhoods[index].count < f32(frame.k) {
        return;
    }
    let point = points[queries[index]];
    if has_near_flag(point.pixel) {
        return;
    }
    let pixel = pixel_xy(point.pixel);
    atomicMax(&past[pixel.y * frame.size.x + pixel.x], bitcast<u32>(neighborhoods[index].k_radius));
}
