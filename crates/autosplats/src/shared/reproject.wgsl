// From this frame into the last one, which had the same size; the CPU form is camera/reproject.rs. Imports: frame.

const NO_PIXEL = 0xffffffffu;

// Whether anything is known of the last frame.
fn has_past() -> bool {
    return frame.past_focal_px != 0.0;
}

// Where a view-space position was in the last frame's view space.
fn past_position(position_view: vec3f) -> vec3f {
    return frame.past_rotation * position_view + frame.past_shift;
}

// The pixel that showed such a position, or whatever was before it: row by row, NO_PIXEL if it was not in the picture.
fn past_pixel(position: vec3f) -> u32 {
    let scale = select(frame.past_focal_px, frame.past_focal_px / position.z, frame.past_perspective == 1u);
    let at = position.xy * scale + 0.5 * vec2f(frame.size);
    // What is not a number is in no picture.
    if !(position.z > frame.near && all(at >= vec2f(0.0)) && all(at < vec2f(frame.size))) {
        return NO_PIXEL;
    }
    let pixel = vec2u(at);
    return pixel.y * frame.size.x + pixel.x;
}

// The position in the last frame's view space that its pixel showed at a depth.
fn past_unproject(pixel: u32, depth: f32) -> vec3f {
    let at = vec2f(vec2u(pixel % frame.size.x, pixel / frame.size.x)) + 0.5;
    let unit = select(1.0 / frame.past_focal_px, depth / frame.past_focal_px, frame.past_perspective == 1u);
    return vec3f((at - 0.5 * vec2f(frame.size)) * unit, depth);
}
