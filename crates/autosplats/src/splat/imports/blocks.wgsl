// Blocks of pixels, row by row.

struct Block {
    // The number of sixteenths with points, and `EMPTY_BLOCK` if no pixel is covered; only in frames with noise.
    held: u32,
    // A bit for each pixel, row by row, that is empty, and in the high 16 bits for each that is in a core.
    rims: u32,
}

#import frame

const EMPTY_BLOCK = 0x80000000u;

// Columns and rows of blocks.
fn block_counts() -> vec2u {
    return (frame.size + BLOCK_PX - 1u) / BLOCK_PX;
}

// Rim of a pixel within its block: 1 if the pixel is empty, plus 0x10000 if it is in a core.
fn rim_in(block: Block, pixel: vec2u) -> u32 {
    return (block.rims >> (BLOCK_PX * (pixel.y % BLOCK_PX) + pixel.x % BLOCK_PX)) & 0x10001u;
}
