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

// Where in the last frame's picture such a position was, in pixels.
fn past_place(position: vec3f) -> vec2f {
    let scale = select(frame.past_focal_px, frame.past_focal_px / position.z, frame.perspective == 1u);
    return position.xy * scale + 0.5 * vec2f(frame.size);
}

// Whether a position at such a place was in that picture. What is not a number is in none.
fn was_inside(position: vec3f, place: vec2f) -> bool {
    return position.z > frame.near && all(place >= vec2f(0.0)) && all(place < vec2f(frame.size));
}

// The pixel that showed such a position, or whatever was before it: row by row, NO_PIXEL if it was not in the picture.
fn past_pixel(position: vec3f) -> u32 {
    let place = past_place(position);
    if !was_inside(position, place) {
        return NO_PIXEL;
    }
    let pixel = vec2u(place);
    return pixel.y * frame.size.x + pixel.x;
}

// The position in the last frame's view space that its pixel showed at a depth.
fn past_unproject(pixel: u32, depth: f32) -> vec3f {
    let at = vec2f(vec2u(pixel % frame.size.x, pixel / frame.size.x)) + 0.5;
    let unit = select(1.0 / frame.past_focal_px, depth / frame.past_focal_px, frame.perspective == 1u);
    return vec3f((at - 0.5 * vec2f(frame.size)) * unit, depth);
}
