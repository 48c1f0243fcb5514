// Attribute pass: the weighted mean of all living splats within ε of the depth map, and for the trim the rims and the
// bits of blocks [Paper, §7].
//
// Reads: linear, splats, tree, surfels, values, depth_map. Writes: surface, extras; reads and writes: cover. Does not
// write again where a patch was and stays empty.

#import frame
#import blocks
#import depth_map
#import groups
#import layers
#import patch
#import splat
#import surfel

// Linear value of each 8-bit step of a colour.
@group(0) @binding(1) var<uniform> linear: array<vec4f, 64>;
@group(0) @binding(2) var<storage, read> splats: array<Splat>;
@group(0) @binding(3) var<storage, read> tree: array<vec2u>;
@group(0) @binding(4) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(5) var<storage, read> values: array<u32>;
@group(0) @binding(6) var<storage, read> depth_map: array<u32>;
@group(0) @binding(7) var<storage, read_write> surface: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> cover: array<Cover>;
@group(0) @binding(9) var<storage, read_write> extras: array<vec4f>;

// Optional attributes of splats.
override COLOR: bool;
override SCALAR: bool;
override MEASURES: bool;
override BACKS: bool;
// Workgroup slots for each attribute: 64, or 1 for an absent one.
override COLOR_SLOTS: u32;
override SCALAR_SLOTS: u32;
override MEASURE_SLOTS: u32;
override BACK_SLOTS: u32;

// What an earlier frame told of the patch.
var<workgroup> was_left_empty: bool;
// Columns and rows of blocks in a patch, and their bits, row by row.
const PATCH_BLOCKS = PATCH / BLOCK_PX;
var<workgroup> rims: array<atomic<u32>, PATCH_BLOCKS.x * PATCH_BLOCKS.y>;
var<workgroup> normals: array<vec3f, BATCH>;
var<workgroup> sources: array<u32, BATCH>;
var<workgroup> reaches: array<f32, BATCH>;
var<workgroup> colors: array<vec3f, COLOR_SLOTS>;
// Value (x) and weight (y), which is 0 for an unknown value.
var<workgroup> scalars: array<vec2f, SCALAR_SLOTS>;
// Splat radius, k-radius and curvature.
var<workgroup> measures: array<vec3f, MEASURE_SLOTS>;
// 1 if the surface shows its back, else 0.
var<workgroup> backs: array<f32, BACK_SLOTS>;

// Sums of four pixels in a column, one per vector component.
struct Sums {
    // Limit from the depth map.
    limit: vec4f,
    weight: vec4f,
    depth: vec4f,
    normal: mat3x4f,
    color: mat3x4f,
    // Sum of the values, and of the weights of known values.
    scalar: mat2x4f,
    measures: mat3x4f,
    back: vec4f,
    // Weight, point and reach of the heaviest splat.
    heaviest: vec4f,
    point: vec4u,
    reach: vec4f,
}

// The invocation's eight pixels: their centres, and the sums of the upper and lower four.
var<private> own_x: f32;
var<private> own_y: vec4f;
var<private> upper: Sums;
var<private> lower: Sums;

// Attributes of one splat.
struct Carried {
    normal: vec3f,
    color: vec3f,
    scalar: vec2f,
    measures: vec3f,
    back: f32,
    source: u32,
    reach: f32,
}

fn load(slot: u32, index: u32) {
    let surfel = surfels[index];
    let bounds = tree[level_start(SPLATS) + index];
    let span = vec2f(lasts(bounds) - firsts(bounds));
    normals[slot] = surfel.normal;
    sources[slot] = surfel.source;
    // Approximate reach from the centre, in pixels.
    reaches[slot] = 0.5 * max(span.x, span.y) + 0.5;
    let words = u32(COLOR) + u32(SCALAR);
    let screen = screen_of(surfel);
    if COLOR {
        let srgb = values[words * screen];
        colors[slot] = vec3f(to_linear(srgb), to_linear(srgb >> 8u), to_linear(srgb >> 16u));
    }
    if SCALAR {
        let bits = values[words * screen + words - 1u];
        let value = bitcast<f32>(bits);
        let known = (bits & 0x7f800000u) != 0x7f800000u;
        scalars[slot] = select(vec2f(0.0), vec2f(value, 1.0), known);
    }
    if MEASURES {
        measures[slot] = vec3f(surfel.radius, surfel.k_radius, surfel.curvature);
    }
    if BACKS {
        backs[slot] = f32(shows_back(surfel));
    }
}

fn to_linear(srgb: u32) -> f32 {
    let step = srgb & 0xffu;
    return linear[step / 4u][step % 4u];
}

fn draw(slot: u32) {
    let brush = brushes[slot];
    var carried: Carried;
    carried.normal = normals[slot];
    carried.source = sources[slot];
    carried.reach = reaches[slot];
    if COLOR {
        carried.color = colors[slot];
    }
    if SCALAR {
        carried.scalar = scalars[slot];
    }
    if MEASURES {
        carried.measures = measures[slot];
    }
    if BACKS {
        carried.back = backs[slot];
    }
    add(&upper, fragments(brush, own_x, own_y), carried);
    add(&lower, fragments(brush, own_x, own_y + 4.0), carried);
}

fn add(sums: ptr<private, Sums>, hit: Fragments, carried: Carried) {
    var kernel = 1.0 - KERNEL_SLOPE * hit.squared;
    kernel *= kernel;
    kernel *= kernel;
    kernel *= kernel;
    let weight = select(vec4f(0.0), kernel, (hit.squared <= vec4f(1.0)) & (hit.depth <= (*sums).limit));
    (*sums).weight += weight;
    (*sums).depth += weight * hit.depth;
    let n = carried.normal;
    (*sums).normal += mat3x4f(weight * n.x, weight * n.y, weight * n.z);
    if COLOR {
        let c = carried.color;
        (*sums).color += mat3x4f(weight * c.x, weight * c.y, weight * c.z);
    }
    if SCALAR {
        let s = carried.scalar;
        (*sums).scalar += mat2x4f(weight * s.x, weight * s.y);
    }
    if MEASURES {
        let m = carried.measures;
        (*sums).measures += mat3x4f(weight * m.x, weight * m.y, weight * m.z);
    }
    if BACKS {
        (*sums).back += weight * carried.back;
    }
    let heavier = (*sums).heaviest < weight;
    (*sums).heaviest = select((*sums).heaviest, weight, heavier);
    (*sums).point = select((*sums).point, vec4u(carried.source), heavier);
    (*sums).reach = select((*sums).reach, vec4f(carried.reach), heavier);
}

@compute @workgroup_size(BATCH)
fn attributes(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup);
    if index >= patches().x * patches().y {
        return;
    }
    let corner = PATCH * vec2u(index % patches().x, index / patches().x);
    let pixel = corner + own_offset(local);
    own_x = f32(pixel.x) + 0.5;
    own_y = f32(pixel.y) + vec4f(0.5, 1.5, 2.5, 3.5);
    begin(&upper, pixel);
    begin(&lower, pixel + vec2u(0u, 4u));
    let mark = patch_mark(corner);
    if local < PATCH_BLOCKS.x * PATCH_BLOCKS.y {
        atomicStore(&rims[local], 0u);
    }
    if local == 0u {
        was_left_empty = cover[mark].point == LEFT_EMPTY;
    }
    let is_left_empty = workgroupUniformLoad(&was_left_empty);
    let is_met = draw_patch(corner, local);
    if is_left_empty && !is_met {
        return;
    }
    // The upper four rows lie in one block, the lower four in the next.
    let own = own_offset(local) / BLOCK_PX;
    atomicOr(&rims[own.y * PATCH_BLOCKS.x + own.x], end(&upper, pixel));
    atomicOr(&rims[(own.y + 1u) * PATCH_BLOCKS.x + own.x], end(&lower, pixel + vec2u(0u, 4u)));
    if local == 0u {
        cover[mark].point = select(LEFT_EMPTY, 0u, is_met);
    }
    workgroupBarrier();
    if local < PATCH_BLOCKS.x * PATCH_BLOCKS.y {
        let block = corner / BLOCK_PX + vec2u(local % PATCH_BLOCKS.x, local / PATCH_BLOCKS.x);
        if all(block < block_counts()) {
            cover[block_mark(block)].point = atomicLoad(&rims[local]);
        }
    }
}

// Index of the pixel `below` rows under another; that of the last row if it lies beyond the picture.
fn pixel_index(pixel: vec2u, below: u32) -> u32 {
    let inside = min(pixel + vec2u(0u, below), frame.size - 1u);
    return inside.y * frame.size.x + inside.x;
}

fn limit_at(pixel: vec2u, below: u32) -> f32 {
    return key_depth(depth_map[pixel_index(pixel, below)]);
}

fn begin(sums: ptr<private, Sums>, first: vec2u) {
    (*sums).limit = vec4f(limit_at(first, 0u), limit_at(first, 1u), limit_at(first, 2u), limit_at(first, 3u));
    (*sums).point = vec4u(NO_POINT);
}

// Stores four pixels, and returns their bits in their block: see `blocks`.
fn end(sums: ptr<private, Sums>, first: vec2u) -> u32 {
    let upper_bits = normalize_sums(sums, first, 0u) | normalize_sums(sums, first, 1u);
    return upper_bits | normalize_sums(sums, first, 2u) | normalize_sums(sums, first, 3u);
}

// Divides the sums of one of four pixels by the weights, into the layers. Returns the pixel's bits in its block.
fn normalize_sums(sums: ptr<private, Sums>, first: vec2u, i: u32) -> u32 {
    if any(first + vec2u(0u, i) >= frame.size) {
        return 0u;
    }
    let at = pixel_index(first, i);
    let weight = (*sums).weight[i];
    let heaviest = (*sums).heaviest[i];
    var rim = EMPTY_RIM;
    if heaviest >= CORE_WEIGHT || weight >= INNER_WEIGHT {
        rim = -(*sums).reach[i];
    } else if heaviest > 0.0 {
        rim = (*sums).reach[i];
    }
    let covered = weight > 0.0;
    let n = vec3f((*sums).normal[0][i], (*sums).normal[1][i], (*sums).normal[2][i]);
    let length = sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
    var normal = vec3f(0.0);
    if length > 0.0 {
        normal = n * (1.0 / length);
    }
    // Opposite normals may cancel. Then the surface counts as facing the eye.
    if covered && !(length > 1e-6 * weight) {
        normal = vec3f(0.0, 0.0, -1.0);
    }
    let divisor = select(1.0, weight, covered);
    surface[at] = vec4f(normal, select(infinity(), (*sums).depth[i] / divisor, covered));
    var scalar = not_a_number();
    if (*sums).scalar[1][i] > 0.0 {
        scalar = (*sums).scalar[0][i] / (*sums).scalar[1][i];
    }
    cover[at] = Cover(weight, rim, (*sums).point[i], scalar);
    // Sums are zero where no surface is.
    if COLOR {
        let c = (*sums).color;
        extras[at] = vec4f(c[0][i], c[1][i], c[2][i], (*sums).back[i]) / divisor;
    }
    if MEASURES {
        let m = (*sums).measures;
        extras[at + u32(COLOR) * frame.size.x * frame.size.y] = vec4f(m[0][i], m[1][i], m[2][i], (*sums).back[i]) / divisor;
    }
    if BACKS && !COLOR && !MEASURES {
        extras[at] = vec4f(0.0, 0.0, 0.0, (*sums).back[i] / divisor);
    }
    return select(select(0u, 0x10000u, rim < EMPTY_RIM), 1u, rim == EMPTY_RIM) << rim_bit(first + vec2u(0u, i));
}
