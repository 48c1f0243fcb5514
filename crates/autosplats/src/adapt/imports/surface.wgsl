// The surface beside a surfel, and the surfel as a dot.

#import frame
#import screen
#import surfel

struct Surface {
    // From the surfel to the surface, world units.
    offset: vec3f,
    // Sum of weights; 0 without sheets, below 0 if none of the sheets agrees.
    weight: f32,
    // Unit normal, of either sign.
    normal: vec3f,
    curvature: f32,
}

// Radius in world units of a surfel that is drawn as a dot.
fn dot_radius(surfel: Surfel) -> f32 {
    return min(surfel.radius, DOT_PX * pixel_size(surfel.center.z));
}
