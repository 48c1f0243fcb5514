// Clears the textures at the pixels of points. Draws no instance once iterations end, so that the last results stay.

@vertex
fn clear_vertex(@builtin(vertex_index) vertex: u32) -> @builtin(position) vec4f {
    // One triangle around the picture, as far away as the mask's empty pixels: only pixels of points are nearer.
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
