// Which splats a refinement draws again [Paper, §7, Depth Refinement]. The including pass binds `changes` and `cells`.

#import redraw
#import splat

// Splats that revived, and splats that may be visible where depths were erased.
fn is_redrawn(index: u32, bounds: vec2u) -> bool {
    return changes[index] == REVIVED || meets_marked(bounds);
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
