// Searches of points in the compute form.

// The search of a point, as in `Search`, and its first search radius.
struct PointSearch {
    low: f32,
    high: f32,
    count: f32,
    initial_radius: f32,
}
