// Screen points: the nearest point of each pixel or half of one, in cell order, then the points of sparse cells around
// the eye (`project/near.rs`).

struct ScreenPoint {
    // View space.
    position_view: vec3f,
    // Pixel column in the low, row in the high 16 bits, and the flags NEAR and SILENT.
    pixel: u32,
}

fn pixel_xy(pixel: u32) -> vec2u {
    return vec2u(pixel & 0x7fffu, (pixel >> 16u) & 0x7fffu);
}

// Flag of a point in the list of sparse cells.
const NEAR = 0x8000u;
// Flag of a point that serves as a neighbour only.
const SILENT = 0x80000000u;

fn has_near_flag(pixel: u32) -> bool {
    return (pixel & NEAR) != 0u;
}

fn is_silent(point: ScreenPoint) -> bool {
    return (point.pixel & SILENT) != 0u;
}
