// How much the passes of splat communication draw, told from one to the next.

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
    // Of the iterations; without instances once they have ended.
    clear: Draw,
    boxes: Draw,
    // Of the passes after them.
    last_clear: Draw,
    last_boxes: Draw,
    // Workgroups that count converged points.
    count: vec3u,
    // How many iterations there were.
    iterations: u32,
}
