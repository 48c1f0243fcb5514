// What shading is told beside the frame, and the values that it can show. Imports: frame, layers. The including pass
// binds `surface`, `cover` and `extras`.

struct ShadeUniform {
    // Directions to the lights in view space, and their linear colours.
    key: vec3f,
    // How far the key light reaches around.
    key_wrap: f32,
    key_light: vec3f,
    // Brightness from which a lit colour rises less.
    shoulder: f32,
    fill: vec3f,
    // How much occlusion darkens.
    darkening: f32,
    fill_light: vec3f,
    // The steepest that something rises beside a pixel, and what the furthest counts for.
    steepest: f32,
    // Light of the ground and of the sky, on surfaces that face down and up.
    ground: vec3f,
    furthest: f32,
    sky: vec3f,
    // What a rise is divided by at least.
    least_rise: f32,
    // Linear colour of a surface without colours.
    clay: vec3f,
    // What is deeper than this factor times a pixel's depth, plus the offset, is not the same surface.
    edge_factor: f32,
    // Direction of rising height, world space.
    up: vec3f,
    edge_offset: f32,
    // Light whatever the normal, and the share of the lights above.
    given_light: vec2f,
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
    // How far the ends of a row of edges are looked for, in pixels.
    edge_search: i32,
    // A normal at a border is not used if it is tilted so much less towards it than one further in.
    less_tilted: f32,
    // Pairs of pixels for occlusion: the step to the second one, one by its length in pixels, and the pair's part.
    pairs: array<vec4f, 10>,
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

// The value shown at a pixel of the picture, `index` on the screen. Heights are told from the cloud's origin.
fn shown_value(pixel: vec2u, index: u32, depth: f32) -> f32 {
    switch SHOWN {
        case SHOW_HEIGHT: {
            let position_view = unproject(vec2f(pixel + frame.margin) + 0.5, depth);
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
