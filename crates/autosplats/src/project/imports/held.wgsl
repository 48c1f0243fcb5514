// Which slots hold points. Each projected point marks its sixteenth, and the nearest owns the slot. So it is owned,
// until `occupancy` erases owners, exactly if one of its sixteenths is marked. They are an eighth of the bytes
// of keys. The including pass binds `sixteenths` for reading.

#import frame

// Marks of the sixteenths of a pixel.
fn pixel_sixteenths(pixel: vec2u) -> u32 {
    let index = pixel.y * frame.size.x + pixel.x;
    return (sixteenths[index / 2u] >> (16u * (index % 2u))) & 0xffffu;
}

// Sixteenths of one half of a pixel, as `half_at` has it: the upper or the left half, the other if `half` is 1.
fn half_sixteenths(pixel: vec2u, half: u32) -> u32 {
    return select(0x00ffu << (8u * half), 0x3333u << (2u * half), ((pixel.x + pixel.y) & 1u) == 1u);
}

// Whether a slot of a pixel holds points.
fn is_held(pixel: vec2u, half: u32) -> bool {
    let slot = select(0xffffu, half_sixteenths(pixel, half), frame.halves == 1u);
    return (pixel_sixteenths(pixel) & slot) != 0u;
}
