// Visibility pass: the nearest depth, pushed back by ε, of the splats that cover each pixel [Paper, §7]. An invocation
// draws a splat; a minimum does not depend on the order. `depth_large` draws larger splats.
//
// Reads: counters, splats, tree. Reads and writes: depth_map.

#import frame
#import fragment
#import groups
#import splat

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> tree: array<vec2u>;
@group(0) @binding(4) var<storage, read_write> depth_map: array<atomic<u32>>;

// Whether to draw only the recovered splats.
override RECOVERED_ONLY: bool;
override MAX_INVOCATION_PX: u32;

@compute @workgroup_size(LARGE_GROUP)
fn depth(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = select(0u, counters[ACTIVE], RECOVERED_ONLY) + group_index(workgroup) * LARGE_GROUP + local;
    if index >= counters[ACTIVE] + counters[RECOVERED] {
        return;
    }
    let bounds = tree[level_start(SPLATS) + index];
    if is_empty(bounds) {
        return;
    }
    let area = bounds_area(bounds);
    if area > MAX_INVOCATION_PX {
        return;
    }
    let splat = splats[index];
    for (var row = firsts(bounds).y; row <= lasts(bounds).y; row++) {
        let line = line_of(splat, row);
        let span = span_of(splat, line, bounds);
        for (var column = span.x; column <= span.y; column++) {
            draw_depth(splat, line, u32(column));
        }
    }
}
