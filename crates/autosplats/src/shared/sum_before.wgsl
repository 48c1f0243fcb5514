// Sums of blocks in front of a block. Every workgroup adds them up for itself: a few coalesced loads an invocation,
// where a scan would be a dispatch that all others wait for. The including pass binds `block_sums`.

var<workgroup> blocks_before: atomic<u32>;

// The sum of all blocks in front of `block`. To be called by all invocations of a workgroup of LARGE_GROUP; ends with a
// barrier.
fn sum_before(block: u32, local: u32) -> u32 {
    if local == 0u {
        atomicStore(&blocks_before, 0u);
    }
    workgroupBarrier();
    var own = 0u;
    for (var at = local; at < block; at += LARGE_GROUP) {
        own += block_sums[at];
    }
    if own > 0u {
        atomicAdd(&blocks_before, own);
    }
    workgroupBarrier();
    return atomicLoad(&blocks_before);
}
