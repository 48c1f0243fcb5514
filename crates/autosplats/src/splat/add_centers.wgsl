// Adds the centre of each splat, living or dead, to its pixel, for the trim. The CPU form is `centers.rs`.
//
// Reads: counters, splats, tree. Reads and writes: centers.

#import frame
#import groups
#import screen
#import splat

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> tree: array<vec2u>;
@group(0) @binding(4) var<storage, read_write> centers: array<atomic<u32>>;

@compute @workgroup_size(LARGE_GROUP)
fn add_centers(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if index >= counters[ACTIVE] + counters[RECOVERED] || is_empty(living_bounds(tree[level_start(SPLATS) + index])) {
        return;
    }
    let splat = &splats[index];
    if has_near_flag((*splat).pixel) {
        // The pixel need not be that of the centre.
        return;
    }
    let pixel = pixel_xy((*splat).pixel);
    let place = vec2u(clamp(CENTER_STEPS * ((*splat).center_px - vec2f(pixel)), vec2f(0.0), vec2f(CENTER_STEPS - 1.0)));
    atomicAdd(&centers[pixel.y * frame.size.x + pixel.x], (1u << 24u) | (place.y << 12u) | place.x);
}
