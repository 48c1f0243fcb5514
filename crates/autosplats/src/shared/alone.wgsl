// Balls that an invocation sums up by itself. Imports: quadric. See `together`.

// The first cells of a ball that are an invocation's own, four in a row, and how far it is to the next: columns and rows.
fn own_start() -> vec2u {
    return vec2u(0u);
}

fn own_step() -> vec2u {
    return vec2u(4u, 1u);
}

fn all_of_plane(own: PlaneSums) -> PlaneSums {
    return own;
}

fn all_of_quadric(own: QuadricSums) -> QuadricSums {
    return own;
}

fn all_of_seen(own: vec4f) -> vec4f {
    return own;
}
