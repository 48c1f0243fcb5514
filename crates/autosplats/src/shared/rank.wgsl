// Ranks of flags within a workgroup: how many of the flags before one are set. In order, hence deterministic, and without
// a scan: flags become the bits of a few words.

const RANK_WORDS = 64u;

var<workgroup> rank_bits: array<atomic<u32>, RANK_WORDS>;
// Flags set before each word.
var<workgroup> rank_before: array<u32, RANK_WORDS>;

// Call from all, before any flag is set; a barrier follows.
fn rank_clear(local: u32) {
    if local < RANK_WORDS {
        atomicStore(&rank_bits[local], 0u);
    }
    workgroupBarrier();
}

fn rank_set(flag: u32) {
    atomicOr(&rank_bits[flag / 32u], 1u << (flag % 32u));
}

// Call from all, after all flags are set; barriers surround it.
fn rank_finish(local: u32) {
    workgroupBarrier();
    if local < RANK_WORDS {
        var sum = 0u;
        for (var word = 0u; word < local; word++) {
            sum += countOneBits(atomicLoad(&rank_bits[word]));
        }
        rank_before[local] = sum;
    }
    workgroupBarrier();
}

fn rank_of(flag: u32) -> u32 {
    let below = atomicLoad(&rank_bits[flag / 32u]) & ((1u << (flag % 32u)) - 1u);
    return rank_before[flag / 32u] + countOneBits(below);
}
