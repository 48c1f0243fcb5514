// Balls that each invocation sums up by itself: on software, where invocations side by side would all solve the same
// equations. Software Vulkan silently ends an invocation after 65535 rounds of its loops in sum, so that one takes a
// single ball, cell or surfel. Alternative: `together`.

#import quadric

// Whether the invocation stores what it found.
fn tells() -> bool {
    return true;
}

// First cells of a ball that the invocation reads, four side by side, and the step to its next cells: columns and rows.
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
