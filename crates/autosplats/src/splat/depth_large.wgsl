// Visibility pass for splats too large for one invocation: a workgroup draws a splat [Paper, §7].
//
// Reads: counters, splats, tree, large, changes, cells. Reads and writes: depth_map.

#import frame
#import fragment
#import groups
#import marked
#import splat

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> tree: array<vec2u>;
@group(0) @binding(4) var<storage, read> large: array<u32>;
@group(0) @binding(5) var<storage, read> changes: array<u32>;
@group(0) @binding(6) var<storage, read> cells: array<u32>;
@group(0) @binding(7) var<storage, read_write> depth_map: array<atomic<u32>>;

// Whether to draw only the recovered splats, or only those that a refinement redraws.
override RECOVERED_ONLY: bool;
override REDRAWN_ONLY: bool;

@compute @workgroup_size(SMALL_GROUP)
fn depth_large(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let place = group_index(workgroup);
    if place >= counters[LARGE] {
        return;
    }
    let index = large[place];
    let bounds = tree[level_start(SPLATS) + index];
    // Dead splats count as empty.
    if is_empty(bounds) || (RECOVERED_ONLY && index < counters[ACTIVE]) {
        return;
    }
    if REDRAWN_ONLY && !is_redrawn(index, bounds) {
        return;
    }
    let splat = splats[index];
    // Eight invocations per row.
    for (var row = firsts(bounds).y + local / 8u; row <= lasts(bounds).y; row += 8u) {
        let line = line_of(splat, row);
        let span = span_of(splat, line, bounds);
        for (var column = span.x + i32(local % 8u); column <= span.y; column += 8) {
            draw_depth(splat, line, u32(column));
        }
    }
}
