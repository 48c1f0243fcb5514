// Amounts of work of splat communication's passes, handed from pass to pass.

// Two triangles.
const BOX_VERTICES = 6u;

// Arguments of an indirect draw.
struct Draw {
    vertices: u32,
    instances: u32,
    first_vertex: u32,
    first_instance: u32,
}

struct Arguments {
    // Boxes of one pixel: all screen points, and the queries.
    points: Draw,
    queries: Draw,
    // Draws of the iterations; no instances after the last one.
    clear: Draw,
    boxes: Draw,
    // Draws of the passes after the iterations.
    last_clear: Draw,
    last_boxes: Draw,
    // Workgroups that count converged points.
    count: vec3u,
    // Number of iterations so far.
    iterations: u32,
}
