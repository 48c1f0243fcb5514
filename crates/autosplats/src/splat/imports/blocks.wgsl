// Blocks of pixels. Behind the elements of patches, `cover` has one for each block, row by row. Its `point` has a bit
// for each of the block's pixels, row by row, that is empty, and in the high 16 bits for each that is in a core.

#import frame
#import patches

// Columns and rows of blocks.
fn block_counts() -> vec2u {
    return (frame.size + BLOCK_PX - 1u) / BLOCK_PX;
}

// Index of a block among blocks.
fn block_index(block: vec2u) -> u32 {
    return block.y * block_counts().x + block.x;
}

// Place in `cover` of what is told of a block.
fn block_mark(block: vec2u) -> u32 {
    return frame.size.x * frame.size.y + patches().x * patches().y + block_index(block);
}

// The place of a pixel's bit.
fn rim_bit(pixel: vec2u) -> u32 {
    return BLOCK_PX * (pixel.y % BLOCK_PX) + pixel.x % BLOCK_PX;
}
