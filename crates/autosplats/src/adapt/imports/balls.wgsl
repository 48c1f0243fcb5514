// What balls tell about a surfel: see the CPU form. The including pass binds `levels` and `clusters`. Alternative:
// `later`.

#import frame
#import base_radius
#import choose
#import quadric
#import surface
#import surfel
#import through

// The surface from balls that grow until its normal's standard error is below `enough`; without weight if there is
// none. See `choose`.
fn surface_around(surfel: Surfel, own_radius: f32, first: vec4f, noise: f32, enough: f32, scatter: f32) -> Surface {
    let quadric = choose(surfel.center, base_radius(surfel, own_radius), first, noise, enough, scatter);
    if quadric.len == 0u {
        return Surface();
    }
    return Surface(quadric.axis * quadric.height, 1.0, quadric.normal, quadric.curvature);
}

// Outlier score, by a wider ball, of a surfel whose neighbours tell the score `stray`. `ratio` is its k-radius over the
// median.
fn stray_around(surfel: Surfel, stray: f32, ratio: f32) -> f32 {
    let is_sparse = ratio > SPARSE_MEDIAN_K_RADII;
    let around = plane_of(ball_around(surfel.center, WIDER_BALL_K_RADII * surfel.k_radius, CELLS_PER_RADIUS));
    var score = stray;
    if is_sparse && around.len >= LEAST_CLUSTERS {
        score = max(score, curvature_of(around) * ratio * ratio);
    } else if is_sparse && around.weight < f32(frame.k) {
        score = max(score, DOT_OUTLIER_SCORE);
    }
    let is_crowd = around.weight > CROWD_WEIGHT_PER_NEIGHBOR * f32(frame.k);
    let is_aside = abs(dot(around.axis, around.mean)) * WIDER_BALL_K_RADII > MAX_PLANE_DISTANCE_K_RADII;
    let is_outside = length(around.mean) * WIDER_BALL_K_RADII > MAX_MEAN_DISTANCE_K_RADII;
    if around.len >= LEAST_OF_PLANE && is_crowd && (is_aside || is_outside) {
        // Above any limit, in place of infinity, for which WGSL has no literal.
        score = 2.0 * DROPPED_OUTLIER_SCORE;
    } else if around.len >= LEAST_OF_PLANE && around.len < LEAST_CLUSTERS && is_aside {
        score = max(score, DOT_OUTLIER_SCORE);
    }
    return score;
}

// Radius of a surfel, at least `least`, by the share of points that lie on its disc. `noise` is the scatter of its
// points. The share of an ellipse is that of its inscribed circle. See docs/decisions/0011-seen-through.md.
fn opened_to(surfel: Surfel, least: f32, noise: f32) -> f32 {
    let radius = SUPPORT * surfel.radius;
    let disc = ball_around(surfel.center, radius, CELLS_TO_COUNT);
    let points = seen(disc, surfel.normal, max(ON_DISC * radius, ON_DISC_NOISE * noise)).points;
    // The surfel's own point is on the disc, even if it was moved.
    let on = max(points.x, 1.0);
    let share = on / (on + points.y);
    if !(share < LEAST_ON) {
        return surfel.radius;
    }
    let around = plane_of(ball_around(surfel.center, SURFACE_BALL_K_RADII * surfel.k_radius, CELLS_PER_RADIUS));
    let is_flat = curvature_of(around) < MAX_SURFACE_VARIATION;
    let is_wide = around.variances.y > MIN_SURFACE_WIDTH_RATIO * around.variances.z;
    let is_all_around = length(around.mean) < MAX_SURFACE_MEAN_RADII;
    let is_surface = around.len >= LEAST_CLUSTERS && is_flat && is_wide && is_all_around;
    return select(max(surfel.radius * (share / LEAST_ON), least), surfel.radius, is_surface);
}
