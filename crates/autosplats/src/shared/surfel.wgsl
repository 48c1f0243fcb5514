// Surfels: the results of the fit.

#import screen

// An oriented disc in view space.
struct Surfel {
    // The point, or the surface position that was fitted to noisy points.
    center: vec3f,
    // Semi-minor axis, world units; a dropped surfel has none.
    radius: f32,
    // Unit normal towards the eye.
    normal: vec3f,
    k_radius: f32,
    // Unit direction of the semi-major axis.
    major_axis: vec3f,
    // Semi-major over semi-minor axis; 1 for circles.
    major_ratio: f32,
    // Surface variation, 0 to 1/3.
    curvature: f32,
    // Pixel column in the low, row in the high 16 bits, and the flag NEAR.
    pixel: u32,
    // Index in the cloud.
    source: u32,
    // Index among the screen points, below 2³⁰, and the flags BACK and LINE.
    screen_and_flags: u32,
}

// Index among the screen points.
fn screen_of(surfel: Surfel) -> u32 {
    return surfel.screen_and_flags & ~(BACK | LINE);
}

fn shows_back(surfel: Surfel) -> bool {
    return (surfel.screen_and_flags & BACK) != 0u;
}

fn is_line(surfel: Surfel) -> bool {
    return (surfel.screen_and_flags & LINE) != 0u;
}

// Whether the point is near the eye.
fn is_near(surfel: Surfel) -> bool {
    return has_near_flag(surfel.pixel);
}

// Whether the point is dropped: nothing is drawn.
fn is_dropped(surfel: Surfel) -> bool {
    return surfel.radius == 0.0;
}
