// Sets the amounts that a round's passes draw, before the first iteration. One invocation.
//
// Reads: counters. Writes: arguments, convergence.

#import frame
#import communication
#import round

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read_write> arguments: Arguments;
@group(0) @binding(3) var<storage, read_write> convergence: array<u32>;

@compute @workgroup_size(1)
fn begin() {
    let queries = counters[select(ACTIVE, RECOVERED, ROUND == 1u)];
    let has_work = select(0u, 1u, queries > 0u);
    arguments.points = Draw(BOX_VERTICES * counters[VISIBLE], 1u, 0u, 0u);
    arguments.queries = Draw(BOX_VERTICES * queries, 1u, 0u, 0u);
    arguments.clear = Draw(3u, has_work, 0u, 0u);
    arguments.boxes = Draw(BOX_VERTICES * counters[VISIBLE], has_work, 0u, 0u);
    arguments.last_clear = arguments.clear;
    arguments.last_boxes = arguments.boxes;
    let groups = (queries + LARGE_GROUP - 1u) / LARGE_GROUP;
    arguments.count = vec3u(min(groups, GROUPS_PER_ROW), (groups + GROUPS_PER_ROW - 1u) / GROUPS_PER_ROW, 1u);
    arguments.iterations = 0u;
    // Unconverged queries of each round, before the first iteration and after each.
    let curve = arrayLength(&convergence) / 2u;
    convergence[ROUND * curve] = queries;
    for (var at = 1u; at < curve; at++) {
        convergence[ROUND * curve + at] = 0u;
    }
}
