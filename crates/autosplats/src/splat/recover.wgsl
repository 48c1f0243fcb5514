// Appends the marked passive points to the active ones, ascending [Paper, §7, Grid Culling]. The last block tells their
// number, and begins the second round.
//
// Reads: passive, block_sums. Reads and writes: counters. Writes: queries, arguments.

#import frame
#import groups
#import put_rounds
#import rank
#import recovered
#import sum_before

@group(0) @binding(1) var<storage, read> passive: array<u32>;
@group(0) @binding(2) var<storage, read_write> counters: array<u32>;
@group(0) @binding(3) var<storage, read> block_sums: array<u32>;
@group(0) @binding(4) var<storage, read_write> queries: array<u32>;
@group(0) @binding(5) var<storage, read_write> arguments: array<Dispatch>;

@compute @workgroup_size(LARGE_GROUP)
fn recover(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    rank_clear(local);
    let block = group_index(workgroup);
    var is_recovered = 0u;
    for (var step = 0u; step < RANK_BLOCK_FLAGS / LARGE_GROUP; step++) {
        let flag = step * LARGE_GROUP + local;
        let index = block * RANK_BLOCK_FLAGS + flag;
        if index < counters[PASSIVE] && (passive[index] & RECOVERED_FLAG) != 0u {
            rank_set(flag);
            is_recovered |= 1u << step;
        }
    }
    rank_finish(local);
    let recovered_before = sum_before(block, local);
    for (var step = 0u; step < RANK_BLOCK_FLAGS / LARGE_GROUP; step++) {
        let flag = step * LARGE_GROUP + local;
        if (is_recovered & (1u << step)) != 0u {
            let place = counters[ACTIVE] + recovered_before + rank_of(flag);
            queries[place] = passive[block * RANK_BLOCK_FLAGS + flag] & ~RECOVERED_FLAG;
        }
    }
    if block == (max(counters[PASSIVE], 1u) - 1u) / RANK_BLOCK_FLAGS && local == 0u {
        let recovered_len = recovered_before + block_sums[block];
        counters[RECOVERED] = recovered_len;
        counters[ROUND] = 1u;
        counters[ROUND_FIRST] = counters[ACTIVE];
        counters[ROUND_LEN] = recovered_len;
        put_recovered(recovered_len, counters[ACTIVE]);
    }
}
