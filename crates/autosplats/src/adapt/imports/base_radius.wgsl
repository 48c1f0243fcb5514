// Base radius of the balls around a surfel.

#import surfel

// Radius in world units whose multiples are the radii of the balls around a surfel. `initial_radius` is the first
// search radius of its point.
fn base_radius(surfel: Surfel, initial_radius: f32) -> f32 {
    return max(surfel.k_radius, MIN_BASE_FIRST_RADII * initial_radius);
}
