// Points seen on a disc and through it: see the CPU form. The including pass binds `levels` and `clusters`. See
// docs/decisions/0011-seen-through.md.

#import frame
#import clusters
#import quadric

// Counts on a disc and behind it.
struct SeenAtDisc {
    // Cells with points on the disc, and other cells with points behind it.
    cells: vec2f,
    // Points on the disc, and behind it. A point behind counts as many as would fall there if it lay on the disc's
    // plane.
    points: vec2f,
}

// Counts on and behind a ball's disc square to `axis`, in the ball's cells. Points within `half_thickness` of the plane
// are on the disc.
fn seen(ball: Ball, axis: vec3f, half_thickness: f32) -> SeenAtDisc {
    let start = own_start();
    let step = own_step();
    // Cells and points.
    var own = vec4f(0.0);
    for (var row = ball.low.y + start.y; row <= ball.high.y; row += step.y) {
        let cells = ball.level.first + row * ball.level.columns;
        let last = cells + ball.high.x;
        for (var cell = cells + ball.low.x + start.x; cell <= last; cell += step.x) {
            var points = array<vec2f, 4>();
            for (var slab = 0u; slab < SLABS; slab++) {
                let four = four_clusters(cell, last, slab);
                if are_empty(four) {
                    break;
                }
                points[0] += seen_of(ball, axis, half_thickness, four[0]);
                points[1] += seen_of(ball, axis, half_thickness, four[1]);
                points[2] += seen_of(ball, axis, half_thickness, four[2]);
                points[3] += seen_of(ball, axis, half_thickness, four[3]);
            }
            own += with_cell(points[0]) + with_cell(points[1]) + with_cell(points[2]) + with_cell(points[3]);
        }
    }
    let all = all_of_seen(own);
    return SeenAtDisc(all.xy, all.zw);
}

// Points of a cluster on the disc, and behind it.
fn seen_of(ball: Ball, axis: vec3f, half_thickness: f32, cluster: vec4f) -> vec2f {
    let off = dot(axis, ball.center) - dot(axis, cluster.xyz);
    // Intersection of the line of sight with the plane.
    let along = select(vec3f(0.0, 0.0, 1.0), cluster.xyz, frame.perspective == 1u);
    let way = off / dot(axis, along);
    let apart = cluster.xyz + along * way - ball.center;
    let is_within = cluster.w > 0.0 && dot(apart, apart) < ball.radius * ball.radius;
    // Distance of the plane from the eye over that of the point, along the line of sight.
    let nearer = select(1.0, max(1.0 + way, 0.0), frame.perspective == 1u);
    let is_on = abs(off) <= half_thickness;
    let is_behind = is_within && !is_on && way < 0.0;
    return vec2f(
        select(0.0, cluster.w, is_within && is_on),
        select(0.0, cluster.w * (nearer * nearer), is_behind),
    );
}

// Counts of a cell: whether it has points on the disc, else whether it has points behind the disc, and both numbers of
// points.
fn with_cell(points: vec2f) -> vec4f {
    let is_on = points.x > 0.0;
    return vec4f(select(0.0, 1.0, is_on), select(0.0, 1.0, !is_on && points.y > 0.0), points);
}
