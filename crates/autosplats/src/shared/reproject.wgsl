// From this frame into the last one, of the same size: see the CPU form, `camera/reproject.rs`.

#import frame

const NO_PIXEL = 0xffffffffu;

// Whether there is a last frame.
fn has_past() -> bool {
    return frame.past_focal_px != 0.0;
}

// Position in the last frame's view space of a view-space position.
fn past_position(position_view: vec3f) -> vec3f {
    return frame.past_rotation * position_view + frame.past_shift;
}

// Pixel coordinates on the last screen of a position in the last frame's view space.
fn past_place(position: vec3f) -> vec2f {
    let scale = select(frame.past_focal_px, frame.past_focal_px / position.z, frame.perspective == 1u);
    return position.xy * scale + frame.past_middle;
}

// Whether a position with these pixel coordinates was on the last screen; false for NaN.
fn was_inside(position: vec3f, place: vec2f) -> bool {
    return position.z > frame.near && all(place >= vec2f(0.0)) && all(place < vec2f(frame.size));
}

// Index, row by row, of the last screen's pixel that a position in the last frame's view space projects to; NO_PIXEL if
// it was outside.
fn past_pixel(position: vec3f) -> u32 {
    let place = past_place(position);
    if !was_inside(position, place) {
        return NO_PIXEL;
    }
    let pixel = vec2u(place);
    return pixel.y * frame.size.x + pixel.x;
}

// Position in the last frame's view space at a depth behind one of its pixels.
fn past_unproject(pixel: u32, depth: f32) -> vec3f {
    let at = vec2f(vec2u(pixel % frame.size.x, pixel / frame.size.x)) + 0.5;
    let unit = select(1.0 / frame.past_focal_px, depth / frame.past_focal_px, frame.perspective == 1u);
    return vec3f((at - frame.past_middle) * unit, depth);
}
