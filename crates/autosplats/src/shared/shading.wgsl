// What shading is told beside the frame, and the values that it can show. Imports: frame, layers. The including pass
// binds `surface`, `cover` and `extras`.

struct ShadeUniform {
    // Directions to the lights in view space.
    key: vec3f,
    key_light: f32,
    fill: vec3f,
    fill_light: f32,
    // Linear colour of a surface without colours.
    clay: vec3f,
    // How far the key light reaches around.
    key_wrap: f32,
    // Direction of rising height, world space.
    up: vec3f,
    // Strength of eye-dome lighting.
    eye_dome: f32,
    // Light of the sky on surfaces that face down, and on those that face up.
    sky: vec2f,
    // Light whatever the normal, and the share of the lights above.
    scanned_light: vec2f,
    // Ends of the colour map, if they are not to be found.
    range: vec2f,
    find_range: u32,
    lighting: u32,
    keep_linear: u32,
    // Bytes of the image are blue, green, red.
    swap_red_blue: u32,
    // Pixels from one row of the image to the next.
    pitch: u32,
    // Every how many pixels one is looked at to find the range, and how many these are.
    sample_step: u32,
    samples: u32,
    // Steps of the table from linear to sRGB.
    encode_steps: u32,
    // Where in the tables the backgrounds of rows begin.
    backgrounds: u32,
    // Where among the extras the measures begin.
    measures: u32,
    // Neighbours for eye-dome lighting: steps in x and y, and the bits of the distance in pixels.
    neighbors: array<vec4i, 8>,
}

@group(0) @binding(1) var<uniform> shading: ShadeUniform;

// What a surface can be coloured by: from SHOW_HEIGHT on these are values.
const SHOW_CLAY = 0u;
const SHOW_COLOR = 1u;
const SHOW_NORMAL = 2u;
const SHOW_HEIGHT = 3u;
const SHOW_DEPTH = 4u;
const SHOW_RADIUS = 5u;
const SHOW_K_RADIUS = 6u;
const SHOW_CURVATURE = 7u;
const SHOW_SCALAR = 8u;

// What the surface is coloured by. A constant, because software devices run all branches.
override SHOWN: u32;

// Whether a surface covers a pixel of this depth.
fn is_covered(depth: f32) -> bool {
    return is_finite(depth);
}

// From view to world space.
fn to_world(direction: vec3f) -> vec3f {
    let m = frame.view_from_world;
    return vec3f(dot(m[0], direction), dot(m[1], direction), dot(m[2], direction));
}

// The value shown at a pixel. Heights are told from the cloud's origin.
fn shown_value(pixel: vec2u, index: u32, depth: f32) -> f32 {
    switch SHOWN {
        case SHOW_HEIGHT: {
            let position_view = unproject(vec2f(pixel) + 0.5, depth);
            return dot(to_world(position_view) + frame.eye_local, shading.up);
        }
        case SHOW_RADIUS: {
            return extras[shading.measures + index].x;
        }
        case SHOW_K_RADIUS: {
            return extras[shading.measures + index].y;
        }
        case SHOW_CURVATURE: {
            return extras[shading.measures + index].z;
        }
        case SHOW_SCALAR: {
            return cover[index].scalar;
        }
        default: {
            return depth;
        }
    }
}
