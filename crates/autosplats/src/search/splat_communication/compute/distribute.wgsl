// The distribution pass [Paper, §4, §5.2]: every searching point takes the next step of its search and visits the
// points within its search radius. Each keeps the distance to the furthest searching point, its feedback radius.
//
// Reads: points, pixels, queries, counters. Reads and writes: searches, told.

#import frame
#import groups
#import radius_search
#import screen
#import shared_boxes
#import told

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> pixels: array<u32>;
@group(0) @binding(3) var<storage, read> queries: array<u32>;
@group(0) @binding(4) var<storage, read> counters: array<u32>;
@group(0) @binding(5) var<storage, read_write> searches: array<PointSearch>;
@group(0) @binding(6) var<storage, read_write> told: array<Told>;

// The searches of the workgroup's queries.
var<workgroup> steps: array<Search, LARGE_GROUP>;

@compute @workgroup_size(LARGE_GROUP)
fn distribute(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = counters[ROUND_FIRST] + group_index(workgroup) * LARGE_GROUP;
    let end = counters[ROUND_FIRST] + counters[ROUND_LEN];
    clear_lines(local);
    if first + local < end {
        let own = queries[first + local];
        let initial_radius = searches[own].initial_radius;
        let search = advance(known_of(own), initial_radius, f32(counters[VISIBLE] - 1u));
        searches[own] = PointSearch(search.low, search.high, search.count, initial_radius);
        forget_answers(own);
        steps[local] = search;
        // A converged point visits nobody.
        if !has_ended(search) {
            tell_box(box_about(points[own].position_view, search.high), local);
        }
    }
    let lines = line_count();
    for (var at = local; at < lines; at += LARGE_GROUP) {
        let line = splat_line(at);
        let own = queries[first + line.x];
        let center = points[own].position_view;
        let box = boxes[line.x];
        let row = box.rows.x + line.y;
        var column = next_column(row, box.columns.x, box.columns.y);
        while column != NONE {
            let other = owner_of(column, row);
            let point = points[other];
            let distance = apart(center, point.position_view);
            if other != own && passes_mask(box.depth, point) && is_within(steps[line.x], distance) {
                atomicMax(&told[other].feedback, bitcast<u32>(max(distance, MIN_SQUARABLE_DISTANCE)));
            }
            column = next_column(row, column + 1u, box.columns.y);
        }
    }
}
