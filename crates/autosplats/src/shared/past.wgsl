// Temporal coherence: what the last frame found where a point was then; search/past/mod.rs tells more. Imports: frame, reproject.
// The including pass binds `past`, of each pixel of that frame the bits of a k-radius, 0 where there is none; a single element if
// no radii are kept.

// Least and most radius to start from, in first search radii.
override LEAST_LIKELY: f32;
override MOST_LIKELY: f32;

// The radius to start from for a point with this first search radius; 0 if the last frame does not tell.
fn past_radius(position_view: vec3f, initial_radius: f32) -> f32 {
    if !has_past() {
        return 0.0;
    }
    let pixel = past_pixel(past_position(position_view));
    if pixel >= arrayLength(&past) {
        return 0.0;
    }
    let radius = bitcast<f32>(past[pixel]);
    return select(0.0, radius, radius >= LEAST_LIKELY * initial_radius && radius <= MOST_LIKELY * initial_radius);
}
