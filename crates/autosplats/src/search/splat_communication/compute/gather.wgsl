// The gathering pass [Paper, §4, §5.2]: every point visits the points within its feedback radius. At each one whose
// delta region holds it, it counts for those of the four radii that reach it, and the furthest distance is kept.
//
// Reads: points, pixels, counters, searches. Reads and writes: told.

#import frame
#import groups
#import radius_search
#import screen
#import shared_boxes
#import told

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> pixels: array<u32>;
@group(0) @binding(3) var<storage, read> counters: array<u32>;
@group(0) @binding(4) var<storage, read> searches: array<PointSearch>;
@group(0) @binding(5) var<storage, read_write> told: array<Told>;

@compute @workgroup_size(LARGE_GROUP)
fn gather(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = group_index(workgroup) * LARGE_GROUP;
    clear_lines(local);
    if first + local < counters[VISIBLE] {
        // Others tell the next feedback radius in the next distribution only.
        let radius = bitcast<f32>(atomicExchange(&told[first + local].feedback, 0u));
        if radius > 0.0 {
            tell_box(box_about(points[first + local].position_view, radius), local);
        }
    }
    let lines = line_count();
    for (var at = local; at < lines; at += LARGE_GROUP) {
        let line = splat_line(at);
        let own = first + line.x;
        let center = points[own].position_view;
        let box = boxes[line.x];
        let row = box.rows.x + line.y;
        var column = next_column(row, box.columns.x, box.columns.y);
        while column != NONE {
            answer(own, center, owner_of(column, row), box.depth);
            column = next_column(row, column + 1u, box.columns.y);
        }
    }
}

// Answers the search of another point.
fn answer(own: u32, center: vec3f, other: u32, depth: f32) {
    let search = search_of(other);
    if other == own || has_ended(search) {
        return;
    }
    let point = points[other];
    let distance = apart(center, point.position_view);
    if !passes_mask(depth, point) || !is_within(search, distance) {
        return;
    }
    // The radii ascend, and the last is the upper bound: one count tells for all radii that reach.
    let beyond = select(vec3u(0u), vec3u(1u), vec3f(distance) > sample_radii(search).xyz);
    atomicAdd(&told[other].reached[beyond.x + beyond.y + beyond.z], 1u);
    atomicMax(&told[other].furthest, bitcast<u32>(distance));
}
