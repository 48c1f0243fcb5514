// Draws the picture into the viewport. Reads the texture of the picture, writes the colour target of the window.

@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var picture_sampler: sampler;
@group(0) @binding(2) var<uniform> reading: Reading;

/// How the texture is read.
struct Reading {
    /// Texels of a pixel of the picture, along each side.
    supersample: u32,
    /// 1 if texels and the window have sRGB's values, 0 if they are converted from and to light.
    encoded: u32,
}

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

/// Light of an sRGB value.
fn light(value: vec3f) -> vec3f {
    return select(pow((value + 0.055) / 1.055, vec3f(2.4)), value / 12.92, value <= vec3f(0.04045));
}

/// The sRGB value of light.
fn encoded(light: vec3f) -> vec3f {
    return select(1.055 * pow(light, vec3f(1.0 / 2.4)) - 0.055, 12.92 * light, light <= vec3f(0.0031308));
}

/// Mean light of a pixel's texels, weighted by alpha, as `Image::averaged` takes it.
fn averaged(place: vec2f) -> vec4f {
    let size = textureDimensions(picture) / reading.supersample;
    let first = min(vec2u(place * vec2f(size)), size - 1u) * reading.supersample;
    var sum = vec4f(0.0);
    for (var y = 0u; y < reading.supersample; y++) {
        for (var x = 0u; x < reading.supersample; x++) {
            let texel = textureLoad(picture, first + vec2u(x, y), 0);
            let color = select(texel.rgb, light(texel.rgb), reading.encoded == 1u);
            sum += vec4f(color * texel.a, texel.a);
        }
    }
    let mean = select(sum.rgb / sum.a, vec3f(0.0), sum.a == 0.0);
    let alpha = sum.a / f32(reading.supersample * reading.supersample);
    return vec4f(select(mean, encoded(mean), reading.encoded == 1u), alpha);
}

@fragment
fn pixel(corner: Corner) -> @location(0) vec4f {
    var color: vec4f;
    if reading.supersample > 1u {
        color = averaged(corner.place);
    } else {
        color = textureSample(picture, picture_sampler, corner.place);
    }
    return vec4f(mix(GROUND, color.rgb, color.a), 1.0);
}
