// Depth refinement: redraws the living splats that meet cells with erased depths, and splats that just revived. Taking
// a minimum twice changes nothing [Paper, §7, Depth Refinement]. Splats are shared out as in `depth`.
//
// Reads: counters, splats, tree, changes, cells, large. Reads and writes: depth_map.

#import frame
#import draw_depth
#import groups
#import large
#import lines
#import marked
#import splat

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> tree: array<vec2u>;
@group(0) @binding(4) var<storage, read> changes: array<u32>;
@group(0) @binding(5) var<storage, read> cells: array<u32>;
@group(0) @binding(6) var<storage, read> large: array<u32>;
@group(0) @binding(7) var<storage, read_write> depth_map: array<atomic<u32>>;

@compute @workgroup_size(LARGE_GROUP)
fn redraw(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let group = group_index(workgroup);
    let len = counters[ACTIVE] + counters[RECOVERED];
    let index = group * LARGE_GROUP + local;
    clear_lines(local);
    if index < len {
        let bounds = tree[level_start(SPLATS) + index];
        if !is_empty(bounds) && bounds_area(bounds) <= MAX_GROUP_PX && is_redrawn(index, bounds) {
            tell_lines(rows_of(bounds), local);
        }
    }
    let lines = line_count();
    for (var at = local; at < lines; at += LARGE_GROUP) {
        let place = splat_line(at);
        let drawn = group * LARGE_GROUP + place.x;
        let bounds = tree[level_start(SPLATS) + drawn];
        draw_row(splats[drawn], bounds, firsts(bounds).y + place.y);
    }
    for (var place = first_large(group, local); place < counters[LARGE]; place += next_large(len)) {
        let drawn = large[place];
        let bounds = tree[level_start(SPLATS) + drawn];
        // Dead splats count as empty.
        if !is_empty(bounds) && is_redrawn(drawn, bounds) {
            draw_together(splats[drawn], bounds, local);
        }
    }
}
