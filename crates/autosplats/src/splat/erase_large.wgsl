// Depth refinement: `erase` for splats too large for one invocation, a workgroup per splat.
//
// Reads: counters, splats, tree, changes, large. Reads and writes: depth_map, cells.

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
@group(0) @binding(5) var<storage, read> large: array<u32>;
@group(0) @binding(6) var<storage, read_write> depth_map: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> cells: array<atomic<u32>>;

@compute @workgroup_size(SMALL_GROUP)
fn erase_large(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let place = group_index(workgroup);
    if place >= counters[LARGE] {
        return;
    }
    let index = large[place];
    if changes[index] != DIED {
        return;
    }
    let bounds = living_bounds(tree[level_start(SPLATS) + index]);
    let splat = splats[index];
    // Eight invocations per row.
    for (var row = firsts(bounds).y + local / 8u; row <= lasts(bounds).y; row += 8u) {
        let line = line_of(splat, row);
        let span = span_of(splat, line, bounds);
        for (var column = span.x + i32(local % 8u); column <= span.y; column += 8) {
            erase_depth(splat, line, u32(column));
        }
    }
}
