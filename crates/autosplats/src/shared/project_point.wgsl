// Projection of a point [Paper, §3].

#import frame
#import half

const SLOT_NOT_FINITE = 0xffffffffu;
const SLOT_BEHIND = 0xfffffffeu;
const SLOT_OUTSIDE = 0xfffffffdu;

struct Projected {
    // Index among the keys, or the reason why there is none.
    slot: u32,
    depth: f32,
    // Position in sixteenths of pixels: column and row.
    sixteenths: vec2u,
    position_view: vec3f,
}

// Projects a point that is this far from the eye, in world axes.
fn project_point(from_eye: vec3f) -> Projected {
    let position_view = turned_to_view(from_eye);
    // Finite coordinates whose transform overflows count as not finite too.
    if !(is_finite(position_view.x) && is_finite(position_view.y) && is_finite(position_view.z)) {
        return Projected(SLOT_NOT_FINITE, 0.0, vec2u(0u), position_view);
    }
    if !(position_view.z > frame.near) {
        return Projected(SLOT_BEHIND, 0.0, vec2u(0u), position_view);
    }
    let at = to_pixel(position_view);
    if !(at.x >= 0.0 && at.y >= 0.0 && at.x < f32(frame.size.x) && at.y < f32(frame.size.y)) {
        return Projected(SLOT_OUTSIDE, 0.0, vec2u(0u), position_view);
    }
    let sixteenths = vec2u(4.0 * at);
    if frame.halves == 0u {
        let pixel = sixteenths / 4u;
        return Projected(pixel.y * frame.size.x + pixel.x, position_view.z, sixteenths, position_view);
    }
    return Projected(half_at(sixteenths), position_view.z, sixteenths, position_view);
}
