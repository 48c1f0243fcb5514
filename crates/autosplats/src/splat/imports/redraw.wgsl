// Changes by a depth refinement, so that only changed parts are drawn again [Paper, §7].

#import frame

// Change of a splat.
const UNCHANGED = 0u;
const DIED = 1u;
const REVIVED = 2u;

fn cell_columns() -> u32 {
    return (frame.size.x >> CELL_BITS) + 1u;
}

fn cell_of(pixel: vec2u) -> u32 {
    return (pixel.y >> CELL_BITS) * cell_columns() + (pixel.x >> CELL_BITS);
}
