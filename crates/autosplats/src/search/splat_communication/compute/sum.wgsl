// Mean and covariance accumulation [Paper, §6]: every query sums the points of its neighbourhood, row by row. The
// largest distance is kept as the k-radius.
//
// Differs from the paper: a query reads its neighbours, as sums of floats by atomics would depend on their order.
// Offsets are about the point itself, so that nothing cancels, and the point is not counted.
//
// Reads: points, pixels, queries, searches, told. Writes: counters, neighborhoods.

#import frame
#import ending
#import groups
#import neighborhood
#import points_in_box
#import radius_search
#import screen
#import told

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> pixels: array<u32>;
@group(0) @binding(3) var<storage, read> queries: array<u32>;
@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> neighborhoods: array<Neighborhood>;
@group(0) @binding(6) var<storage, read> searches: array<PointSearch>;
@group(0) @binding(7) var<storage, read_write> told: array<Told>;

@compute @workgroup_size(LARGE_GROUP)
fn sum(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = atomicLoad(&counters[ROUND_FIRST]);
    let len = atomicLoad(&counters[ROUND_LEN]);
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if index >= len {
        return;
    }
    let own = queries[first + index];
    let others = f32(atomicLoad(&counters[VISIBLE]) - 1u);
    let search = settle(known_of(own), searches[own].initial_radius, others);
    var found: Neighborhood;
    if has_neighbors(search) {
        found = sum_within(own, search);
    }
    neighborhoods[first + index] = found;
    count_ending(search.count);
}

// The sums over all other points within a search.
fn sum_within(own: u32, search: Search) -> Neighborhood {
    let center = points[own].position_view;
    let box = box_about(center, max(search.high, MIN_SQUARABLE_DISTANCE));
    var found: Neighborhood;
    for (var row = box.rows.x; row <= box.rows.y; row++) {
        var column = next_column(row, box.columns.x, box.columns.y);
        while column != NONE {
            let other = owner_of(column, row);
            let point = points[other];
            let away = point.position_view - center;
            let distance = apart(center, point.position_view);
            if other != own && passes_mask(box.depth, point) && is_within(search, distance) {
                found.offset += away;
                found.count += 1.0;
                found.second_x += away.x * away;
                found.second_yz += away.yyz * away.yzz;
                found.k_radius = max(found.k_radius, distance);
            }
            column = next_column(row, column + 1u, box.columns.y);
        }
    }
    return found;
}
