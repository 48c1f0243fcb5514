// Noise of a frame's points. The including pass binds `measured`. See docs/decisions/0005-noise-level.md.

// Certainty that the measured scatter is noise and not structure, 0 to 1.
fn noise_sure() -> f32 {
    return measured[5];
}

// Noise level in world units, the standard deviation of points from their surface, for points with this k-radius, above
// 0.
fn noise_at(k_radius: f32) -> f32 {
    let power = measured[1];
    return measured[0] * select(pow(min(k_radius / measured[4], 1.0), power), 1.0, power == 0.0);
}
