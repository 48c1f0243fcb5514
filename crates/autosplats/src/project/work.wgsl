// Computes the number of workgroups of the indirect dispatches from the counters, so that no workgroup starts in vain.
// Frames count most of them where the numbers arise.
//
// Reads: counters. Writes: arguments. One invocation.

#import frame
#import put_rounds

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read_write> arguments: array<Dispatch>;

@compute @workgroup_size(1)
fn work() {
    put_work(VISIBLE256, counters[VISIBLE], LARGE_GROUP);
    put_work(VISIBLE_BLOCKS, max(counters[VISIBLE], 1u), RANK_BLOCK_FLAGS);
    put_work(PASSIVE_BLOCKS, max(counters[PASSIVE], 1u), RANK_BLOCK_FLAGS);
    put_work(LEFT_ACTIVE64, counters[LEFT_ACTIVE], SMALL_GROUP);
    put_work(LEFT_RECOVERED64, counters[LEFT_RECOVERED], SMALL_GROUP);
    put_active(counters[ACTIVE]);
    put_recovered(counters[RECOVERED], counters[ACTIVE]);
}
