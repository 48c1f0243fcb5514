// Shades each pixel: base colour, light and occlusion, the background where no surface is, and at edges a part of the
// neighbour's colour [Paper, §7]. The CPU form is `cpu.rs`, `occlusion.rs` and `edges.rs`.
//
// Reads: surface, cover, extras, counters, color_map, tables. Writes: image, linear.

#import frame
#import divide
#import groups
#import layers
#import picture
#import shading
#import srgb

@group(0) @binding(2) var<storage, read> surface: array<vec4f>;
@group(0) @binding(3) var<storage, read> cover: array<Cover>;
@group(0) @binding(4) var<storage, read> extras: array<vec4f>;
@group(0) @binding(5) var<storage, read> counters: array<u32>;
// Linear colours of the map, from its lower end to its upper end.
@group(0) @binding(6) var<storage, read> color_map: array<vec4f>;
// Table from linear light to sRGB, four steps to a word; then the background of each row.
@group(0) @binding(7) var<storage, read> tables: array<u32>;
@group(0) @binding(8) var<storage, read_write> image: array<u32>;
@group(0) @binding(9) var<storage, read_write> linear: array<vec4f>;

// Whether backs are toned.
override BACKS: bool;

// The linear colour of a value. An unknown value gets the colour of the lower end; in a range as narrow as noise every
// value gets the middle colour.
fn map_color(value: f32) -> vec3f {
    var range = shading.range;
    var noise = 0.0;
    if shading.find_range == 1u {
        range = vec2f(bitcast<f32>(counters[RANGE_LOW]), bitcast<f32>(counters[RANGE_HIGH]));
        noise = max(shading.value_noise, RANGE_NOISE * max(abs(range.x), abs(range.y)));
    }
    var t = 0.5;
    if range.y - range.x > noise {
        t = (value - range.x) / (range.y - range.x);
    }
    return color_map[table_step(t, arrayLength(&color_map) - 1u)].rgb;
}

fn base_color(pixel: vec2u, index: u32, surface_here: vec4f) -> vec3f {
    if SHOWN >= SHOW_HEIGHT {
        return map_color(shown_value(pixel, index, surface_here.w));
    }
    if SHOWN == SHOW_NORMAL {
        let normal = 0.5 + 0.5 * to_world(surface_here.xyz);
        return from_srgb(normal);
    }
    if SHOWN == SHOW_COLOR {
        return extras[index].rgb;
    }
    return CLAY;
}

// The colour toned by the pixel's share of back.
fn tone_back(color: vec3f, index: u32) -> vec3f {
    if !BACKS {
        return color;
    }
    let back = BACK_LIGHT * mix(vec3f(dot(color, LUMINANCE)), color, BACK_COLOR);
    return mix(color, back, extras[index].w);
}

fn light(normal: vec3f) -> vec3f {
    let key = max((dot(normal, KEY) + KEY_WRAP) / (1.0 + KEY_WRAP), 0.0);
    let fill = max(dot(normal, FILL), 0.0);
    let around = GROUND + (SKY - GROUND) * (0.5 - 0.5 * normal.y);
    let sum = KEY_LIGHT * key + FILL_LIGHT * fill + around;
    return shading.given_light.x + shading.given_light.y * sum;
}

// A lit colour as shown, compressed above the shoulder.
fn tone(color: vec3f) -> vec3f {
    let above = max(color - SHOULDER, vec3f(0.0)) / (1.0 - SHOULDER);
    return min(color, vec3f(SHOULDER)) + (1.0 - SHOULDER) * above / (1.0 + above);
}

// Deeper than any surface. A finite number, because devices need not support infinity.
const NOTHING = 1e30;

fn is_inside(pixel: vec2i) -> bool {
    // Pixels beyond the left and upper edges wrap around to beyond the others.
    let at = vec2u(pixel);
    return all(at < frame.picture);
}

// The depth at a pixel, which may lie beyond the picture.
fn depth_at(pixel: vec2i) -> f32 {
    let inside = is_inside(pixel);
    let depth = surface[select(0u, screen_index(vec2u(pixel)), inside)].w;
    return select(NOTHING, min(depth, NOTHING), inside);
}

// Rise of the surface towards the eye from a depth to one beside it, as height by distance, limited as in
// `occlusion.rs`.
fn rise(depth: f32, there: f32, scale: f32) -> f32 {
    let slope = max((depth - there) * scale, -MAX_FULL_RISE);
    return min(slope, max(MAX_FULL_RISE * MAX_FULL_RISE / max(slope, MIN_RISE), FARTHEST_RISE));
}

// Share of the light that a pair of pixels takes away.
fn pair_occlusion(index: u32, pixel: vec2i, depth: f32, pixels_per_unit: f32) -> f32 {
    let pair = shading.pairs[index];
    let step = vec2i(pair.step);
    let scale = pixels_per_unit * pair.inverse_px;
    let a = rise(depth, depth_at(pixel + step), scale);
    let b = rise(depth, depth_at(pixel - step), scale);
    let cosine = (1.0 - a * b) * inverseSqrt((1.0 + a * a) * (1.0 + b * b));
    return select(0.0, (1.0 - cosine) * 0.5 * pair.part, a + b > 0.0);
}

// Light left by occlusion, 0 to 1.
fn light_left(pixel: vec2i, depth: f32) -> f32 {
    let scale = 1.0 / pixel_size(depth);
    // Unrolled, so that all depths are read at once.
    var occlusion = pair_occlusion(0u, pixel, depth, scale) + pair_occlusion(1u, pixel, depth, scale);
    occlusion += pair_occlusion(2u, pixel, depth, scale);
    occlusion += pair_occlusion(3u, pixel, depth, scale);
    occlusion += pair_occlusion(4u, pixel, depth, scale);
    occlusion += pair_occlusion(5u, pixel, depth, scale);
    occlusion += pair_occlusion(6u, pixel, depth, scale);
    occlusion += pair_occlusion(7u, pixel, depth, scale);
    occlusion += pair_occlusion(8u, pixel, depth, scale);
    occlusion += pair_occlusion(9u, pixel, depth, scale);
    let shadow = occlusion * shading.darkening;
    return 1.0 / (1.0 + shadow + 0.5 * shadow * shadow);
}

// 1 if depth b lies behind a, -1 if in front, 0 if both may be one surface.
fn edge_step(a: f32, b: f32) -> i32 {
    let behind = b > a * shading.edge_factor + shading.edge_offset;
    let before = a > b * shading.edge_factor + shading.edge_offset;
    return select(0, 1, behind) - select(0, 1, before);
}

fn side_of(index: u32) -> vec2i {
    let step = select(-1, 1, (index & 1u) == 1u);
    return select(vec2i(0, step), vec2i(step, 0), index >= 2u);
}

// The normal that light falls on. The inner normal is taken at an edge where the surface falls back towards its border,
// but its normal there is tilted less.
fn outward_normal(pixel: vec2i, surface_here: vec4f, at_edge: bool) -> vec3f {
    var outward = vec2i(0);
    for (var index = select(4u, 0u, at_edge); index < 4u; index++) {
        let side = side_of(index);
        if is_inside(pixel + side) && edge_step(surface_here.w, depth_at(pixel + side)) == 1 {
            outward += side;
        }
    }
    let inner_pixel = pixel - INNER_NORMAL_PX * outward;
    if !(depth_at(inner_pixel) < surface_here.w) {
        return surface_here.xyz;
    }
    let inner = surface[screen_index(vec2u(inner_pixel))].xyz;
    let tilts = vec2f(outward) * mat2x2f(surface_here.xy, inner.xy);
    return select(surface_here.xyz, inner, tilts.x < tilts.y - MIN_TILT_LOSS);
}

// The colour of the surface at a pixel.
fn surface_color(pixel: vec2u, at_edge: bool) -> vec3f {
    let index = screen_index(pixel);
    let surface_here = surface[index];
    var color = tone_back(base_color(pixel, index, surface_here), index);
    if shading.darkening > 0.0 {
        color *= light_left(vec2i(pixel), surface_here.w);
    }
    if shading.lighting == 1u {
        color = tone(color * light(outward_normal(vec2i(pixel), surface_here, at_edge)));
    }
    return color;
}

// Distance to the end of a row of edges, and 1 if the row turns into the pixel's own row there.
fn edge_end(pixel: vec2i, side: vec2i, kind: i32, along: vec2i) -> vec2i {
    var last = vec2f(depth_at(pixel), depth_at(pixel + side));
    for (var distance = 1; distance <= EDGE_SEARCH_PX; distance++) {
        let at = pixel + along * distance;
        if !is_inside(at) {
            // Beyond the picture the edge goes on.
            break;
        }
        let next = vec2f(depth_at(at), depth_at(at + side));
        let here = edge_step(last.x, next.x);
        let there = edge_step(next.y, last.y);
        if here != 0 || there != 0 || edge_step(next.x, next.y) != kind {
            return vec2i(distance, select(0, 1, here == kind && there == 0));
        }
        last = next;
    }
    return vec2i(EDGE_SEARCH_PX, 0);
}

// Part of a pixel that the border cuts off towards one of its ends.
fn part_beside(end: vec2i, length: f32) -> f32 {
    let high = 0.5 - f32(end.x - 1) / length;
    let low = 0.5 - f32(end.x) / length;
    let cut = select(select(0.0, 0.5 * high * high * length, high > 0.0), 0.5 * (high + low), low >= 0.0);
    return select(0.0, cut, end.y == 1);
}

// Part of a pixel that its neighbour takes, 0 to 1.
fn part_of(side: vec2i, pixel: vec2i) -> f32 {
    let kind = edge_step(depth_at(pixel), depth_at(pixel + side));
    var part = 0.0;
    if kind != 0 && is_inside(pixel + side) {
        let back = edge_end(pixel, side, kind, -side.yx);
        let ahead = edge_end(pixel, side, kind, side.yx);
        let length = f32(back.x + ahead.x - 1);
        part = part_beside(back, length) + part_beside(ahead, length);
    }
    return part;
}

// Word of a pixel of which `part` is covered in one colour and the rest is background.
fn over(color: vec3f, part: f32, background: u32) -> u32 {
    if background == 0u {
        return encode_color(color, ENCODE_STEPS) | (u32(part * 255.0 + 0.5) << 24u);
    }
    let bytes = vec3f(vec3u(background, background >> 8u, background >> 16u) & vec3u(255u)) / 255.0;
    let behind = from_srgb(bytes);
    return encode_color(behind + (color - behind) * part, ENCODE_STEPS) | 0xff000000u;
}

fn put(pixel: vec2u, color: vec3f, rgba: u32) {
    var word = rgba;
    if shading.swap_red_blue == 1u {
        word = (word & 0xff00ff00u) | ((word & 0xffu) << 16u) | ((word >> 16u) & 0xffu);
    }
    image[pixel.y * shading.pitch + pixel.x] = word;
    if shading.keep_linear == 1u {
        linear[pixel.y * frame.picture.x + pixel.x] = vec4f(color, 0.0);
    }
}

// A workgroup shades SHADE_GROUP pixels: whole cache lines of the image, and few rows of neighbours. An invocation
// shades four pixels, two rows apart.
@compute @workgroup_size(32, 2)
fn shade(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let columns = (frame.picture.x + SHADE_GROUP.x - 1u) / SHADE_GROUP.x;
    let group = divide(group_index(workgroup), columns);
    let first = group.yx * SHADE_GROUP + local.xy;
    // Background first; bits mark the pixels that show more. A software device runs both sides of a branch, but a loop
    // only as often as needed. So little is computed in vain where nothing is covered.
    var shows = 0u;
    var edges = 0u;
    for (var step = 0u; step < 4u; step++) {
        let pixel = first + vec2u(0u, 2u * step);
        if all(pixel < frame.picture) {
            let depth = depth_at(vec2i(pixel));
            var has_edge = false;
            for (var side = 0u; side < 4u; side++) {
                has_edge |= edge_step(depth, depth_at(vec2i(pixel) + side_of(side))) != 0;
            }
            if has_edge || depth != NOTHING {
                shows |= 1u << step;
                edges |= select(0u, 1u << step, has_edge);
            } else {
                put(pixel, vec3f(0.0), tables[shading.backgrounds + pixel.y]);
            }
        }
    }
    while shows != 0u {
        let step = firstTrailingBit(shows);
        shows &= shows - 1u;
        let pixel = first + vec2u(0u, 2u * step);
        var side = vec2i(0);
        var part = 0.0;
        let at_edge = (edges & (1u << step)) != 0u;
        for (var index = select(4u, 0u, at_edge); index < 4u; index++) {
            let side_part = part_of(side_of(index), vec2i(pixel));
            if side_part > part {
                side = side_of(index);
                part = side_part;
            }
        }
        // The pixel's own colour, then that of its neighbour.
        let is_surface = depth_at(vec2i(pixel)) != NOTHING;
        let beside_is_surface = part > 0.0 && depth_at(vec2i(pixel) + side) != NOTHING;
        var own = vec3f(0.0);
        var beside = vec3f(0.0);
        for (var index = select(1u, 0u, is_surface); index < select(1u, 2u, beside_is_surface); index++) {
            let color = surface_color(vec2u(vec2i(pixel) + select(vec2i(0), side, index == 1u)), at_edge);
            own = select(own, color, index == 0u);
            beside = select(beside, color, index == 1u);
        }
        var rgba = tables[shading.backgrounds + pixel.y];
        if is_surface && (beside_is_surface || part == 0.0) {
            rgba = encode_color(own + (beside - own) * part, ENCODE_STEPS) | 0xff000000u;
        } else if is_surface {
            rgba = over(own, 1.0 - part, rgba);
        } else if beside_is_surface {
            rgba = over(beside, part, rgba);
        }
        put(pixel, own, rgba);
    }
}
