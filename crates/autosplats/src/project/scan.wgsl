// Replaces the sums of blocks by the sum of all blocks in front of each; the total goes to a counter.
//
// Reads and writes: block_sums, counters. One workgroup; each invocation takes a run of blocks.

#import frame

@group(0) @binding(1) var<storage, read_write> block_sums: array<u32>;
@group(0) @binding(2) var<storage, read_write> counters: array<u32>;

// Index of the counter that receives the total.
override TOTAL: u32;
// Index of the counter of items in blocks that have sums. Equal to TOTAL if all blocks have sums.
override SCANNED: u32;

var<workgroup> before: array<u32, LARGE_GROUP + 1u>;

@compute @workgroup_size(LARGE_GROUP)
fn scan(@builtin(local_invocation_index) local: u32) {
    let blocks = select((counters[SCANNED] + RANK_BLOCK_FLAGS - 1u) / RANK_BLOCK_FLAGS, arrayLength(&block_sums), SCANNED == TOTAL);
    let each = (blocks + LARGE_GROUP - 1u) / LARGE_GROUP;
    let first = min(local * each, blocks);
    let end = min(first + each, blocks);
    var sum = 0u;
    for (var block = first; block < end; block++) {
        sum += block_sums[block];
    }
    before[local + 1u] = sum;
    workgroupBarrier();
    if local == 0u {
        before[0] = 0u;
        for (var run = 1u; run <= LARGE_GROUP; run++) {
            before[run] += before[run - 1u];
        }
        counters[TOTAL] = before[256];
    }
    workgroupBarrier();
    sum = before[local];
    for (var block = first; block < end; block++) {
        let own = block_sums[block];
        block_sums[block] = sum;
        sum += own;
    }
}
