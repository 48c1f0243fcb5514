// Trim: removes the tails that splats leave around a silhouette. The CPU form is `trim.rs`.
//
// Reads: centers, sixteenths, statistics, held. Reads and writes: surface, cover, extras. Writes: counters. Of other
// pixels it reads only the rims and the bits of blocks, which no invocation writes. Squares that no splat meets are
// left as they are.

#import frame
#import blocks
#import blurred
#import groups
#import layers
#import noise
#import patches
#import picture

@group(0) @binding(1) var<storage, read_write> surface: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> cover: array<Cover>;
@group(0) @binding(3) var<storage, read_write> extras: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> centers: array<u32>;
@group(0) @binding(6) var<storage, read> sixteenths: array<u32>;
@group(0) @binding(7) var<storage, read> statistics: FrameStatistics;
@group(0) @binding(8) var<storage, read> held: array<u32>;

// 1 to trim, 0 only to count covered pixels.
override TRIMS: u32;

// Side of the square of a workgroup, with the pixels around that its border tests read.
const WIDE = SQUARE + 2u * MARGIN;
// Blocks around the square's that show whether a fringe meets emptiness, one more than its width; and the side of the
// square with them.
const BLOCK_MARGIN = FRINGE_BLOCKS + 1u;
const WIDE_BLOCKS = SQUARE / BLOCK_PX + 2u * BLOCK_MARGIN;

// Number of the workgroup's pixels that stay.
var<workgroup> covered: atomic<u32>;
// Pixels that may stick out, as places in the square. They are few, so the workgroup finds them together first, and
// then each invocation follows the lines of one.
var<workgroup> tails: array<u32, SQUARE * SQUARE>;
var<workgroup> tail_count: atomic<u32>;
// Bits of empty pixels, per row of the wide square: the first 32 columns, then the others.
var<workgroup> empties: array<atomic<u32>, 2u * WIDE>;
// Bits of pixels in cores, per row of the square.
var<workgroup> cores: array<atomic<u32>, SQUARE>;
// Bits of the middles of empty 3×3 squares, likewise.
var<workgroup> middles: array<vec2u, WIDE>;
// Bits of empty blocks, per row of blocks, likewise.
var<workgroup> empty_blocks: array<atomic<u32>, 2u * WIDE_BLOCKS>;
var<workgroup> is_any_empty: atomic<u32>;
// Whether no splat meets the square.
var<workgroup> is_left_empty: bool;
// Masks of the sixteenths ahead in each direction, then those behind: two words of four rows each.
var<workgroup> sides: array<vec2u, 2u * DIRECTIONS>;

@compute @workgroup_size(SMALL_GROUP)
fn trim(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let columns = (frame.size.x + SQUARE - 1u) / SQUARE;
    let group = group_index(workgroup);
    let corner = SQUARE * vec2u(group % columns, group / columns);
    if local == 0u {
        is_left_empty = is_square_left_empty(corner);
    }
    if workgroupUniformLoad(&is_left_empty) {
        return;
    }
    if local == 0u {
        atomicStore(&covered, 0u);
        atomicStore(&tail_count, 0u);
        atomicStore(&is_any_empty, 0u);
    }
    for (var word = local; word < 2u * WIDE; word += SMALL_GROUP) {
        atomicStore(&empties[word], 0u);
    }
    for (var word = local; word < 2u * WIDE_BLOCKS; word += SMALL_GROUP) {
        atomicStore(&empty_blocks[word], 0u);
    }
    if local < SQUARE {
        atomicStore(&cores[local], 0u);
    }
    if local < 2u * DIRECTIONS {
        var masks = SIDES;
        sides[local] = masks[local];
    }
    workgroupBarrier();
    // The margin is a block wide.
    const ACROSS_WIDE = WIDE / BLOCK_PX;
    for (var place = local; place < ACROSS_WIDE * ACROSS_WIDE && TRIMS == 1u; place += SMALL_GROUP) {
        let at = vec2u(place % ACROSS_WIDE, place / ACROSS_WIDE);
        // Unsigned wrap-around moves blocks before the first far beyond the last.
        let block = corner / BLOCK_PX + at - 1u;
        if all(block < block_counts()) {
            let rims = cover[block_mark(block)].point;
            let first = BLOCK_PX * at;
            for (var row = 0u; row < BLOCK_PX; row++) {
                let empty = (rims >> (BLOCK_PX * row)) & 15u;
                atomicOr(&empties[2u * (first.y + row) + first.x / 32u], empty << (first.x % 32u));
            }
            if rims >= 0x10000u && all(at > vec2u(0u)) && all(at < vec2u(ACROSS_WIDE - 1u)) {
                for (var row = 0u; row < BLOCK_PX; row++) {
                    let core = (rims >> (16u + BLOCK_PX * row)) & 15u;
                    atomicOr(&cores[first.y + row - MARGIN], core << (first.x - MARGIN));
                }
            }
        }
    }
    if statistics.noise.level > 0.0 {
        for (var place = local; place < WIDE_BLOCKS * WIDE_BLOCKS; place += SMALL_GROUP) {
            let at = vec2u(place % WIDE_BLOCKS, place / WIDE_BLOCKS);
            // Unsigned wrap-around moves blocks before the first far beyond the last.
            let block = corner / BLOCK_PX + at - BLOCK_MARGIN;
            if all(block < block_counts()) && is_empty_block(block) {
                atomicOr(&empty_blocks[2u * at.y + at.x / 32u], 1u << (at.x % 32u));
                atomicStore(&is_any_empty, 1u);
            }
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
    for (var place = local; place < SQUARE * SQUARE; place += SMALL_GROUP) {
        let at = vec2u(place % SQUARE, place / SQUARE);
        let pixel = corner + at;
        if all(pixel < frame.size) && !is_empty_at(at, pixel) {
            stay += select(1u, 0u, beside_picture(pixel) > 0u);
            if TRIMS == 1u && (!is_core_at(at) || is_gap(at) || is_blurred(at, pixel)) {
                tails[atomicAdd(&tail_count, 1u)] = place;
            }
        }
    }
    // One invocation may clear a pixel that another has read.
    storageBarrier();
    workgroupBarrier();
    for (var tail = local; tail < atomicLoad(&tail_count); tail += SMALL_GROUP) {
        let place = vec2u(tails[tail] % SQUARE, tails[tail] / SQUARE);
        let pixel = corner + place;
        let at = pixel.y * frame.size.x + pixel.x;
        if sticks_out(place, pixel, cover[at].rim) {
            clear(at);
            stay -= select(0u, 1u, beside_picture(pixel) == 0u);
        }
    }
    // `stay` may wrap below 0; the sum over the workgroup is right all the same.
    atomicAdd(&covered, stay);
    workgroupBarrier();
    if local == 0u && atomicLoad(&covered) > 0u {
        atomicAdd(&counters[COVERED], atomicLoad(&covered));
    }
}

fn is_square_left_empty(corner: vec2u) -> bool {
    for (var y = corner.y; y < min(corner.y + SQUARE, frame.size.y); y += PATCH.y) {
        for (var x = corner.x; x < min(corner.x + SQUARE, frame.size.x); x += PATCH.x) {
            if cover[patch_mark(vec2u(x, y))].point != LEFT_EMPTY {
                return false;
            }
        }
    }
    return true;
}

// Empties a pixel.
fn clear(at: u32) {
    surface[at] = vec4f(0.0, 0.0, 0.0, infinity());
    cover[at].weight = 0.0;
    cover[at].point = NO_POINT;
    cover[at].scalar = not_a_number();
    for (var plane = at; plane < arrayLength(&extras); plane += frame.size.x * frame.size.y) {
        extras[plane] = vec4f(0.0);
    }
}

// Whether a pixel of the square is empty.
fn is_empty_at(place: vec2u, pixel: vec2u) -> bool {
    if TRIMS == 0u {
        return cover[pixel.y * frame.size.x + pixel.x].rim == EMPTY_RIM;
    }
    let row = empty_row(place.y + MARGIN);
    return (seven_bits(place.x, row) & 8u) != 0u;
}

// Whether a pixel of the square is in a core.
fn is_core_at(place: vec2u) -> bool {
    return ((atomicLoad(&cores[place.y]) >> place.x) & 1u) == 1u;
}

// Whether noise may blur the border beside a pixel of the square.
fn is_blurred(place: vec2u, pixel: vec2u) -> bool {
    if atomicLoad(&is_any_empty) == 0u {
        return false;
    }
    return blurred_by(place, pixel, abs(cover[pixel.y * frame.size.x + pixel.x].rim)) > 0.0;
}

fn empty_row(row: u32) -> vec2u {
    return vec2u(atomicLoad(&empties[2u * row]), atomicLoad(&empties[2u * row + 1u]));
}

// Whether a pixel of the square is close to an empty pixel.
fn is_gap(place: vec2u) -> bool {
    // Five rows around the pixel: three pixels of the outer rows, five of the others.
    let row = place.y + MARGIN;
    let inner = empty_row(row - 1u) | empty_row(row) | empty_row(row + 1u);
    let outer = empty_row(row - 2u) | empty_row(row + 2u);
    return ((seven_bits(place.x, inner) & 62u) | (seven_bits(place.x, outer) & 28u)) != 0u;
}

// Whether a pixel of the square is close to the middle of an empty 3×3 square, and so to an empty pixel too.
fn is_border(place: vec2u) -> bool {
    // Seven rows around the pixel: five pixels of the outer rows, seven of the others.
    var inner = vec2u(0u);
    for (var row = 2u; row < 7u; row++) {
        inner |= middles[place.y + row];
    }
    let outer = middles[place.y + 1u] | middles[place.y + 7u];
    return (seven_bits(place.x, inner) | (seven_bits(place.x, outer) & 62u)) != 0u;
}

// Bits of the seven pixels around a column of the square.
fn seven_bits(column: u32, bits: vec2u) -> u32 {
    // Bit 0 is one beyond that column. Shifted twice, as a word cannot be shifted by its width.
    return (((bits.x >> column) >> 1u) | (bits.y << (31u - column))) & 127u;
}

// A direction across a border; from `DIRECTIONS` on the opposite one.
fn across(which: u32) -> vec2i {
    var directions = ACROSS;
    let direction = directions[which % DIRECTIONS];
    return select(direction, -direction, which >= DIRECTIONS);
}

// Noise in pixels that may blur the border beside a pixel, covered by a splat of this reach. 0 if there is too little,
// or nothing empty within a fringe.
fn blurred_by(place: vec2u, pixel: vec2u, reach_px: f32) -> f32 {
    if atomicLoad(&is_any_empty) == 0u {
        return 0.0;
    }
    let noise = noise_px(statistics.noise, pixel, surface[pixel.y * frame.size.x + pixel.x], reach_px);
    if !(noise >= MIN_BLURRING_NOISE_PX) {
        return 0.0;
    }
    let margin = u32(ceil(fringe_px(reach_px, noise) / f32(BLOCK_PX))) + 1u;
    let middle = place / BLOCK_PX + BLOCK_MARGIN;
    let columns = bits_below(middle.x + margin + 1u) & ~bits_below(middle.x - margin);
    var found = vec2u(0u);
    for (var row = middle.y - margin; row <= middle.y + margin; row++) {
        let empty = vec2u(atomicLoad(&empty_blocks[2u * row]), atomicLoad(&empty_blocks[2u * row + 1u]));
        found |= empty & columns;
    }
    return select(noise, 0.0, all(found == vec2u(0u)));
}

// Bits of two words below `bit`, which is less than 64.
fn bits_below(bit: u32) -> vec2u {
    let part = (1u << (bit % 32u)) - 1u;
    return select(vec2u(part, 0u), vec2u(0xffffffffu, part), bit >= 32u);
}

fn sticks_out(place: vec2u, pixel: vec2u, own: f32) -> bool {
    var answer = SILENT;
    let noise = blurred_by(place, pixel, abs(own));
    if noise > 0.0 {
        answer = is_beside_blurred(pixel, abs(own), noise, statistics.noise.sure);
    }
    if answer == SILENT && is_gap(place) {
        answer = is_beside(pixel, abs(own) > MAX_NARROW_REACH_PX, is_border(place));
    }
    if answer == SILENT {
        return own > EMPTY_RIM && is_open(vec2i(pixel), own);
    }
    return answer == YES;
}

// Answer of the points around a pixel; `SILENT` if they do not decide.
const SILENT = 0u;
const YES = 1u;
const NO = 2u;

// Whether a pixel is beside the surface by the points around. `wide` states whether its splat is wide, `border` whether
// an empty 3×3 square is close.
fn is_beside(pixel: vec2u, wide: bool, border: bool) -> u32 {
    let window = u32(SPLAT_WINDOW_PX);
    // Points beyond the screen are unknown.
    if any(pixel < vec2u(window)) || any(pixel + window >= frame.size) {
        return SILENT;
    }
    let points = around(pixel);
    let of_disc = count_disc(points);
    let open = open_side(points);
    if of_disc >= select(MIN_SIXTEENTHS[0], MIN_SIXTEENTHS[1], wide) && open < 2u * DIRECTIONS {
        let towards = across(open);
        let steep = 2 * abs(towards) >= vec2i(max(abs(towards.x), abs(towards.y)));
        let step = select(vec2i(0), sign(towards), steep);
        if !border && !is_empty(vec2u(vec2i(pixel) + step)) && !is_empty(vec2u(vec2i(pixel) + 2 * step)) {
            return SILENT;
        }
        // A thin structure or an isolated point has points in this pixel, and no closed pixel behind it. It stays, or
        // it would vanish.
        if all((points & OWN_SIXTEENTHS) == vec2u(0u)) {
            return YES;
        }
        let behind = vec2u(vec2i(pixel) - step);
        return select(NO, YES, !is_empty(behind) && open_side(around(behind)) == 2u * DIRECTIONS);
    }
    if of_disc >= DECISIVE_SIXTEENTHS {
        return NO;
    }
    if !border {
        return SILENT;
    }
    return mean_of_splats(pixel, select(MIN_SPLATS[0], MIN_SPLATS[1], wide));
}

// Rim of a pixel: 1 if the pixel is empty, plus 0x10000 if it is in a core.
fn rim_of(pixel: vec2u) -> u32 {
    let block = pixel / BLOCK_PX;
    return (cover[block_mark(block)].point >> rim_bit(pixel)) & 0x10001u;
}

fn is_empty(pixel: vec2u) -> bool {
    return (rim_of(pixel) & 1u) == 1u;
}

fn count(bits: vec2u) -> u32 {
    return countOneBits(bits.x) + countOneBits(bits.y);
}

// Number of sixteenths within a pixel of the middle.
fn count_disc(points: vec2u) -> u32 {
    return count(points & (sides[0] | sides[DIRECTIONS]));
}

// The side with the fewest marked sixteenths around a pixel; twice `DIRECTIONS` if every side has enough.
fn open_side(points: vec2u) -> u32 {
    let all = count_disc(points);
    let told = select(DIRECTIONS, LINES, all < FINE_DIRECTION_SIXTEENTHS);
    var open = 0u;
    var least = all;
    for (var at = 0u; at < 2u * told; at++) {
        let which = select(at, at - told + DIRECTIONS, at >= told);
        let there = count(points & sides[which]);
        if there < least {
            open = which;
            least = there;
        }
    }
    return select(2u * DIRECTIONS, open, SIDE_SHARE_DIVISOR * least < max(all, 1u));
}

// Marked sixteenths of the 8×8 around a pixel's middle, a bit each, row by row.
fn around(pixel: vec2u) -> vec2u {
    var rows = vec2u(0u);
    for (var row = 0u; row < 8u; row++) {
        let at = (pixel.y + (row + 2u) / 4u - 1u) * frame.size.x + pixel.x;
        let of_pixel = 4u * ((row + 2u) % 4u);
        let left = (of_pixel_at(at - 1u) >> of_pixel) & 15u;
        let own = (of_pixel_at(at) >> of_pixel) & 15u;
        let right = (of_pixel_at(at + 1u) >> of_pixel) & 3u;
        rows[row / 4u] |= ((left >> 2u) | (own << 2u) | (right << 6u)) << (8u * (row % 4u));
    }
    return rows;
}

// Marked sixteenths of a pixel.
fn of_pixel_at(index: u32) -> u32 {
    return (sixteenths[index / 2u] >> (16u * (index % 2u))) & 0xffffu;
}

// Whether the mean of the splats around a pixel is far from its middle; `SILENT` if they are too few.
fn mean_of_splats(pixel: vec2u, fewest: f32) -> u32 {
    let window = u32(SPLAT_WINDOW_PX);
    var splats = 0.0;
    var sum = 0.0;
    var offsets = vec2f(0.0);
    for (var y = 0u; y <= 2u * window; y++) {
        for (var x = 0u; x <= 2u * window; x++) {
            let there = centers_of(pixel + vec2u(x, y) - window);
            let offset = there.xy + (vec2f(vec2u(x, y)) - f32(window));
            let near = max(1.0 - dot(offset, offset) / (SPLAT_WINDOW_PX * SPLAT_WINDOW_PX), 0.0);
            let weight = there.z * near * near * near;
            splats += select(0.0, there.z, weight > 0.0);
            sum += weight;
            offsets += weight * offset;
        }
    }
    if splats < fewest {
        return SILENT;
    }
    let offset = offsets / sum;
    return select(NO, YES, dot(offset, offset) > MAX_SPLAT_MEAN_OFFSET_PX * MAX_SPLAT_MEAN_OFFSET_PX);
}

// Offset in pixels of the mean of a pixel's centres from its middle, and their number.
fn centers_of(pixel: vec2u) -> vec3f {
    let bits = centers[pixel.y * frame.size.x + pixel.x];
    let count = f32(bits >> 24u);
    let sums = vec2f(vec2u(bits, bits >> 12u) & vec2u(0xfffu));
    return vec3f((sums / max(count, 1.0) + 0.5) / CENTER_STEPS - 0.5, count);
}

fn is_open(pixel: vec2i, own: f32) -> bool {
    // Wide splats have wide cores, which strides do not miss. So the work per pixel is bounded whatever the density.
    let stride = i32(max(own / STRIDES_PER_REACH, 1.0));
    let strides = i32(LINE_LENGTH_REACHES * own) / stride + EXTRA_STRIDES;
    // A pixel without any core on its lines, such as that of an isolated point, sticks out of nothing.
    var is_tail = false;
    for (var line = 0u; line < LINES; line++) {
        let ahead = meets_core(pixel, across(line), stride, strides);
        // One direction alone closes nothing in. The opposite direction matters only while no core was met at all.
        let behind = (ahead || !is_tail) && meets_core(pixel, -across(line), stride, strides);
        if ahead && behind {
            return false;
        }
        is_tail |= ahead || behind;
    }
    return is_tail;
}

fn meets_core(origin: vec2i, direction: vec2i, stride: i32, strides: i32) -> bool {
    // Short strides stop at the same places as those of neighbouring pixels.
    let by_x = abs(direction.x) == 1;
    let beyond = select(origin.y, origin.x, by_x) % stride;
    let is_up = select(direction.y, direction.x, by_x) > 0;
    let aligned = select(beyond, stride - beyond, is_up || beyond == 0);
    let first = select(aligned, stride, stride > MAX_ALIGNED_STRIDE_PX);
    for (var at = 0; at < strides; at++) {
        let pixel = origin + direction * (first + at * stride);
        if any(pixel < vec2i(0)) || any(pixel >= vec2i(frame.size)) {
            // Beyond the screen the surface goes on.
            return true;
        }
        let rim = rim_of(vec2u(pixel));
        if rim != 0u {
            return rim > 1u;
        }
    }
    return false;
}
