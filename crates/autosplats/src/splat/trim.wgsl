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

// Pixels of the workgroup that show a surface.
var<workgroup> covered: atomic<u32>;

@compute @workgroup_size(16, 16)
fn trim(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) local_index: u32,
) {
    if local_index == 0u {
        atomicStore(&covered, 0u);
    }
    workgroupBarrier();
    let columns = (frame.size.x + 15u) / 16u;
    let group = group_index(workgroup);
    let pixel = 16u * vec2u(group % columns, group / columns) + local.xy;
    if all(pixel < frame.size) {
        let at = pixel.y * frame.size.x + pixel.x;
        if sticks_out(vec2i(pixel), cover[at].rim) {
            clear(at);
        } else if cover[at].weight > 0.0 {
            atomicAdd(&covered, 1u);
        }
    }
    workgroupBarrier();
    if local_index == 0u && atomicLoad(&covered) > 0u {
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
    if own == EMPTY_RIM || own == CORE_RIM {
        return false;
    }
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
        let step = lines[line] * stride;
        let ahead = meets_core(pixel, step, strides);
        let behind = meets_core(pixel, -step, strides);
        if ahead && behind {
            return false;
        }
        is_tail |= ahead || behind;
    }
    return is_tail;
}

fn meets_core(origin: vec2i, step: vec2i, strides: i32) -> bool {
    var pixel = origin;
    for (var stride = 0; stride < strides; stride++) {
        pixel += step;
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
