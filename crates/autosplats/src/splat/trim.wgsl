// Trim: takes off the tails that splats leave around a silhouette. The CPU form, `trim.rs`, says how.
//
// Reads and writes: surface, cover, extras. What is read, the rims, is not written. Writes: counters.

#import frame
#import groups
#import counters
#import layers

@group(0) @binding(1) var<storage, read_write> surface: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> cover: array<Cover>;
@group(0) @binding(3) var<storage, read_write> extras: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>>;

// How far lines go, in reaches of the splat; strides in a reach; pixels added to how far they go.
override FURTHEST: f32;
override STRIDES_PER_REACH: f32;
override LEAST_REACH_PX: i32;
// Longest stride that stops where those of neighbours do.
override LONGEST_ALIGNED: i32;

// Side of the square of pixels of a workgroup.
const SQUARE = 32u;
const GROUP = 64u;

// Pixels of the workgroup that stay.
var<workgroup> covered: atomic<u32>;
// Those that may stick out, as places in the square: few of many, so that invocations look for them together first and
// each has one to follow lines from then.
var<workgroup> tails: array<u32, 1024>;
var<workgroup> tail_count: atomic<u32>;

@compute @workgroup_size(64)
fn trim(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&covered, 0u);
        atomicStore(&tail_count, 0u);
    }
    workgroupBarrier();
    let columns = (frame.size.x + SQUARE - 1u) / SQUARE;
    let group = group_index(workgroup);
    let corner = SQUARE * vec2u(group % columns, group / columns);
    var stay = 0u;
    for (var place = local; place < SQUARE * SQUARE; place += GROUP) {
        let pixel = corner + vec2u(place % SQUARE, place / SQUARE);
        if all(pixel < frame.size) {
            let rim = cover[pixel.y * frame.size.x + pixel.x].rim;
            stay += select(1u, 0u, rim == EMPTY_RIM);
            if rim != EMPTY_RIM && rim != CORE_RIM {
                tails[atomicAdd(&tail_count, 1u)] = place;
            }
        }
    }
    workgroupBarrier();
    for (var tail = local; tail < atomicLoad(&tail_count); tail += GROUP) {
        let pixel = corner + vec2u(tails[tail] % SQUARE, tails[tail] / SQUARE);
        let at = pixel.y * frame.size.x + pixel.x;
        if sticks_out(vec2i(pixel), cover[at].rim) {
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

fn sticks_out(pixel: vec2i, own: f32) -> bool {
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
        if rim == EMPTY_RIM {
            return false;
        }
        if rim == CORE_RIM {
            return true;
        }
    }
    return false;
}
