// Quadrics, height fields with six coefficients over a ball's points: see the CPU form. The including pass binds
// `levels` and `clusters`. It imports `together` or `alone`, which tell what of a ball an invocation sums up.
//
// A ball has hundreds of cells, and waiting for a load takes longer than the sums. So four cells are read at a time,
// with overlapping loads.

#import frame
#import clusters
#import eigen
#import levels
#import orthonormal

struct Ball {
    center: vec3f,
    radius: f32,
    level: Level,
    // First and last column and row of cells that may reach into the ball.
    low: vec2u,
    high: vec2u,
}

struct Plane {
    // Unit axis of least spread of the clusters, of either sign.
    axis: vec3f,
    // Mean of the clusters relative to the ball's centre, in radii.
    mean: vec3f,
    // Least, middle and largest variance, in squared radii; the least is along `axis`.
    variances: vec3f,
    // Sum of the clusters' weights.
    weight: f32,
    // Number of clusters in the ball; with fewer than LEAST_OF_PLANE there is no plane.
    len: u32,
}

struct Quadric {
    // Unit normal of the surface at the point, of either sign.
    normal: vec3f,
    // Height of the surface above the point along `axis`, world units.
    height: f32,
    // Unit direction of the heights.
    axis: vec3f,
    // Standard deviation of points from the surface, world units.
    scatter: f32,
    // Standard error of the normal's slope, in radians per world unit of scatter.
    error: f32,
    curvature: f32,
    // Number of clusters in the ball.
    len: u32,
    // Radius of the ball in world units, or interpolated between balls.
    radius: f32,
    // Slopes at the point along `any_orthonormal` of the axis, and at right angles to both; 0 for an upright quadric.
    slope: vec2f,
    // Coefficients of xx, xy and yy along these directions, in radii.
    bend: vec3f,
}

// A ball in the coarsest cells of which its radius is at least `cells_per_radius` wide, or else in the finest.
fn ball_around(center: vec3f, radius: f32, cells_per_radius: f32) -> Ball {
    let at = to_pixel(center);
    let radius_px = radius / pixel_size(center.z);
    var level = levels[0];
    for (var index = 1u; index < MOST_LEVELS; index++) {
        let coarser = levels[index];
        if coarser.side_px == 0u || !(f32(coarser.side_px) * cells_per_radius <= radius_px) {
            break;
        }
        level = coarser;
    }
    let side = f32(level.side_px);
    let last = vec2f(vec2u(level.columns, level.rows) - 1u);
    let low = vec2u(clamp((at - radius_px) / side, vec2f(0.0), last));
    let high = vec2u(clamp((at + radius_px) / side, vec2f(0.0), last));
    return Ball(center, radius, level, low, high);
}

// Position of a cluster relative to the ball's centre in radii, and its weight; all 0 outside the ball.
fn weighed(ball: Ball, per_radius: f32, cluster: vec4f) -> vec4f {
    let offset = (cluster.xyz - ball.center) * per_radius;
    let rest = 1.0 - (offset.x * offset.x + offset.y * offset.y + offset.z * offset.z);
    let weight = min(rest * (1.0 / (1.0 - FULL_WEIGHT_SQUARED_RADII)), 1.0) * cluster.w;
    return select(vec4f(0.0), vec4f(offset, weight), rest > 0.0);
}

// A cluster of a cell; one without points if the cell is after `last`.
fn cluster_up_to(cell: u32, last: u32, slab: u32) -> vec4f {
    let cluster = clusters[cluster_at(min(cell, last), slab)];
    return select(vec4f(0.0), cluster, cell <= last);
}

// The clusters of four cells from `cell` on, a column each; without points after `last`.
fn four_clusters(cell: u32, last: u32, slab: u32) -> mat4x4f {
    return mat4x4f(
        clusters[cluster_at(cell, slab)],
        cluster_up_to(cell + 1u, last, slab),
        cluster_up_to(cell + 2u, last, slab),
        cluster_up_to(cell + 3u, last, slab),
    );
}

// Whether four clusters have no points.
fn are_empty(four: mat4x4f) -> bool {
    return four[0].w + four[1].w + four[2].w + four[3].w == 0.0;
}

// Surface variation, 0 to 1/3.
fn curvature_of(plane: Plane) -> f32 {
    let sum = plane.variances.x + plane.variances.y + plane.variances.z;
    return select(0.0, plane.variances.x / sum, sum > 0.0);
}

// The plane through the clusters of a ball.
fn plane_of(ball: Ball) -> Plane {
    return plane_beside(ball, vec3f(0.0), 0.0);
}

// Sums over clusters for a plane.
struct PlaneSums {
    // Sum of weights times positions, and sum of weights.
    first: vec4f,
    // Weighted sums of the squares xx, yy, zz, and of the products yz, xz, xy.
    squares: vec3f,
    products: vec3f,
    // Number of clusters.
    len: f32,
}

fn add_to_plane(sums: ptr<function, PlaneSums>, p: vec4f, side: vec3f, limit: f32) {
    let counts = p.w > 0.0 && dot(side, p.xyz) >= limit;
    let weight = select(0.0, p.w, counts);
    let wp = weight * p.xyz;
    (*sums).first += vec4f(wp, weight);
    (*sums).squares += wp * p.xyz;
    (*sums).products += wp.yxx * p.zzy;
    (*sums).len += select(0.0, 1.0, counts);
}

// The plane through the clusters of a ball that are at least `limit` radii from the centre in direction `side`.
fn plane_beside(ball: Ball, side: vec3f, limit: f32) -> Plane {
    let per_radius = 1.0 / ball.radius;
    var own = PlaneSums();
    let start = own_start();
    let step = own_step();
    for (var row = ball.low.y + start.y; row <= ball.high.y; row += step.y) {
        let cells = ball.level.first + row * ball.level.columns;
        let last = cells + ball.high.x;
        for (var cell = cells + ball.low.x + start.x; cell <= last; cell += step.x) {
            for (var slab = 0u; slab < SLABS; slab++) {
                let four = four_clusters(cell, last, slab);
                if are_empty(four) {
                    break;
                }
                add_to_plane(&own, weighed(ball, per_radius, four[0]), side, limit);
                add_to_plane(&own, weighed(ball, per_radius, four[1]), side, limit);
                add_to_plane(&own, weighed(ball, per_radius, four[2]), side, limit);
                add_to_plane(&own, weighed(ball, per_radius, four[3]), side, limit);
            }
        }
    }
    let sums = all_of_plane(own);
    let first = sums.first;
    let len = u32(sums.len);
    if len < LEAST_OF_PLANE {
        return Plane(vec3f(0.0, 0.0, 1.0), vec3f(0.0), vec3f(0.0), first.w, len);
    }
    let share = 1.0 / first.w;
    let mean = first.xyz * share;
    let found = eigen(sums.squares * share - mean * mean, sums.products * share - mean.yxx * mean.zzy);
    let variances = vec3f(max(found.values.x, 0.0), found.values.yz);
    return Plane(found.least, mean, variances, first.w, len);
}

// A row of the equations: the columns of xx, xy, yy and 1, the two of the slopes, and the right-hand side.
struct EquationRow {
    left: vec4f,
    right: vec3f,
}

fn without(row: EquationRow, pivot: EquationRow, factor: f32) -> EquationRow {
    return EquationRow(row.left - factor * pivot.left, row.right - factor * pivot.right);
}

// Sums over clusters for a quadric: weight times the following, in radii, with x and y across the axis and h along it.
struct QuadricSums {
    // 1, x, y.
    first: vec3f,
    // xx, xy, yy.
    second: vec3f,
    // xxx, xxy, xyy, yyy.
    third: vec4f,
    // xxxx, xxxy, xxyy, xyyy; and yyyy.
    fourth: vec4f,
    last: f32,
    // h, hx, hy, hh.
    heights: vec4f,
    // hxx, hxy, hyy.
    curved: vec3f,
    // Number of clusters, not weighted.
    len: f32,
}

fn add_to_quadric(sums: ptr<function, QuadricSums>, p: vec4f, u: vec3f, v: vec3f, axis: vec3f) {
    let x = dot(u, p.xyz);
    let y = dot(v, p.xyz);
    let h = dot(axis, p.xyz);
    let squares = vec3f(x * x, x * y, y * y);
    let of_first = p.w * vec3f(1.0, x, y);
    let of_second = p.w * squares;
    (*sums).first += of_first;
    (*sums).second += of_second;
    (*sums).third += of_second.xxyz * vec4f(x, y, y, y);
    (*sums).fourth += of_second.xxxy * squares.xyzz;
    (*sums).last += of_second.z * squares.z;
    (*sums).heights += p.w * h * vec4f(1.0, x, y, h);
    (*sums).curved += of_second * h;
    (*sums).len += select(0.0, 1.0, p.w > 0.0);
}

// Fits heights along `axis` to the clusters of a ball.
fn quadric_of(ball: Ball, axis: vec3f, curvature: f32) -> Quadric {
    let u = any_orthonormal(axis);
    let v = cross(axis, u);
    let per_radius = 1.0 / ball.radius;
    var own = QuadricSums();
    let start = own_start();
    let step = own_step();
    for (var row = ball.low.y + start.y; row <= ball.high.y; row += step.y) {
        let cells = ball.level.first + row * ball.level.columns;
        let last = cells + ball.high.x;
        for (var cell = cells + ball.low.x + start.x; cell <= last; cell += step.x) {
            for (var slab = 0u; slab < SLABS; slab++) {
                let four = four_clusters(cell, last, slab);
                if are_empty(four) {
                    break;
                }
                add_to_quadric(&own, weighed(ball, per_radius, four[0]), u, v, axis);
                add_to_quadric(&own, weighed(ball, per_radius, four[1]), u, v, axis);
                add_to_quadric(&own, weighed(ball, per_radius, four[2]), u, v, axis);
                add_to_quadric(&own, weighed(ball, per_radius, four[3]), u, v, axis);
            }
        }
    }
    let sums = all_of_quadric(own);
    let first = sums.first;
    let second = sums.second;
    let third = sums.third;
    let fourth = sums.fourth;
    let heights = sums.heights;
    let curved = sums.curved;
    let len = u32(sums.len);
    if len < LEAST_CLUSTERS {
        return Quadric(axis, 0.0, axis, 0.0, 0.0, 0.0, len, ball.radius, vec2f(0.0), vec3f(0.0));
    }
    let w = first.x;
    let ridge = RIDGE * w;
    let least = LEAST_PIVOT * w;
    // Slopes come last: eliminating the other rows leaves the slopes' own matrix.
    let r0 = EquationRow(vec4f(fourth.x + ridge, fourth.y, fourth.z, second.x), vec3f(third.x, third.y, curved.x));
    var r1 = EquationRow(vec4f(fourth.y, fourth.z + ridge, fourth.w, second.y), vec3f(third.y, third.z, curved.y));
    var r2 = EquationRow(vec4f(fourth.z, fourth.w, sums.last + ridge, second.z), vec3f(third.z, third.w, curved.z));
    var r3 = EquationRow(vec4f(second, w), vec3f(first.yz, heights.x));
    var r4 = EquationRow(vec4f(third.xyz, first.y), vec3f(second.xy, heights.y));
    var r5 = EquationRow(vec4f(third.yzw, first.z), vec3f(second.yz, heights.z));
    var rest = heights.w;

    // `least` keeps rounding residues of dependent rows from being divisors.
    let i0 = 1.0 / max(r0.left.x, least);
    rest -= r0.right.z * r0.right.z * i0;
    r1 = without(r1, r0, r1.left.x * i0);
    r2 = without(r2, r0, r2.left.x * i0);
    r3 = without(r3, r0, r3.left.x * i0);
    r4 = without(r4, r0, r4.left.x * i0);
    r5 = without(r5, r0, r5.left.x * i0);

    let i1 = 1.0 / max(r1.left.y, least);
    rest -= r1.right.z * r1.right.z * i1;
    r2 = without(r2, r1, r2.left.y * i1);
    r3 = without(r3, r1, r3.left.y * i1);
    r4 = without(r4, r1, r4.left.y * i1);
    r5 = without(r5, r1, r5.left.y * i1);

    let i2 = 1.0 / max(r2.left.z, least);
    rest -= r2.right.z * r2.right.z * i2;
    r3 = without(r3, r2, r3.left.z * i2);
    r4 = without(r4, r2, r4.left.z * i2);
    r5 = without(r5, r2, r5.left.z * i2);

    let i3 = 1.0 / max(r3.left.w, least);
    rest -= r3.right.z * r3.right.z * i3;
    r4 = without(r4, r3, r4.left.w * i3);
    r5 = without(r5, r3, r5.left.w * i3);

    let i4 = 1.0 / max(r4.right.x, least);
    rest -= r4.right.z * r4.right.z * i4;
    r5 = without(r5, r4, r5.right.x * i4);

    let i5 = 1.0 / max(r5.right.y, least);
    rest -= r5.right.z * r5.right.z * i5;

    let slope_y = r5.right.z * i5;
    let slope_x = (r4.right.z - r4.right.y * slope_y) * i4;
    let height = (r3.right.z - r3.right.x * slope_x - r3.right.y * slope_y) * i3;
    let known = vec3f(height, slope_x, slope_y);
    let yy = (r2.right.z - dot(vec3f(r2.left.w, r2.right.xy), known)) * i2;
    let xy = (r1.right.z - dot(vec3f(r1.left.w, r1.right.xy), known) - r1.left.z * yy) * i1;
    let xx = (r0.right.z - dot(vec3f(r0.left.w, r0.right.xy), known) - r0.left.y * xy - r0.left.z * yy) * i0;
    // Trace of the inverse of the slopes' remaining 2×2 matrix.
    let tilt = r4.right.y * i4;
    let trace = i4 + (1.0 + tilt * tilt) * i5;
    let squares = select(0.0, rest, rest > 0.0) / (f32(len) - 6.0);
    let side = f32(ball.level.side_px) * pixel_size(ball.center.z) * per_radius;
    let variance = min(squares, squares * f32(len) / w + side * side * (1.0 / 12.0));
    return Quadric(
        normalize(axis - u * slope_x - v * slope_y),
        height * ball.radius,
        axis,
        sqrt(variance) * ball.radius,
        sqrt(trace) / ball.radius,
        curvature,
        len,
        ball.radius,
        vec2f(slope_x, slope_y),
        vec3f(xx, xy, yy),
    );
}
