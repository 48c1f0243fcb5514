// Decides which surfels have to be fitted anew because of noise.

#import frame
#import surfel

// Standard error of a normal, in radians, that needs no larger ball.
fn good_enough(noise: f32, k_radius: f32, depth: f32) -> f32 {
    let pixel = pixel_size(depth);
    let dense = TINY_REACH_PX * pixel / k_radius;
    return GOOD_NORMAL_ERROR_RAD + TINY_SLOPE * min(dense * dense, MOST_TINY) * max(TINY_PX - noise / pixel, 0.0);
}

// Largest scatter about larger balls' quadrics, world units; `known` says whether the noise is known as that of a depth
// camera.
fn most_scatter(noise: f32, known: bool) -> f32 {
    return select(MAX_SCATTER_NOISES, MAX_SCATTER_KNOWN_NOISES, known) * noise;
}

// Whether the first neighbours of a surfel form a scan line. Depth steps of a camera with known noise look alike but
// are not on the surface.
fn is_row(surfel: Surfel, known_noise: f32) -> bool {
    let is_fitted = !is_dropped(surfel) && !is_near(surfel);
    return is_fitted && surfel.major_ratio > MIN_SCAN_LINE_ANISOTROPY && known_noise == 0.0;
}

// Whether noise calls for more than the first neighbours. Their normal's standard error is about the noise over the
// k-radius.
fn calls(surfel: Surfel, noise: f32, enough: f32) -> bool {
    return !is_dropped(surfel) && !is_near(surfel) && noise > enough * surfel.k_radius;
}
