// Sorts the sample by k-radius: each surfel counts those before it.
//
// Reads: surfels, picked. Writes: sampled, the indices of the surfels, then their number.

#import surfel

@group(0) @binding(0) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(1) var<storage, read> picked: array<u32>;
@group(0) @binding(2) var<storage, read_write> sampled: array<u32>;

// Bits of k-radii, which sort as the k-radii do, and indices; four at a time for fewer rounds of the loop.
var<workgroup> k_radii: array<vec4u, MOST_SAMPLED / 4u>;
var<workgroup> places: array<vec4u, MOST_SAMPLED / 4u>;

// Sorts behind all others.
const NONE = 0xffffffffu;

// Index and bits of the k-radius of the `index`-th picked surfel.
fn one(index: u32, len: u32) -> vec2u {
    if index >= len {
        return vec2u(NONE);
    }
    let place = picked[index];
    return vec2u(place, bitcast<u32>(surfels[place].k_radius));
}

@compute @workgroup_size(SMALL_GROUP)
fn sample(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let len = min(picked[MOST_SAMPLED], MOST_SAMPLED);
    let fours = (len + 3u) / 4u;
    for (var four = local; four < fours; four += SMALL_GROUP) {
        let at = 4u * four;
        let a = one(at, len);
        let b = one(at + 1u, len);
        let c = one(at + 2u, len);
        let d = one(at + 3u, len);
        places[four] = vec4u(a.x, b.x, c.x, d.x);
        k_radii[four] = vec4u(a.y, b.y, c.y, d.y);
    }
    workgroupBarrier();
    let own = one(workgroup.x * SMALL_GROUP + local, len);
    if own.x != NONE {
        var before = vec4u(0u);
        for (var four = 0u; four < fours; four++) {
            let others = k_radii[four];
            let is_before = (others < vec4u(own.y)) | ((others == vec4u(own.y)) & (places[four] < vec4u(own.x)));
            before += select(vec4u(0u), vec4u(1u), is_before);
        }
        sampled[before.x + before.y + before.z + before.w] = own.x;
    }
    if workgroup.x == 0u && local == 0u {
        sampled[MOST_SAMPLED] = len;
    }
}
