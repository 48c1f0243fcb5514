// Draws the picture into the viewport. Reads the texture of the picture, writes the colour target of the window.

@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var picture_sampler: sampler;

/// Background colour where the picture is transparent.
const GROUND: vec3f = vec3f(0.17, 0.19, 0.215);

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) place: vec2f,
}

/// One triangle that covers the whole viewport.
@vertex
fn corner(@builtin(vertex_index) index: u32) -> Corner {
    let place = vec2f(f32((index << 1u) & 2u), f32(index & 2u));
    return Corner(vec4f(2.0 * place.x - 1.0, 1.0 - 2.0 * place.y, 0.0, 1.0), place);
}

@fragment
fn pixel(corner: Corner) -> @location(0) vec4f {
    let color = textureSample(picture, picture_sampler, corner.place);
    return vec4f(mix(GROUND, color.rgb, color.a), 1.0);
}
