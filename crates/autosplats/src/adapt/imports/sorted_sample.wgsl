// Sorts the sample by k-radius: each surfel counts those before it. The including pass binds `surfels`, `picked` and
// `sampled`.

#import scatters
#import surfel

// Surfels that are read at a time, and compared four at a time for fewer rounds of the loop.
const COMPARED = 256u;

// Bits of k-radii, which sort as the k-radii do, and indices.
var<workgroup> k_radii: array<vec4u, COMPARED / 4u>;
var<workgroup> places: array<vec4u, COMPARED / 4u>;

// Sorts behind all others.
const NOBODY = 0xffffffffu;

// Index and bits of the k-radius of the `index`-th picked surfel.
fn picked_at(index: u32, len: u32) -> vec2u {
    if index >= len {
        return vec2u(NOBODY);
    }
    let place = picked[index];
    return vec2u(place, bitcast<u32>(surfels[place].k_radius));
}

// Ranks the `index`-th picked surfel. To be called by all of a workgroup's `invocations`.
fn sort_sample(index: u32, local: u32, invocations: u32) {
    let len = min(picked[MOST_SAMPLED], MOST_SAMPLED);
    let own = picked_at(index, len);
    var before = vec4u(0u);
    for (var first = 0u; first < len; first += COMPARED) {
        for (var four = local; four < COMPARED / 4u; four += invocations) {
            let at = first + 4u * four;
            let a = picked_at(at, len);
            let b = picked_at(at + 1u, len);
            let c = picked_at(at + 2u, len);
            let d = picked_at(at + 3u, len);
            places[four] = vec4u(a.x, b.x, c.x, d.x);
            k_radii[four] = vec4u(a.y, b.y, c.y, d.y);
        }
        workgroupBarrier();
        for (var four = 0u; four < COMPARED / 4u; four++) {
            let others = k_radii[four];
            let is_before = (others < vec4u(own.y)) | ((others == vec4u(own.y)) & (places[four] < vec4u(own.x)));
            before += select(vec4u(0u), vec4u(1u), is_before);
        }
        workgroupBarrier();
    }
    if own.x != NOBODY {
        let rank = before.x + before.y + before.z + before.w;
        sampled[rank] = own.x;
        sampled[RANKS + index] = rank;
    }
    if index == 0u {
        sampled[MOST_SAMPLED] = len;
    }
}
