// Empties what points draw into, where there are points. Where nothing is to be done any more nothing is emptied either: so the
// last results stay where they are.

@vertex
fn clear_vertex(@builtin(vertex_index) vertex: u32) -> @builtin(position) vec4f {
    // One triangle about the picture, as far away as the mask has empty pixels: only those of points are nearer.
    return vec4f(f32(4u * (vertex & 1u)) - 1.0, f32(2u * (vertex & 2u)) - 1.0, 1.0, 1.0);
}

struct Nothing {
    @location(0) first: vec4f,
    @location(1) second: vec4f,
}

@fragment
fn clear_fragment() -> Nothing {
    return Nothing(vec4f(0.0), vec4f(0.0));
}
