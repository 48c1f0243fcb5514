// Picks surfels at even distances in their list and sorts them by k-radius, each by counting those before it.
//
// Reads: counters, surfels. Writes: sampled, the places of the surfels, and after them their number.

#import frame
#import counters
#import surfel

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(3) var<storage, read_write> sampled: array<u32>;

override SAMPLE: u32;

const DISCARDED = 0xffffffffu;

// Bits of k-radii, which are in their order; four at a time, for fewer rounds of a loop.
var<workgroup> k_radii: array<vec4u, SAMPLE / 4u>;

// Bits of the k-radius of a candidate.
fn k_radius(index: u32, step: u32, candidates: u32) -> u32 {
    if index >= candidates {
        return DISCARDED;
    }
    let place = index * step;
    // A discarded point has no ball.
    return select(DISCARDED, bitcast<u32>(surfels[place].k_radius), surfels[place].radius > 0.0);
}

@compute @workgroup_size(64)
fn sample(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let len = counters[ACTIVE];
    let step = max((len + SAMPLE - 1u) / SAMPLE, 1u);
    let candidates = (len + step - 1u) / step;
    let fours = (candidates + 3u) / 4u;
    for (var four = local; four < fours; four += 64u) {
        let at = 4u * four;
        k_radii[four] = vec4u(
            k_radius(at, step, candidates),
            k_radius(at + 1u, step, candidates),
            k_radius(at + 2u, step, candidates),
            k_radius(at + 3u, step, candidates),
        );
    }
    workgroupBarrier();
    let own = workgroup.x * 64u + local;
    if own < candidates {
        let own_radius = vec4u(k_radius(own, step, candidates));
        var before = vec4u(0u);
        var places = vec4u(0u, 1u, 2u, 3u);
        for (var four = 0u; four < fours; four++) {
            let others = k_radii[four];
            let is_before = (others < own_radius) | ((others == own_radius) & (places < vec4u(own)));
            before += select(vec4u(0u), vec4u(1u), is_before);
            places += 4u;
        }
        if own_radius.x != DISCARDED {
            sampled[before.x + before.y + before.z + before.w] = own * step;
        }
    }
    if own == 0u {
        var kept = 0u;
        for (var four = 0u; four < fours; four++) {
            let is_kept = select(vec4u(0u), vec4u(1u), k_radii[four] != vec4u(DISCARDED));
            kept += is_kept.x + is_kept.y + is_kept.z + is_kept.w;
        }
        sampled[SAMPLE] = kept;
    }
}
