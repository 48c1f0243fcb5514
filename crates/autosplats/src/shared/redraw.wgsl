// What a refinement changes, so that only that is drawn again. Imports: frame.

// What became of a splat.
const AS_BEFORE = 0u;
const DIED = 1u;
const REVIVED = 2u;

// Side of a cell in pixels, as bits. A cell is marked if depths in it were erased.
const CELL_BITS = 3u;

fn cell_columns() -> u32 {
    return (frame.size.x >> CELL_BITS) + 1u;
}

fn cell_of(pixel: vec2u) -> u32 {
    return (pixel.y >> CELL_BITS) * cell_columns() + (pixel.x >> CELL_BITS);
}
