// Blocks of pixels, row by row, a word each: the number of sixteenths with points, and `EMPTY_BLOCK` if no pixel is
// covered.

#import frame

const EMPTY_BLOCK = 0x80000000u;

// Columns and rows of blocks.
fn block_counts() -> vec2u {
    return (frame.size + BLOCK_PX - 1u) / BLOCK_PX;
}
