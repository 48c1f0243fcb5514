// Sets the amounts of work of a round's passes, before the first iteration. One invocation.
//
// Reads: counters. Writes: arguments, convergence.

#import frame
#import communication

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read_write> arguments: Arguments;
@group(0) @binding(3) var<storage, read_write> convergence: array<u32>;

@compute @workgroup_size(1)
fn begin() {
    let queries = counters[ROUND_LEN];
    let has_work = select(0u, 1u, queries > 0u);
    arguments.points = Draw(BOX_VERTICES * counters[VISIBLE], 1u, 0u, 0u);
    arguments.queries = Draw(BOX_VERTICES * queries, 1u, 0u, 0u);
    arguments.clear = Draw(3u, has_work, 0u, 0u);
    arguments.boxes = Draw(BOX_VERTICES * counters[VISIBLE], has_work, 0u, 0u);
    arguments.last_clear = arguments.clear;
    arguments.last_boxes = arguments.boxes;
    arguments.queries_groups = groups_of(queries);
    arguments.points_groups = groups_of(counters[VISIBLE] * has_work);
    arguments.iterations = 0u;
    // Unconverged queries of each round, before the first iteration and after each.
    let curve = arrayLength(&convergence) / 2u;
    convergence[counters[ROUND] * curve] = queries;
    for (var at = 1u; at < curve; at++) {
        convergence[counters[ROUND] * curve + at] = 0u;
    }
}
