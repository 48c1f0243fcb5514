// Colours each pixel: base colour, light, eye-dome lighting; the background where no surface is [Paper, §7].
//
// Reads: surface, cover, extras, counters, color_map, tables. Writes: image, linear.

#import frame
#import groups
#import divide
#import counters
#import layers
#import shading

@group(0) @binding(2) var<storage, read> surface: array<vec4f>;
@group(0) @binding(3) var<storage, read> cover: array<Cover>;
@group(0) @binding(4) var<storage, read> extras: array<vec4f>;
@group(0) @binding(5) var<storage, read> counters: array<u32>;
// Linear colours from the lower end of the range to the upper.
@group(0) @binding(6) var<storage, read> color_map: array<vec4f>;
// sRGB of the steps of linear light, four to a word; then the background of each row.
@group(0) @binding(7) var<storage, read> tables: array<u32>;
@group(0) @binding(8) var<storage, read_write> image: array<u32>;
@group(0) @binding(9) var<storage, read_write> linear: array<vec4f>;

// Whether backs are told apart; light and colour left on them.
override BACKS: bool;
override BACK_LIGHT: f32;
override BACK_COLOR: f32;

// Weights of red, green and blue in how bright a linear colour is.
const LUMINANCE = vec3f(0.2126, 0.7152, 0.0722);

// The colour of a value; one that is unknown gets the lower end's, and a range of no width is all middle.
fn map_color(value: f32) -> vec3f {
    var range = shading.range;
    if shading.find_range == 1u {
        range = vec2f(bitcast<f32>(counters[RANGE_LOW]), bitcast<f32>(counters[RANGE_HIGH]));
    }
    var t = 0.5;
    if range.y > range.x {
        t = (value - range.x) / (range.y - range.x);
    }
    return color_map[table_step(t, arrayLength(&color_map) - 1u)].rgb;
}

// The nearest of so many steps from 0 to 1; 0 for what is not a number.
fn table_step(t: f32, steps: u32) -> u32 {
    return select(0u, u32(min(t, 1.0) * f32(steps) + 0.5), t > 0.0);
}

fn from_srgb(value: f32) -> f32 {
    return select(pow((value + 0.055) / 1.055, 2.4), value / 12.92, value <= 0.04045);
}

fn base_color(pixel: vec2u, index: u32, surface_here: vec4f) -> vec3f {
    if SHOWN >= SHOW_HEIGHT {
        return map_color(shown_value(pixel, index, surface_here.w));
    }
    if SHOWN == SHOW_NORMAL {
        let normal = 0.5 + 0.5 * to_world(surface_here.xyz);
        return vec3f(from_srgb(normal.x), from_srgb(normal.y), from_srgb(normal.z));
    }
    if SHOWN == SHOW_COLOR {
        return extras[index].rgb;
    }
    return shading.clay;
}

// The colour of a surface that shows its back as far as the pixel says.
fn tone_back(color: vec3f, index: u32) -> vec3f {
    if !BACKS {
        return color;
    }
    let back = BACK_LIGHT * mix(vec3f(dot(color, LUMINANCE)), color, BACK_COLOR);
    return mix(color, back, extras[index].w);
}

fn light(normal: vec3f) -> f32 {
    let key = max((dot(normal, shading.key) + shading.key_wrap) / (1.0 + shading.key_wrap), 0.0);
    let fill = max(dot(normal, shading.fill), 0.0);
    let sky = shading.sky.x + (shading.sky.y - shading.sky.x) * (0.5 - 0.5 * normal.y);
    let sum = shading.key_light * key + shading.fill_light * fill + sky;
    return shading.scanned_light.x + shading.scanned_light.y * sum;
}

// How much a neighbour shades a pixel.
fn shadow_of(side: u32, pixel: vec2u, index: u32, depth: f32) -> f32 {
    let neighbor = shading.neighbors[side];
    // Beyond the left and upper edges it wraps around, to beyond the others. What is outside shades as the pixel itself.
    let at = vec2u(vec2i(pixel) + neighbor.xy);
    let is_inside = at.x < frame.size.x && at.y < frame.size.y;
    let nearer = surface[select(index, at.y * frame.size.x + at.x, is_inside)].w;
    // How steeply the nearer neighbour rises towards the eye; slopes up to 45° are surface, not a step.
    let slope = max((depth - nearer) / (pixel_size(depth) * bitcast<f32>(neighbor.z)), 1.0);
    return (slope - 1.0) / (slope + 3.0);
}

// How much light is left beside nearer surfaces.
fn eye_dome(pixel: vec2u, index: u32, depth: f32) -> f32 {
    // No loop, so that all are read at once.
    var shadow = shadow_of(0u, pixel, index, depth) + shadow_of(1u, pixel, index, depth);
    shadow += shadow_of(2u, pixel, index, depth);
    shadow += shadow_of(3u, pixel, index, depth);
    shadow += shadow_of(4u, pixel, index, depth);
    shadow += shadow_of(5u, pixel, index, depth);
    shadow += shadow_of(6u, pixel, index, depth);
    shadow += shadow_of(7u, pixel, index, depth);
    shadow = shading.eye_dome * shadow / 8.0;
    return 1.0 / (1.0 + shadow + 0.5 * shadow * shadow);
}

fn encode(channel: f32) -> u32 {
    let step = table_step(channel, shading.encode_steps);
    return (tables[step / 4u] >> (8u * (step % 4u))) & 255u;
}

fn put(pixel: vec2u, color: vec3f, rgba: u32) {
    var word = rgba;
    if shading.swap_red_blue == 1u {
        word = (word & 0xff00ff00u) | ((word & 0xffu) << 16u) | ((word >> 16u) & 0xffu);
    }
    image[pixel.y * shading.pitch + pixel.x] = word;
    if shading.keep_linear == 1u {
        linear[pixel.y * frame.size.x + pixel.x] = vec4f(color, 0.0);
    }
}

// A workgroup shades 32 by 8 pixels, whole cache lines of the image and few rows of neighbours; an invocation four of them, two
// rows apart.
@compute @workgroup_size(32, 2)
fn shade(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let columns = (frame.size.x + 31u) / 32u;
    let group = divide(group_index(workgroup), columns);
    let first = group.yx * vec2u(32u, 8u) + local.xy;
    // Background first; which of the pixels are covered become bits. A software device runs both sides of a branch but a
    // loop only as often as it must: so where nothing is covered little is computed in vain.
    var covered = 0u;
    for (var step = 0u; step < 4u; step++) {
        let pixel = first + vec2u(0u, 2u * step);
        if pixel.x < frame.size.x && pixel.y < frame.size.y {
            if is_covered(surface[pixel.y * frame.size.x + pixel.x].w) {
                covered |= 1u << step;
            } else {
                put(pixel, vec3f(0.0), tables[shading.backgrounds + pixel.y]);
            }
        }
    }
    while covered != 0u {
        let pixel = first + vec2u(0u, 2u * firstTrailingBit(covered));
        covered &= covered - 1u;
        let index = pixel.y * frame.size.x + pixel.x;
        let surface_here = surface[index];
        var color = tone_back(base_color(pixel, index, surface_here), index);
        var lit = 1.0;
        if shading.lighting == 1u {
            lit = light(surface_here.xyz);
        }
        if shading.eye_dome > 0.0 {
            lit *= eye_dome(pixel, index, surface_here.w);
        }
        color *= lit;
        put(pixel, color, encode(color.r) | (encode(color.g) << 8u) | (encode(color.b) << 16u) | 0xff000000u);
    }
}
