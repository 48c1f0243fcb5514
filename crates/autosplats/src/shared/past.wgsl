// Temporal coherence: what the last frame found where a point was then; search/past/mod.rs tells more. Imports: frame. The
// including pass binds `past`, of each pixel of that frame the bits of a k-radius, 0 where there is none;
// a single element if no radii are kept.

// Least and most radius to start from, in first search radii.
override LEAST_LIKELY: f32;
override MOST_LIKELY: f32;

// The radius to start from for a point with this first search radius; 0 if the last frame does not tell.
fn past_radius(position_view: vec3f, initial_radius: f32) -> f32 {
    if frame.past_focal_px == 0.0 {
        return 0.0;
    }
    let position = frame.past_rotation * position_view + frame.past_shift;
    let scale = select(frame.past_focal_px, frame.past_focal_px / position.z, frame.past_perspective == 1u);
    let at = position.xy * scale + 0.5 * vec2f(frame.size);
    if !(position.z > frame.past_near && all(at >= vec2f(0.0)) && all(at < vec2f(frame.size))) {
        return 0.0;
    }
    let pixel = vec2u(at);
    let place = pixel.y * frame.size.x + pixel.x;
    if place >= arrayLength(&past) {
        return 0.0;
    }
    let radius = bitcast<f32>(past[place]);
    return select(0.0, radius, radius >= LEAST_LIKELY * initial_radius && radius <= MOST_LIKELY * initial_radius);
}
