// Trim: takes off the tails that splats leave around a silhouette. The CPU form, `trim.rs`, says how.
//
// Reads: centers. Reads and writes: surface, cover, extras. What is read of them, the rims, is not written. Writes: counters.

#import frame
#import groups
#import counters
#import layers

@group(0) @binding(1) var<storage, read_write> surface: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> cover: array<Cover>;
@group(0) @binding(3) var<storage, read_write> extras: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> centers: array<u32>;

// How far lines go, in reaches of the splat; strides in a reach; pixels added to how far they go.
override FURTHEST: f32;
override STRIDES_PER_REACH: f32;
override LEAST_REACH_PX: i32;
// Longest stride that stops where those of neighbours do.
override LONGEST_ALIGNED: i32;
// What points around a pixel at the border are, where their mean may be, and when they tell.
override AROUND_PX: f32;
override OFF_PX: f32;
override DENSE_REACH_PX: f32;
override FEWEST: f32;
// Steps of a centre's place in its pixel.
override STEPS: f32;

// Side of the square of pixels of a workgroup.
const SQUARE = 32u;
const GROUP = 64u;
// Pixels on each side of the workgroup's square that tell of its border: `MARGIN` of the CPU form; and that square.
const MARGIN = 4u;
const WIDE = 40u;

// Pixels of the workgroup that stay.
var<workgroup> covered: atomic<u32>;
// Those that may stick out, as places in the square: few of many, so that invocations look for them together first and
// each has one to follow lines from then.
var<workgroup> tails: array<u32, 1024>;
var<workgroup> tail_count: atomic<u32>;
// For each row of the wide square, a bit for each pixel that is empty: the first 32 columns, then the others.
var<workgroup> empties: array<atomic<u32>, 80>;
// The same of pixels in the middle of an empty square.
var<workgroup> middles: array<vec2u, 40>;

@compute @workgroup_size(64)
fn trim(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&covered, 0u);
        atomicStore(&tail_count, 0u);
    }
    for (var word = local; word < 2u * WIDE; word += GROUP) {
        atomicStore(&empties[word], 0u);
    }
    workgroupBarrier();
    let columns = (frame.size.x + SQUARE - 1u) / SQUARE;
    let group = group_index(workgroup);
    let corner = SQUARE * vec2u(group % columns, group / columns);
    for (var place = local; place < WIDE * WIDE; place += GROUP) {
        let at = vec2u(place % WIDE, place / WIDE);
        // Pixels before the first are far beyond the last.
        let pixel = corner + at - MARGIN;
        if all(pixel < frame.size) && cover[pixel.y * frame.size.x + pixel.x].rim == EMPTY_RIM {
            atomicOr(&empties[2u * at.y + at.x / 32u], 1u << (at.x % 32u));
        }
    }
    workgroupBarrier();
    if local > 0u && local < WIDE - 1u {
        let all = empty_row(local - 1u) & empty_row(local) & empty_row(local + 1u);
        let after = vec2u((all.x >> 1u) | (all.y << 31u), all.y >> 1u);
        let before = vec2u(all.x << 1u, (all.y << 1u) | (all.x >> 31u));
        middles[local] = all & after & before;
    }
    workgroupBarrier();
    var stay = 0u;
    for (var place = local; place < SQUARE * SQUARE; place += GROUP) {
        let at = vec2u(place % SQUARE, place / SQUARE);
        let pixel = corner + at;
        if all(pixel < frame.size) {
            let rim = cover[pixel.y * frame.size.x + pixel.x].rim;
            stay += select(1u, 0u, rim == EMPTY_RIM);
            if rim != EMPTY_RIM && (rim > EMPTY_RIM || is_border(at)) {
                tails[atomicAdd(&tail_count, 1u)] = place;
            }
        }
    }
    workgroupBarrier();
    for (var tail = local; tail < atomicLoad(&tail_count); tail += GROUP) {
        let place = vec2u(tails[tail] % SQUARE, tails[tail] / SQUARE);
        let pixel = corner + place;
        let at = pixel.y * frame.size.x + pixel.x;
        if sticks_out(pixel, cover[at].rim, is_border(place)) {
            clear(at);
            stay -= 1u;
        }
    }
    // It may have found more to take off than to stay: the sum over the workgroup is right all the same.
    atomicAdd(&covered, stay);
    workgroupBarrier();
    if local == 0u && atomicLoad(&covered) > 0u {
        atomicAdd(&counters[COVERED], atomicLoad(&covered));
    }
}

// Leaves nothing at a pixel.
fn clear(at: u32) {
    surface[at] = vec4f(0.0, 0.0, 0.0, infinity());
    cover[at].weight = 0.0;
    cover[at].point = NO_POINT;
    cover[at].scalar = not_a_number();
    for (var plane = at; plane < arrayLength(&extras); plane += frame.size.x * frame.size.y) {
        extras[plane] = vec4f(0.0);
    }
}

fn empty_row(row: u32) -> vec2u {
    return vec2u(atomicLoad(&empties[2u * row]), atomicLoad(&empties[2u * row + 1u]));
}

// Whether a pixel of the square is close to the middle of an empty square of three.
fn is_border(place: vec2u) -> bool {
    // Around it in the wide square, five of the outer rows' pixels and seven of the others'.
    var inner = vec2u(0u);
    for (var row = 2u; row < 7u; row++) {
        inner |= middles[place.y + row];
    }
    let outer = middles[place.y + 1u] | middles[place.y + 7u];
    return (seven_bits(place.x, inner) | (seven_bits(place.x, outer) & 62u)) != 0u;
}

// Of a row's bits, those of the seven pixels around a column of the square.
fn seven_bits(column: u32, bits: vec2u) -> u32 {
    // The first of them is one beyond that column; shifted twice, as a word cannot be shifted by its width.
    return (((bits.x >> column) >> 1u) | (bits.y << (31u - column))) & 127u;
}

fn sticks_out(pixel: vec2u, own: f32, border: bool) -> bool {
    var points = Points(false, vec2f(0.0));
    if border {
        points = points_around(pixel, own);
    }
    if !points.tell {
        return own > EMPTY_RIM && is_open(vec2i(pixel), own);
    }
    if !is_off(points.offset) {
        return false;
    }
    // The pixel farther out has to go too.
    let out = outward(pixel, points.offset);
    let rim = cover[out.y * frame.size.x + out.x].rim;
    if rim == EMPTY_RIM {
        return true;
    }
    let beyond = points_around(out, rim);
    return select(rim > EMPTY_RIM, is_off(beyond.offset), beyond.tell);
}

// Whether points whose mean has this offset lie beside a pixel rather than around it.
fn is_off(offset: vec2f) -> bool {
    return dot(offset, offset) > OFF_PX * OFF_PX;
}

// The pixel beside one that is farthest from points at this offset.
fn outward(pixel: vec2u, offset: vec2f) -> vec2u {
    let away = select(pixel + 1u, pixel - 1u, offset > vec2f(0.0));
    return select(vec2u(pixel.x, away.y), vec2u(away.x, pixel.y), abs(offset.x) > abs(offset.y));
}

// The points around a pixel: whether they are dense enough to tell of a border, and the mean of their offsets in pixels.
struct Points {
    tell: bool,
    offset: vec2f,
}

fn points_around(pixel: vec2u, rim: f32) -> Points {
    let window = u32(AROUND_PX);
    // Of points beyond the picture nothing is known.
    if any(pixel < vec2u(window)) || any(pixel + window >= frame.size) || abs(rim) > DENSE_REACH_PX {
        return Points(false, vec2f(0.0));
    }
    var points = 0.0;
    var sum = 0.0;
    var offsets = vec2f(0.0);
    for (var y = 0u; y <= 2u * window; y++) {
        for (var x = 0u; x <= 2u * window; x++) {
            let there = centers_of(pixel + vec2u(x, y) - window);
            let offset = there.xy + (vec2f(vec2u(x, y)) - f32(window));
            let near = max(1.0 - dot(offset, offset) / (AROUND_PX * AROUND_PX), 0.0);
            let weight = there.z * near * near * near;
            points += there.z;
            sum += weight;
            offsets += weight * offset;
        }
    }
    return Points(points >= FEWEST && sum > 0.0, offsets / max(sum, 1e-9));
}

// The mean of a pixel's centres from its middle, in pixels, and how many there are.
fn centers_of(pixel: vec2u) -> vec3f {
    let bits = centers[pixel.y * frame.size.x + pixel.x];
    let count = f32(bits >> 24u);
    let sums = vec2f(vec2u(bits, bits >> 12u) & vec2u(0xfffu));
    return vec3f((sums / max(count, 1.0) + 0.5) / STEPS - 0.5, count);
}

fn is_open(pixel: vec2i, own: f32) -> bool {
    // Wide splats have wide cores, which strides do not miss; so the work per pixel is bounded whatever the density.
    let stride = i32(max(own / STRIDES_PER_REACH, 1.0));
    let strides = i32(FURTHEST * own) / stride + LEAST_REACH_PX;
    // The eight lines.
    var lines = array(
        vec2i(1, 0), vec2i(0, 1), vec2i(1, 1), vec2i(1, -1), vec2i(2, 1), vec2i(1, 2), vec2i(2, -1), vec2i(1, -2),
    );
    // What has no core anywhere around, as a point alone, sticks out of nothing.
    var is_tail = false;
    for (var line = 0u; line < 8u; line++) {
        let ahead = meets_core(pixel, lines[line], stride, strides);
        // Where nothing is ahead, what is behind tells only of a core anywhere around.
        let behind = (ahead || !is_tail) && meets_core(pixel, -lines[line], stride, strides);
        if ahead && behind {
            return false;
        }
        is_tail |= ahead || behind;
    }
    return is_tail;
}

fn meets_core(origin: vec2i, direction: vec2i, stride: i32, strides: i32) -> bool {
    // Lines of neighbours stop at the same places if strides are short.
    let by_x = abs(direction.x) == 1;
    let beyond = select(origin.y, origin.x, by_x) % stride;
    let is_up = select(direction.y, direction.x, by_x) > 0;
    let aligned = select(beyond, stride - beyond, is_up || beyond == 0);
    let first = select(aligned, stride, stride > LONGEST_ALIGNED);
    for (var at = 0; at < strides; at++) {
        let pixel = origin + direction * (first + at * stride);
        if any(pixel < vec2i(0)) || any(pixel >= vec2i(frame.size)) {
            // Beyond the picture the surface goes on.
            return true;
        }
        let rim = cover[u32(pixel.y) * frame.size.x + u32(pixel.x)].rim;
        if rim <= EMPTY_RIM {
            return rim < EMPTY_RIM;
        }
    }
    return false;
}
