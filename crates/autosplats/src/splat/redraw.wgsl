// Depth refinement: draws the living splats again that may be seen where depths were erased, and those that just revived.
// Minima do not change when they are taken twice [Paper, §7, Depth Refinement].
//
// Reads: counters, splats, tree, changes, cells. Reads and writes: depth_map.

#import frame
#import groups
#import counters
#import splat
#import depth_map
#import fragment
#import redraw

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> tree: array<vec2u>;
@group(0) @binding(4) var<storage, read> changes: array<u32>;
@group(0) @binding(5) var<storage, read> cells: array<u32>;
@group(0) @binding(6) var<storage, read_write> depth_map: array<atomic<u32>>;

override MOST_PX: u32;

@compute @workgroup_size(256)
fn redraw(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup) * 256u + local;
    if index >= counters[ACTIVE] + counters[RECOVERED] {
        return;
    }
    let bounds = tree[level_start(SPLATS) + index];
    if is_empty(bounds) {
        return;
    }
    let area = bounds_area(bounds);
    if area > MOST_PX || !(changes[index] == REVIVED || meets_marked(bounds)) {
        return;
    }
    let splat = splats[index];
    var pixel = firsts(bounds);
    for (var drawn = 0u; drawn < area; drawn++) {
        draw_depth(splat, pixel);
        let ends = pixel.x == lasts(bounds).x;
        pixel = select(pixel + vec2u(1u, 0u), vec2u(firsts(bounds).x, pixel.y + 1u), ends);
    }
}

fn meets_marked(bounds: vec2u) -> bool {
    let first = firsts(bounds) >> vec2u(CELL_BITS);
    let last = lasts(bounds) >> vec2u(CELL_BITS);
    var marked = 0u;
    for (var row = first.y; row <= last.y; row++) {
        for (var column = first.x; column <= last.x; column++) {
            marked |= cells[row * cell_columns() + column];
        }
    }
    return marked != 0u;
}
