// Temporal coherence: the k-radius that the last frame found at a point's position; see `search/past/mod.rs`. The
// including pass binds `past`.

#import past_radii
#import reproject

// Radius to start the search of a point from; 0 if the last frame has no plausible one.
fn past_radius(position_view: vec3f, initial_radius: f32) -> f32 {
    if !has_past() {
        return 0.0;
    }
    let pixel = past_pixel(past_position(position_view));
    if pixel == NO_PIXEL || past_at(pixel) >= arrayLength(&past) {
        return 0.0;
    }
    let radius = bitcast<f32>(past[past_at(pixel)]);
    return select(0.0, radius, radius >= PAST_FIRST_RADII_RANGE[0] * initial_radius && radius <= PAST_FIRST_RADII_RANGE[1] * initial_radius);
}
