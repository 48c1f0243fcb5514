// Fit of a point in the last frame, in that frame's view space.

struct Fitted {
    // From the point to the surfel's centre.
    offset: vec3f,
    // Index in the cloud.
    source: u32,
    // Unit normal.
    normal: vec3f,
    // Number of frames averaged.
    frames: f32,
}
