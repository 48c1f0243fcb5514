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

// Numbers of workgroups that take `items`, LARGE_GROUP each.
fn groups_of(items: u32) -> vec3u {
    let groups = (items + LARGE_GROUP - 1u) / LARGE_GROUP;
    return vec3u(min(groups, GROUPS_PER_ROW), (groups + GROUPS_PER_ROW - 1u) / GROUPS_PER_ROW, 1u);
}

struct Arguments {
    // The raster form's boxes of one pixel: all screen points, and the queries.
    points: Draw,
    queries: Draw,
    // The raster form's draws of the iterations; no instances after the last one.
    clear: Draw,
    boxes: Draw,
    // The raster form's draws of the passes after the iterations.
    last_clear: Draw,
    last_boxes: Draw,
    // Workgroups that take queries in the iterations; none after the last one.
    queries_groups: vec3u,
    // Number of iterations so far.
    iterations: u32,
    // Workgroups that take all screen points in the iterations of the compute form.
    points_groups: vec3u,
    padding: u32,
}
