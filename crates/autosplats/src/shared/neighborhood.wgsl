// Neighbourhoods: the results of the search.

// Sums over a point's neighbours, relative to the point itself, which is not counted.
struct Neighborhood {
    // Σ(q - p), view space.
    offset: vec3f,
    // Number of neighbours; 0 if the point is an outlier.
    count: f32,
    // Σ(q - p)(q - p)ᵀ: xx, xy, xz.
    second_x: vec3f,
    // Distance to the furthest neighbour, world units.
    k_radius: f32,
    // yy, yz, zz.
    second_yz: vec3f,
    padding: u32,
}
