// Depth refinement: erases the depths of splats that just died, wherever nothing was in front of them [Paper, §7, Depth
// Refinement]. The pass marks the cells with erased depths. An invocation erases a splat, and a team of invocations a
// large one (`large`).
//
// Reads: counters, splats, tree, changes, large. Reads and writes: depth_map, cells.

#import frame
#import erased
#import fragment
#import groups
#import large
#import redraw
#import splat

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> tree: array<vec2u>;
@group(0) @binding(4) var<storage, read> changes: array<u32>;
@group(0) @binding(5) var<storage, read> large: array<u32>;
@group(0) @binding(6) var<storage, read_write> depth_map: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> cells: array<atomic<u32>>;

override MAX_INVOCATION_PX: u32;

@compute @workgroup_size(LARGE_GROUP)
fn erase(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let group = group_index(workgroup);
    if group < LARGE_SPLAT_GROUPS {
        for (var place = first_large(group, local); place < counters[LARGE]; place += NEXT_LARGE) {
            let index = large[place];
            if changes[index] == DIED {
                erase_together(index, local);
            }
        }
        return;
    }
    let index = (group - LARGE_SPLAT_GROUPS) * LARGE_GROUP + local;
    if index >= counters[ACTIVE] + counters[RECOVERED] || changes[index] != DIED {
        return;
    }
    let bounds = living_bounds(tree[level_start(SPLATS) + index]);
    if bounds_area(bounds) > MAX_INVOCATION_PX {
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
