// Where a point goes [Paper, §3]. Imports: frame.

// A run of the cloud's points, in a buffer of its own.
struct Chunk {
    // Index in the cloud of its first point.
    first: u32,
    len: u32,
    // Words of values per point: a colour, sRGB in the low three bytes, then the bits of a number.
    values: u32,
    padding: u32,
}

const PIXEL_NOT_FINITE = 0xffffffffu;
const PIXEL_BEHIND = 0xfffffffeu;
const PIXEL_OUTSIDE = 0xfffffffdu;

struct Projected {
    // Pixel index, or why there is none.
    pixel: u32,
    depth: f32,
}

fn project_point(position: vec3f) -> Projected {
    let position_view = to_view(position);
    // Finite coordinates so large that their transform is not count as not finite too.
    if !(is_finite(position_view.x) && is_finite(position_view.y) && is_finite(position_view.z)) {
        return Projected(PIXEL_NOT_FINITE, 0.0);
    }
    if !(position_view.z > frame.near) {
        return Projected(PIXEL_BEHIND, 0.0);
    }
    let at = to_pixel(position_view);
    if !(at.x >= 0.0 && at.y >= 0.0 && at.x < f32(frame.size.x) && at.y < f32(frame.size.y)) {
        return Projected(PIXEL_OUTSIDE, 0.0);
    }
    return Projected(u32(at.y) * frame.size.x + u32(at.x), position_view.z);
}
