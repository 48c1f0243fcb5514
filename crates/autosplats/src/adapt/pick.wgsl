// Picks the sample: an invocation per surfel. See the CPU form.
//
// Reads: counters, surfels, names. Writes: picked, the unordered indices of the sampled surfels, then their number.

#import groups
#import names
#import surfel

@group(0) @binding(0) var<storage, read> counters: array<u32>;
@group(0) @binding(1) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(2) var<storage, read> names: array<u32>;
@group(0) @binding(3) var<storage, read_write> picked: array<atomic<u32>>;

fn hash_index(number: u32) -> u32 {
    let first = (number ^ (number >> 16u)) * 0x85ebca6bu;
    let second = (first ^ (first >> 13u)) * 0xc2b2ae35u;
    return second ^ (second >> 16u);
}

@compute @workgroup_size(SMALL_GROUP)
fn pick(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let place = group_index(workgroup) * SMALL_GROUP + local;
    let len = counters[ACTIVE];
    let below = (0xffffffffu / max(len, NOISE_SAMPLE_COUNT)) * NOISE_SAMPLE_COUNT;
    if place >= len || hash_index(name_of(surfels[place].source)) >= below {
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
