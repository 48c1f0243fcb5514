// Shrinks surfels that lie on no surface: see the CPU form. See docs/decisions/0010-outliers.md.

#import frame
#import quadric
#import surfel
#import through

// Radius in world units of a surfel that is drawn as a dot.
fn dot_radius(surfel: Surfel) -> f32 {
    return min(surfel.radius, DOT_PX * pixel_size(surfel.center.z));
}

// Radius of a surfel after the outlier test; 0 if the surfel is dropped. Outliers have neighbours that are far away and
// fill space, or that are cut off from all other points. `initial_radius` is the
// first search radius, `usual` the median k-radius of all surfels.
fn shrunk(surfel: Surfel, initial_radius: f32, usual: f32) -> f32 {
    // Too few points have no usual k-radius.
    if usual == 0.0 {
        return surfel.radius;
    }
    let ratio = surfel.k_radius / usual;
    var stray = surfel.curvature * ratio * ratio;
    let is_sparse = ratio > SPARSE_MEDIAN_K_RADII;
    let local = surfel.k_radius / initial_radius;
    if is_sparse || surfel.curvature * local * local > ISOLATED_SCORE {
        let around = plane_of(ball_around(surfel.center, WIDER_BALL_K_RADII * surfel.k_radius, CELLS_PER_RADIUS));
        if is_sparse && around.len >= LEAST_CLUSTERS {
            stray = max(stray, curvature_of(around) * ratio * ratio);
        } else if is_sparse && around.weight < f32(frame.k) {
            stray = max(stray, DOT_OUTLIER_SCORE);
        }
        let is_crowd = around.weight > CROWD_WEIGHT_PER_NEIGHBOR * f32(frame.k);
        let is_aside = abs(dot(around.axis, around.mean)) * WIDER_BALL_K_RADII > MAX_PLANE_DISTANCE_K_RADII;
        let is_outside = length(around.mean) * WIDER_BALL_K_RADII > MAX_MEAN_DISTANCE_K_RADII;
        if around.len >= LEAST_OF_PLANE && is_crowd && (is_aside || is_outside) {
            // Above any limit, in place of infinity, for which WGSL has no literal.
            stray = 2.0 * DROPPED_OUTLIER_SCORE;
        } else if around.len >= LEAST_OF_PLANE && around.len < LEAST_CLUSTERS && is_aside {
            stray = max(stray, DOT_OUTLIER_SCORE);
        }
    }
    if stray > DROPPED_OUTLIER_SCORE && frame.keep_outliers == 0u {
        return 0.0;
    }
    return select(surfel.radius, dot_radius(surfel), stray >= DOT_OUTLIER_SCORE);
}

// Radius of a surfel, reduced if few of the points seen at its disc lie on the disc. Unchanged if the surfel belongs to
// a surface; at least a dot. `noise` is the scatter of its points. The share of an ellipse is that of its inscribed
// circle. See docs/decisions/0011-seen-through.md.
fn opened(surfel: Surfel, noise: f32) -> f32 {
    let least = dot_radius(surfel);
    if !(surfel.radius > least) {
        return surfel.radius;
    }
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
