// Uniform of shading, beside the frame's, and the values that shading can show. The including pass binds `surface`,
// `cover` and `extras`.

#import frame
#import picture

struct ShadeUniform {
    // Direction of rising height, world space.
    up: vec3f,
    // Strength of the darkening by occlusion.
    darkening: f32,
    // Light independent of the normal, and the share of the lights.
    given_light: vec2f,
    // Ends of the colour map, unless `find_range` is set.
    range: vec2f,
    // A depth larger than a pixel's depth times this factor plus the offset belongs to another surface.
    edge_factor: f32,
    edge_offset: f32,
    find_range: u32,
    lighting: u32,
    keep_linear: u32,
    // 1 if the bytes of the image are blue, green, red.
    swap_red_blue: u32,
    // Pixels from one row of the image to the next.
    pitch: u32,
    // Sampling of pixels to find the range: step, and number of samples.
    sample_step: u32,
    samples: u32,
    // Start of the rows' backgrounds in the tables.
    backgrounds: u32,
    // Start of the measures in `extras`.
    measures: u32,
    // Least width of a range that is found, beside RANGE_NOISE.
    value_noise: f32,
    // Pairs of pixels for occlusion.
    pairs: array<ShadePair, PAIR_COUNT>,
}

// Pixels on either side of a pixel.
struct ShadePair {
    // Step to the second pixel.
    step: vec2f,
    // Inverse length of the step in pixels.
    inverse_px: f32,
    // Weight of the pair.
    part: f32,
}

@group(0) @binding(1) var<uniform> shading: ShadeUniform;

// What the surface is coloured by. A constant, because software devices run all branches.
override SHOWN: u32;

// Whether a surface covers a pixel of this depth.
fn is_covered(depth: f32) -> bool {
    return is_finite(depth);
}

// Rotates a direction from view to world space.
fn to_world(direction: vec3f) -> vec3f {
    let m = frame.view_from_world;
    return vec3f(dot(m[0], direction), dot(m[1], direction), dot(m[2], direction));
}

// Value shown at a pixel of the picture; `index` is the pixel's index on the screen. Heights are relative to the
// cloud's origin.
fn shown_value(pixel: vec2u, index: u32, depth: f32) -> f32 {
    switch SHOWN {
        case SHOW_HEIGHT: {
            let position_view = unproject(vec2f(pixel + margin()) + 0.5, depth);
            return dot(to_world(position_view * frame.unstretched.xyz) + frame.eye_local, shading.up);
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
