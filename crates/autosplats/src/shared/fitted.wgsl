// What was fitted to a point in the last frame, in its view space.

struct Fitted {
    // From the point to the surfel's centre.
    offset: vec3f,
    // Index in the cloud.
    source: u32,
    // Unit normal.
    normal: vec3f,
    // Over how many frames it is the mean.
    frames: f32,
}
