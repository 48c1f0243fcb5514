// Says how many workgroups the passes after it take, for as many points as there are: so none is started in vain.
//
// Reads: counters. Writes: arguments. One invocation.

#import frame
#import groups
#import counters

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read_write> arguments: array<u32>;

// Which arguments are where: workgroups of so many invocations, or of so many flags, a row of them after the other.
const VISIBLE256 = 0u;
const VISIBLE_BLOCKS = 1u;
const PASSIVE_BLOCKS = 2u;
const ACTIVE64 = 3u;
const ACTIVE256 = 4u;
const RECOVERED64 = 5u;
const RECOVERED256 = 6u;
const QUERIES256 = 7u;
const LARGE_SPLATS = 8u;
const LEFT_ACTIVE64 = 9u;
const LEFT_RECOVERED64 = 10u;
const ACTIVE_FEW = 11u;
const RECOVERED_FEW = 12u;

override FEW: u32;

fn put(kind: u32, items: u32, per_group: u32) {
    let groups = (items + per_group - 1u) / per_group;
    arguments[3u * kind] = min(groups, GROUPS_PER_ROW);
    arguments[3u * kind + 1u] = (groups + GROUPS_PER_ROW - 1u) / GROUPS_PER_ROW;
    arguments[3u * kind + 2u] = 1u;
}

@compute @workgroup_size(1)
fn work() {
    put(VISIBLE256, counters[VISIBLE], 256u);
    put(VISIBLE_BLOCKS, counters[VISIBLE], 2048u);
    put(PASSIVE_BLOCKS, counters[PASSIVE], 2048u);
    put(ACTIVE64, counters[ACTIVE], 64u);
    put(ACTIVE256, counters[ACTIVE], 256u);
    put(RECOVERED64, counters[RECOVERED], 64u);
    put(RECOVERED256, counters[RECOVERED], 256u);
    put(LARGE_SPLATS, counters[LARGE], 1u);
    put(LEFT_ACTIVE64, counters[LEFT_ACTIVE], 64u);
    put(LEFT_RECOVERED64, counters[LEFT_RECOVERED], 64u);
    put(ACTIVE_FEW, counters[ACTIVE], FEW);
    put(RECOVERED_FEW, counters[RECOVERED], FEW);
    put(QUERIES256, counters[ACTIVE] + counters[RECOVERED], 256u);
}
