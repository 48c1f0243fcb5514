// What is seen on a disc and through it: see the CPU form. Imports: frame, quadric. The including pass binds `levels` and
// `clusters`.

#import quadric

// What is seen where a disc is: on it, and behind it.
struct Seen {
    // Cells that hold something on the disc, and others that hold something behind it.
    cells: vec2f,
    // Points on it, and behind it: each of these counts for as many as would fall there if it lay on the disc's plane.
    points: vec2f,
}

// What is seen on and through a ball's disc square to `axis`, in the ball's cells; what is no further from the plane, on either
// side, is on it.
fn seen(ball: Ball, axis: vec3f, half_thickness: f32) -> Seen {
    let of_plane = dot(axis, ball.center);
    var sum = Seen(vec2f(0.0), vec2f(0.0));
    for (var row = ball.low.y; row <= ball.high.y; row++) {
        let cells = ball.level.first + row * ball.level.columns;
        for (var cell = cells + ball.low.x; cell <= cells + ball.high.x; cell++) {
            var points = vec2f(0.0);
            for (var slab = 0u; slab < SLABS; slab++) {
                let cluster = clusters[cell * SLABS + slab];
                if cluster.w == 0.0 {
                    break;
                }
                let off = of_plane - dot(axis, cluster.xyz);
                // Where the line of sight meets the plane.
                let along = select(vec3f(0.0, 0.0, 1.0), cluster.xyz, frame.perspective == 1u);
                let way = off / dot(axis, along);
                let apart = cluster.xyz + along * way - ball.center;
                if dot(apart, apart) < ball.radius * ball.radius {
                    // Distance from the eye on the plane over that of the point.
                    let nearer = select(1.0, max(1.0 + way, 0.0), frame.perspective == 1u);
                    let is_on = abs(off) <= half_thickness;
                    points.x += select(0.0, cluster.w, is_on);
                    points.y += select(0.0, cluster.w * (nearer * nearer), !is_on && way < 0.0);
                }
            }
            sum.cells += select(vec2f(0.0, select(0.0, 1.0, points.y > 0.0)), vec2f(1.0, 0.0), points.x > 0.0);
            sum.points += points;
        }
    }
    return sum;
}
