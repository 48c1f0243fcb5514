// Blocks of pixels, row by row: a word each, how many sixteenths in it hold points, and whether no pixel of it is covered.
// Imports: frame.

const BLOCK_PX = 4u;
const EMPTY_BLOCK = 0x80000000u;

// Columns and rows.
fn block_counts() -> vec2u {
    return (frame.size + BLOCK_PX - 1u) / BLOCK_PX;
}
