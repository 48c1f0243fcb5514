// Scatter of points about the quadrics of the balls around each picked surfel. The including pass imports `together` or
// `alone`, and binds `counters`, `density`, `surfels`, `levels`, `clusters` and `picked`.

#import frame
#import base_radius
#import density
#import quadric
#import scatters
#import screen
#import surfel

// Whether there is a surfel for a ball.
fn is_picked(index: u32) -> bool {
    return index < SCALES * MOST_SAMPLED && index % MOST_SAMPLED < picked[MOST_SAMPLED];
}

// Scatter of a ball. Balls of one size follow each other.
fn scatter_of(index: u32) -> u32 {
    let scale = index / MOST_SAMPLED;
    let surfel = surfels[picked[index % MOST_SAMPLED]];
    let cell = density[density_cell(pixel_xy(surfel.pixel), counters[CELL_PX], counters[CELL_COLUMNS])];
    var radius = base_radius(surfel, initial_radius_of(cell.count, counters[CELL_PX], surfel.center.z)) * STEP;
    for (var smaller = 0u; smaller < scale; smaller++) {
        radius *= STEP;
    }
    let ball = ball_around(surfel.center, radius, CELLS_PER_RADIUS);
    let plane = plane_of(ball);
    if plane.len < LEAST_CLUSTERS {
        return TOO_FEW;
    }
    let scatter = quadric_of(ball, plane.axis, curvature_of(plane)).scatter;
    let distance = select(scatter, 0.0, scatter < ROUNDING_SCATTER_RADII * radius);
    return bitcast<u32>(distance) | select(THICK, 0u, distance < THIN_SCATTER_RADII * radius);
}
