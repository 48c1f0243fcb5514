// Depth refinement: a splat is dead if the depth map hides its own point, else alive [Paper, §7, Depth Refinement]. The
// pass also clears the marks of the cells, which the next one sets.
//
// Reads: counters, splats, depth_map. Reads and writes: tree. Writes: changes, cells.

#import frame
#import groups
#import hidden
#import redraw
#import splat

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> depth_map: array<u32>;
@group(0) @binding(4) var<storage, read_write> tree: array<vec2u>;
@group(0) @binding(5) var<storage, read_write> changes: array<u32>;
@group(0) @binding(6) var<storage, read_write> cells: array<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn refine(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup) * LARGE_GROUP + local;
    let len = counters[ACTIVE] + counters[RECOVERED];
    let invocations = (len + LARGE_GROUP - 1u) / LARGE_GROUP * LARGE_GROUP;
    for (var cell = index; cell < arrayLength(&cells) && index < invocations; cell += invocations) {
        cells[cell] = 0u;
    }
    if index >= len {
        return;
    }
    let place = level_start(SPLATS) + index;
    // Splats that died in the first refinement may revive in the second.
    let before = tree[place].x;
    let bounds = living_bounds(vec2u(before, tree[place].y));
    if is_empty(bounds) {
        changes[index] = UNCHANGED;
        return;
    }
    let splat = &splats[index];
    let now = select(bounds.x, bounds.x | DEAD, is_hidden((*splat).pixel, (*splat).depth));
    if now == before {
        changes[index] = UNCHANGED;
        return;
    }
    tree[place].x = now;
    changes[index] = select(DIED, REVIVED, now == bounds.x);
}
