// Depth refinement: erases the depths of splats that just died, wherever nothing was in front of them [Paper, §7, Depth
// Refinement]. The pass marks the cells with erased depths. `erase_large` handles splats too large for one invocation.
//
// Reads: counters, splats, tree, changes. Reads and writes: depth_map, cells.

#import frame
#import erased
#import fragment
#import groups
#import redraw
#import splat

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> tree: array<vec2u>;
@group(0) @binding(4) var<storage, read> changes: array<u32>;
@group(0) @binding(5) var<storage, read_write> depth_map: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> cells: array<atomic<u32>>;

override MAX_INVOCATION_PX: u32;

@compute @workgroup_size(LARGE_GROUP)
fn erase(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if index >= counters[ACTIVE] + counters[RECOVERED] || changes[index] != DIED {
        return;
    }
    let bounds = living_bounds(tree[level_start(SPLATS) + index]);
    let area = bounds_area(bounds);
    if area > MAX_INVOCATION_PX {
        return;
    }
    let splat = splats[index];
    for (var row = firsts(bounds).y; row <= lasts(bounds).y; row++) {
        let line = line_of(splat, row);
        let span = span_of(splat, line, bounds);
        for (var column = span.x; column <= span.y; column++) {
            erase_depth(splat, line, u32(column));
        }
    }
}
