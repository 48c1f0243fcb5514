// Computes the number of workgroups of the indirect dispatches from the counters, so that no workgroup starts in vain.
//
// Reads: counters. Writes: arguments. One invocation.

#import frame
#import put_work

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read_write> arguments: array<Dispatch>;

// Items that a workgroup processes together.
override ITEMS_PER_GROUP: u32;

@compute @workgroup_size(1)
fn work() {
    put_work(VISIBLE256, counters[VISIBLE], LARGE_GROUP);
    put_work(VISIBLE_BLOCKS, counters[VISIBLE], RANK_BLOCK_FLAGS);
    put_work(PASSIVE_BLOCKS, counters[PASSIVE], RANK_BLOCK_FLAGS);
    put_work(ACTIVE64, counters[ACTIVE], SMALL_GROUP);
    put_work(ACTIVE256, counters[ACTIVE], LARGE_GROUP);
    put_work(RECOVERED64, counters[RECOVERED], SMALL_GROUP);
    put_work(RECOVERED256, counters[RECOVERED], LARGE_GROUP);
    put_work(LARGE_SPLATS, counters[LARGE], 1u);
    put_work(LEFT_ACTIVE64, counters[LEFT_ACTIVE], SMALL_GROUP);
    put_work(LEFT_RECOVERED64, counters[LEFT_RECOVERED], SMALL_GROUP);
    put_work(ACTIVE_FEW, counters[ACTIVE], ITEMS_PER_GROUP);
    put_work(RECOVERED_FEW, counters[RECOVERED], ITEMS_PER_GROUP);
    put_work(QUERIES256, counters[ACTIVE] + counters[RECOVERED], LARGE_GROUP);
}
