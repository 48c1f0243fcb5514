// The levels of cells, whose sizes follow from the density of screen points.

#import frame
#import levels
#import merging

override MOST_FINEST: u32;

// Columns and rows of cells in a picture.
fn cells_across(side_px: u32) -> vec2u {
    return (frame.size + side_px - 1u) / side_px;
}

// Side of the finest cells in pixels: about the distance between screen points, at least 2, more in a large picture.
fn finest_side_px(cell_px: u32) -> u32 {
    var least = 2u;
    while cells_across(least).x * cells_across(least).y > MOST_FINEST {
        least++;
    }
    // The factor rounds a quotient of exactly a half up even if the division is off in the last place.
    let side = f32(cell_px) / sqrt(f32(frame.k)) * 1.000001;
    return max(u32(floor(side + 0.5)), least);
}

// Lays out the levels for density cells of this side. To be called by one invocation; a barrier must follow.
fn lay_out(cell_px: u32) {
    var level = Level(finest_side_px(cell_px), 0u, 0u, 0u);
    level.columns = cells_across(level.side_px).x;
    level.rows = cells_across(level.side_px).y;
    let doublings = firstLeadingBit(max(max(level.columns, level.rows) / 4u, 1u));
    for (var index = 0u; index < MOST_LEVELS; index++) {
        let cells = select(0u, level.columns * level.rows, index <= doublings);
        level.side_px = select(0u, level.side_px, index <= doublings);
        all_levels[index] = level;
        level.side_px *= 2u;
        level.columns = (level.columns + 1u) / 2u;
        level.rows = (level.rows + 1u) / 2u;
        level.first += cells;
    }
}
