// Ranks of flags within a workgroup: the number of set flags before each. Deterministic and without a scan, because
// flags are the bits of a few words.

const RANK_WORDS = RANK_BLOCK_FLAGS / 32u;
// Words that one invocation adds up.
const RANK_RUN = 8u;
const RANK_RUNS = RANK_WORDS / RANK_RUN;

var<workgroup> rank_bits: array<atomic<u32>, RANK_WORDS>;
// Number of set flags in each run of words, and before each word.
var<workgroup> rank_runs: array<u32, RANK_RUNS>;
var<workgroup> rank_before: array<u32, RANK_WORDS>;

// To be called by all invocations before any flag is set; ends with a barrier.
fn rank_clear(local: u32) {
    if local < RANK_WORDS {
        atomicStore(&rank_bits[local], 0u);
    }
    workgroupBarrier();
}

fn rank_set(flag: u32) {
    atomicOr(&rank_bits[flag / 32u], 1u << (flag % 32u));
}

// To be called by all invocations after all flags are set; begins and ends with a barrier.
fn rank_finish(local: u32) {
    workgroupBarrier();
    if local < RANK_RUNS {
        var sum = 0u;
        for (var word = 0u; word < RANK_RUN; word++) {
            sum += countOneBits(atomicLoad(&rank_bits[RANK_RUN * local + word]));
        }
        rank_runs[local] = sum;
    }
    workgroupBarrier();
    if local < RANK_WORDS {
        var sum = 0u;
        for (var run = 0u; run < local / RANK_RUN; run++) {
            sum += rank_runs[run];
        }
        for (var word = local - local % RANK_RUN; word < local; word++) {
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
