// Depth refinement: erases the depths of splats that just died, wherever nothing was in front of them [Paper, §7, Depth
// Refinement]. The pass marks the cells with erased depths. Splats are shared out as in `depth`.
//
// Reads: counters, splats, tree, changes, large. Reads and writes: depth_map, cells.

#import frame
#import erased
#import fragment
#import groups
#import large
#import lines
#import redraw
#import splat

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> tree: array<vec2u>;
@group(0) @binding(4) var<storage, read> changes: array<u32>;
@group(0) @binding(5) var<storage, read> large: array<u32>;
@group(0) @binding(6) var<storage, read_write> depth_map: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> cells: array<atomic<u32>>;

@compute @workgroup_size(LARGE_GROUP)
fn erase(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let group = group_index(workgroup);
    let len = counters[ACTIVE] + counters[RECOVERED];
    let index = group * LARGE_GROUP + local;
    clear_lines(local);
    if index < len && changes[index] == DIED {
        let bounds = living_bounds(tree[level_start(SPLATS) + index]);
        if bounds_area(bounds) <= MAX_GROUP_PX {
            tell_lines(rows_of(bounds), local);
        }
    }
    let lines = line_count();
    for (var at = local; at < lines; at += LARGE_GROUP) {
        let place = splat_line(at);
        let drawn = group * LARGE_GROUP + place.x;
        let bounds = living_bounds(tree[level_start(SPLATS) + drawn]);
        let splat = splats[drawn];
        let line = line_of(splat, firsts(bounds).y + place.y);
        let span = span_of(splat, line, bounds);
        for (var column = span.x; column <= span.y; column++) {
            erase_depth(splat, line, u32(column));
        }
    }
    for (var place = first_large(group, local); place < counters[LARGE]; place += next_large(len)) {
        let drawn = large[place];
        if changes[drawn] == DIED {
            erase_together(drawn, local);
        }
    }
}

fn erase_together(index: u32, local: u32) {
    let bounds = living_bounds(tree[level_start(SPLATS) + index]);
    let splat = splats[index];
    let place = place_in_team(local);
    for (var row = firsts(bounds).y + place.y; row <= lasts(bounds).y; row += 8u) {
        let line = line_of(splat, row);
        let span = span_of(splat, line, bounds);
        for (var column = span.x + i32(place.x); column <= span.y; column += 8) {
            erase_depth(splat, line, u32(column));
        }
    }
}
