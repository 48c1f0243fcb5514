// Attribute pass: the weighted mean of all living splats within ε of the depth map, divided by the weights, and the rims
// for the trim [Paper, §7].
//
// Reads: linear, splats, tree, surfels, values, depth_map. Writes: surface, cover, extras.

#import frame
#import groups
#import surfel
#import splat
#import patch
#import layers

// Linear value of each step of a colour.
@group(0) @binding(1) var<uniform> linear: array<vec4f, 64>;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> tree: array<vec2u>;
@group(0) @binding(4) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(5) var<storage, read> values: array<u32>;
@group(0) @binding(6) var<storage, read> depth_map: array<f32>;
@group(0) @binding(7) var<storage, read_write> surface: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> cover: array<Cover>;
@group(0) @binding(9) var<storage, read_write> extras: array<vec4f>;

// What splats carry beside their normal.
override COLOR: bool;
override SCALAR: bool;
override MEASURES: bool;
// Slots for that, 64 or, where it is not carried, 1.
override COLOR_SLOTS: u32;
override SCALAR_SLOTS: u32;
override MEASURE_SLOTS: u32;
// How steeply the kernel falls.
override KERNEL_SLOPE: f32;
override CORE_WEIGHT: f32;
override INNER_WEIGHT: f32;

var<workgroup> normals: array<vec3f, GROUP>;
var<workgroup> sources: array<u32, GROUP>;
var<workgroup> reaches: array<f32, GROUP>;
var<workgroup> colors: array<vec3f, COLOR_SLOTS>;
// x the value, y its weight: 0 if it is unknown.
var<workgroup> scalars: array<vec2f, SCALAR_SLOTS>;
// Splat radius, k-radius and curvature.
var<workgroup> measures: array<vec3f, MEASURE_SLOTS>;

var<private> own_center: vec2f;
var<private> limit: f32;
var<private> weight_sum: f32;
var<private> depth_sum: f32;
var<private> normal_sum: vec3f;
var<private> color_sum: vec3f;
var<private> scalar_sum: vec2f;
var<private> measure_sum: vec3f;
// Weight of the heaviest splat, its point and its reach.
var<private> heaviest: f32;
var<private> point: u32;
var<private> reach: f32;

fn load(slot: u32, index: u32) {
    let surfel = surfels[index];
    let bounds = tree[level_start(SPLATS) + index];
    let span = vec2f(lasts(bounds) - firsts(bounds));
    normals[slot] = surfel.normal;
    sources[slot] = surfel.source;
    // About how far it reaches from its centre, in pixels.
    reaches[slot] = 0.5 * max(span.x, span.y) + 0.5;
    let words = u32(COLOR) + u32(SCALAR);
    if COLOR {
        let srgb = values[words * surfel.screen];
        colors[slot] = vec3f(to_linear(srgb), to_linear(srgb >> 8u), to_linear(srgb >> 16u));
    }
    if SCALAR {
        let bits = values[words * surfel.screen + words - 1u];
        let value = bitcast<f32>(bits);
        let known = (bits & 0x7f800000u) != 0x7f800000u;
        scalars[slot] = select(vec2f(0.0), vec2f(value, 1.0), known);
    }
    if MEASURES {
        measures[slot] = vec3f(surfel.radius, surfel.k_radius, surfel.curvature);
    }
}

fn to_linear(srgb: u32) -> f32 {
    let step = srgb & 0xffu;
    return linear[step / 4u][step % 4u];
}

fn draw(slot: u32) {
    let hit = fragment(slot, own_center);
    if hit.squared <= 1.0 && hit.depth <= limit {
        // Much like exp(-2·d²) with d in splat radii, without the exponential, and 0.003 at the end.
        var weight = 1.0 - KERNEL_SLOPE * hit.squared;
        weight *= weight;
        weight *= weight;
        weight *= weight;
        weight_sum += weight;
        depth_sum += weight * hit.depth;
        normal_sum += weight * normals[slot];
        if COLOR {
            color_sum += weight * colors[slot];
        }
        if SCALAR {
            scalar_sum += weight * scalars[slot];
        }
        if MEASURES {
            measure_sum += weight * measures[slot];
        }
        if heaviest < weight {
            heaviest = weight;
            point = sources[slot];
            reach = reaches[slot];
        }
    }
}

@compute @workgroup_size(64)
fn attributes(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup);
    if index >= patches().x * patches().y {
        return;
    }
    let corner = PATCH * vec2u(index % patches().x, index / patches().x);
    let pixel = corner + vec2u(local % PATCH, local / PATCH);
    let at = pixel.y * frame.size.x + pixel.x;
    let inside = all(pixel < frame.size);
    own_center = vec2f(pixel) + 0.5;
    point = NO_POINT;
    // Beyond the picture nothing is in front.
    limit = -1.0;
    if inside {
        limit = depth_map[at];
    }
    draw_patch(corner, local, 0u);
    if inside {
        normalize_sums(at);
    }
}

// Divides the sums by the weights into the layers.
fn normalize_sums(at: u32) {
    var rim = EMPTY_RIM;
    if heaviest >= CORE_WEIGHT || weight_sum >= INNER_WEIGHT {
        rim = CORE_RIM;
    } else if heaviest > 0.0 {
        rim = reach;
    }
    let covered = weight_sum > 0.0;
    let n = normal_sum;
    let length = sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
    var normal = vec3f(0.0);
    if length > 0.0 {
        normal = n * (1.0 / length);
    }
    // Opposite normals may cancel; then the surface is taken to face the eye.
    if covered && !(length > 1e-6 * weight_sum) {
        normal = vec3f(0.0, 0.0, -1.0);
    }
    var mean_depth = infinity();
    var color = vec3f(0.0);
    var mean_measures = vec3f(0.0);
    if covered {
        mean_depth = depth_sum / weight_sum;
        color = color_sum / weight_sum;
        mean_measures = measure_sum / weight_sum;
    }
    var scalar = not_a_number();
    if scalar_sum.y > 0.0 {
        scalar = scalar_sum.x / scalar_sum.y;
    }
    surface[at] = vec4f(normal, mean_depth);
    cover[at] = Cover(weight_sum, rim, point, scalar);
    if COLOR {
        extras[at] = vec4f(color, 0.0);
    }
    if MEASURES {
        extras[at + u32(COLOR) * frame.size.x * frame.size.y] = vec4f(mean_measures, 0.0);
    }
}
