// Conversion between sRGB and linear light. The including pass binds `tables`: sRGB of the steps of linear light, four
// to a word.

fn from_srgb(value: vec3f) -> vec3f {
    return select(pow((value + 0.055) / 1.055, vec3f(2.4)), value / 12.92, value <= vec3f(0.04045));
}

// The nearest of `steps` steps from 0 to 1; 0 for NaN.
fn table_step(t: f32, steps: u32) -> u32 {
    return select(0u, u32(min(t, 1.0) * f32(steps) + 0.5), t > 0.0);
}

// A linear channel in sRGB, by a table of `steps` steps.
fn encode(channel: f32, steps: u32) -> u32 {
    let step = table_step(channel, steps);
    return (tables[step / 4u] >> (8u * (step % 4u))) & 255u;
}

fn encode_color(color: vec3f, steps: u32) -> u32 {
    return encode(color.r, steps) | (encode(color.g, steps) << 8u) | (encode(color.b, steps) << 16u);
}
