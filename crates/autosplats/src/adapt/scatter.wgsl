// Scatter of points about the quadrics of the balls around each sampled surfel: a workgroup per ball.
//
// Reads: counters, density, surfels, levels, clusters, sampled. Writes: scatters, ball size by ball size.

#import frame
#import base_radius
#import density
#import groups
#import levels
#import quadric
#import scatters
#import screen
#import surfel
#import together

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> density: array<DensityCell>;
@group(0) @binding(3) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(4) var<storage, read> levels: array<Level>;
@group(0) @binding(5) var<storage, read> clusters: array<vec4f>;
@group(0) @binding(6) var<storage, read> sampled: array<u32>;
@group(0) @binding(7) var<storage, read_write> scatters: array<u32>;

@compute @workgroup_size(TOGETHER)
fn scatter(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    own_place = local;
    let index = group_index(workgroup);
    let scale = index / MOST_SAMPLED;
    let rank = index % MOST_SAMPLED;
    if scale >= SCALES || rank >= sampled[MOST_SAMPLED] {
        return;
    }
    let surfel = surfels[sampled[rank]];
    let cell = density[density_cell(pixel_xy(surfel.pixel), counters[CELL_PX], counters[CELL_COLUMNS])];
    var radius = base_radius(surfel, initial_radius_of(cell.count, counters[CELL_PX], surfel.center.z)) * STEP;
    for (var smaller = 0u; smaller < scale; smaller++) {
        radius *= STEP;
    }
    let ball = ball_around(surfel.center, radius, CELLS_PER_RADIUS);
    let plane = plane_of(ball);
    var found = TOO_FEW;
    if plane.len >= LEAST_CLUSTERS {
        let scatter = quadric_of(ball, plane.axis, curvature_of(plane)).scatter;
        let distance = select(scatter, 0.0, scatter < ROUNDING_SCATTER_RADII * radius);
        found = bitcast<u32>(distance) | select(THICK, 0u, distance < THIN_SCATTER_RADII * radius);
    }
    if local == 0u {
        scatters[index] = found;
    }
}
