// Scan lines (rows) and the surface areas that contain them: see the CPU form. The including pass binds `levels` and
// `clusters`. See docs/decisions/0012-scan-lines.md.

#import frame
#import quadric
#import surfel
#import through

struct Area {
    plane: Plane,
    // Radius of the ball in world units; 0 if there is no area.
    radius: f32,
}

// Whether a plane's points are flat and contain the scan line with direction `row`.
fn is_flat(plane: Plane, row: vec3f) -> bool {
    let is_thin = plane.variances.x <= MAX_AREA_HEIGHT_RATIO * plane.variances.y;
    return is_thin && abs(dot(plane.axis, row)) <= MAX_SCAN_LINE_TILT_SINE && abs(dot(plane.axis, plane.mean)) <= MAX_POINT_HEIGHT_RADII;
}

// Whether a plane's points form an area: their width has at least this ratio to their length, by variances.
fn is_area(plane: Plane, least: f32) -> bool {
    return plane.len >= LEAST_CLUSTERS && plane.variances.y > least * plane.variances.z;
}

// Whether an area is also one in the larger ball, and its weight grows faster than that of a line.
fn goes_on(near: Plane, radius: f32, far: Plane, beyond: f32) -> bool {
    return is_area(far, MIN_AREA_RATIO) && far.weight * radius > near.weight * beyond;
}

// Distance between scan lines in k-radii, from the weight of a ball of `in_k_radii`. Points on a line are k-radius /
// (k/2) apart.
fn rows_apart(in_k_radii: f32, weight: f32) -> f32 {
    return EVEN_WEIGHT * in_k_radii * in_k_radii * f32(frame.k) / (2.0 * weight);
}

// The flatter of the areas on the two sides of a scan line, among those that continue in the ball `beyond`.
fn area_beside(ball: Ball, beyond: Ball, row: vec3f) -> Area {
    let across_eye = cross(row, select(vec3f(0.0, 0.0, 1.0), ball.center, frame.perspective == 1u));
    let length_squared = dot(across_eye, across_eye);
    var side = select(vec3f(0.0), across_eye * inverseSqrt(length_squared), length_squared > 0.0);
    var found = Area(Plane(), 0.0);
    for (var index = 0; index < 2; index++) {
        let plane = plane_beside(ball, side, -SIDE_SLACK_RADII);
        let bend = plane.variances.x * found.plane.variances.y;
        let is_flatter = found.radius == 0.0 || bend < found.plane.variances.x * plane.variances.y;
        if is_area(plane, MIN_SIDE_AREA_RATIO) && is_flat(plane, row) && is_flatter {
            if goes_on(plane, ball.radius, plane_beside(beyond, side, -SIDE_SLACK_RADII), beyond.radius) {
                found = Area(plane, ball.radius);
            }
        }
        side = -side;
    }
    // Weight as if the other side were equally full.
    found.plane.weight *= BALL_OVER_SIDE_WEIGHT;
    return found;
}

// Whether the background shows through a ball's disc square to `axis`.
fn is_seen_through(ball: Ball, axis: vec3f) -> bool {
    let cells = seen(ball, axis, AREA_HALF_THICKNESS_RADII * ball.radius).cells;
    return cells.y > MAX_SEEN_THROUGH_SHARE * (cells.y + cells.x);
}

// The area that contains a surfel's scan line, from the first ball that holds an area.
fn area(surfel: Surfel, least_radius: f32) -> Area {
    let center = surfel.center;
    let row = surfel.major_axis;
    var radius = least_radius;
    var found = Area(Plane(), 0.0);
    for (var scale = 0u; scale < SCALES; scale++) {
        radius *= STEP;
        let ball = ball_around(center, radius, CELLS_PER_RADIUS);
        let plane = plane_of(ball);
        if !is_area(plane, MIN_AREA_RATIO) {
            continue;
        }
        let apart = surfel.k_radius * rows_apart(radius / surfel.k_radius, plane.weight);
        let beyond_radius = clamp(BEYOND_LINE_DISTANCES * apart, BEYOND_RADII[0] * radius, BEYOND_RADII[1] * radius);
        let beyond = ball_around(center, beyond_radius, CELLS_PER_RADIUS);
        if is_flat(plane, row) && goes_on(plane, radius, plane_of(beyond), beyond_radius) {
            found = Area(plane, radius);
        } else {
            found = area_beside(ball, beyond, row);
        }
        if found.radius > 0.0 && is_seen_through(ball, found.plane.axis) {
            found.radius = 0.0;
        }
        break;
    }
    return found;
}

// A surfel of a scan line, turned to its area; without an area, a thin line.
fn turned(surfel: Surfel, found: Area) -> Surfel {
    var out = surfel;
    if found.radius == 0.0 {
        out.radius = surfel.radius * THIN_LINE_ASPECT;
        out.major_ratio = 1.0 / THIN_LINE_ASPECT;
        return out;
    }
    let plane = found.plane;
    out.normal = turned_to_eye(plane.axis, surfel.center);
    out.major_axis = normalize(cross(out.normal, surfel.major_axis));
    out.curvature = curvature_of(plane);
    // The splat radius is 2/√k k-radii.
    let in_k_radii = found.radius / surfel.k_radius;
    let reach = min(SEMI_AXIS_LINE_DISTANCES * rows_apart(in_k_radii, plane.weight), MAX_SEMI_AXIS_RADII * in_k_radii);
    let ratio = reach * (0.5 * sqrt(f32(frame.k)));
    out.radius = surfel.radius * max(ratio / LONGEST, 1.0);
    out.major_ratio = clamp(ratio, 1.0, LONGEST);
    return out;
}
