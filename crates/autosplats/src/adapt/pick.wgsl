// Picks the sample: an invocation per surfel. See the CPU form.
//
// Reads: frame, counters, surfels. Writes: picked, the unordered indices of the sampled surfels, then their number.

#import frame
#import groups
#import surfel

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(3) var<storage, read_write> picked: array<atomic<u32>>;

fn mix_bits(number: u32) -> u32 {
    let first = (number ^ (number >> 16u)) * 0x85ebca6bu;
    let second = (first ^ (first >> 13u)) * 0xc2b2ae35u;
    return second ^ (second >> 16u);
}

// Hashes a place in view space by the cell of the world that it lies in.
fn hash_place(place: vec3f) -> u32 {
    let pixel = bitcast<u32>(pixel_size(place.z));
    let cells = bitcast<f32>(0x7f000000u - (pixel & 0x7f800000u));
    let high = frame.eye_parts[0].xyz * cells;
    let whole = floor(high);
    let from_eye = (place * frame.unstretched.xyz) * frame.view_from_world;
    // Never below 0. Without `max`, compilers may add up `high` and `from_eye` first, which rounds by whole cells.
    let rest = max(high - whole, vec3f(0.0));
    let part = rest + frame.eye_parts[1].xyz * cells + from_eye * cells + CELL_SHIFT;
    let low_bits = whole - round(whole * 0x1p-32) * 0x1p32;
    let cell = vec3u(vec3i(low_bits) + vec3i(floor(part)));
    return mix_bits(mix_bits(mix_bits(cell.x) ^ cell.y) ^ cell.z);
}

@compute @workgroup_size(SMALL_GROUP)
fn pick(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let place = group_index(workgroup) * SMALL_GROUP + local;
    let len = counters[ACTIVE];
    let below = (0xffffffffu / max(len, NOISE_SAMPLE_COUNT)) * NOISE_SAMPLE_COUNT;
    if place >= len || hash_place(surfels[place].center) >= below {
        return;
    }
    // A dropped point has no ball; cells lack the neighbours of near points.
    if !is_dropped(surfels[place]) && !is_near(surfels[place]) {
        let at = atomicAdd(&picked[MOST_SAMPLED], 1u);
        if at < MOST_SAMPLED {
            atomicStore(&picked[at], place);
        }
    }
}
