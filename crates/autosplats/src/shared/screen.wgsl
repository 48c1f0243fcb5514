// Screen points: the nearest point of each pixel or half of one, in cell order.

struct ScreenPoint {
    // View space.
    position_view: vec3f,
    // Pixel column in the low, row in the high 16 bits.
    pixel: u32,
}

fn pixel_xy(pixel: u32) -> vec2u {
    return vec2u(pixel & 0xffffu, pixel >> 16u);
}
