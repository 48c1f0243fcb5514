// Noise of a frame's points. See docs/decisions/0005-noise-level.md.

// Standard deviation of points from their surface.
struct Noise {
    // Noise level at k-radii of `most` and beyond, world units.
    level: f32,
    // Power of the k-radius that the noise grows with; 0 for uniform noise.
    power: f32,
    // K-radius up to which the noise grows, world units.
    most: f32,
    // Certainty that this is noise and not structure, 0 to 1.
    sure: f32,
}

// Statistics of a frame's surfels.
struct FrameStatistics {
    noise: Noise,
    // Median k-radius, world units; 0 if there are too few surfels.
    k_radius: f32,
    // Level of the cells that have sheets.
    sheet_level: u32,
}

// Noise level of points with this k-radius, above 0, in world units.
fn noise_at(noise: Noise, k_radius: f32) -> f32 {
    return noise.level * select(pow(min(k_radius / noise.most, 1.0), noise.power), 1.0, noise.power == 0.0);
}
