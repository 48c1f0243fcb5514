// Noise of a frame's points. The including pass binds `measured`.

// How sure it is that this is noise and no structure, 0 to 1.
fn noise_sure() -> f32 {
    return measured[5];
}

// Standard deviation of points from their surface, of points with a k-radius above 0.
fn noise_at(k_radius: f32) -> f32 {
    let power = measured[1];
    return measured[0] * select(pow(min(k_radius / measured[4], 1.0), power), 1.0, power == 0.0);
}
