// Appends the marked passive points to the active ones, ascending [Paper, §7, Grid Culling].
//
// Reads: passive, counters, block_sums. Writes: queries.

#import frame
#import groups
#import rank
#import recovered

@group(0) @binding(1) var<storage, read> passive: array<u32>;
@group(0) @binding(2) var<storage, read> counters: array<u32>;
@group(0) @binding(3) var<storage, read> block_sums: array<u32>;
@group(0) @binding(4) var<storage, read_write> queries: array<u32>;

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
    for (var step = 0u; step < RANK_BLOCK_FLAGS / LARGE_GROUP; step++) {
        let flag = step * LARGE_GROUP + local;
        if (is_recovered & (1u << step)) != 0u {
            queries[counters[ACTIVE] + block_sums[block] + rank_of(flag)] = passive[block * RANK_BLOCK_FLAGS + flag] & ~RECOVERED_FLAG;
        }
    }
}
