// Sheets of a cell. The including pass imports `together` or `alone`, and binds `levels`, `clusters`, `statistics`,
// `asked`, `depth_noise` and `sheets`. See the CPU form.

#import frame
#import calls
#import choose
#import clusters
#import depth_noise
#import divide
#import levels
#import noise
#import sheet

struct SheetDemand {
    // Mean k-radius, pixels; 0 if no surfel asks.
    k_radius_px: f32,
    // Smallest point index.
    point: u32,
}

// Demand of the surfels that ask for a cell or a cell beside it, which may blend its sheets.
fn asked_around(level: Level, cell: u32) -> SheetDemand {
    let at = divide(cell, level.columns).yx;
    let low = max(at, vec2u(1u)) - 1u;
    let high = min(at + 1u, vec2u(level.columns, level.rows) - 1u);
    var sum = vec2u(0u);
    var point = NO_POINT;
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let there = asked[y * level.columns + x];
            sum += vec2u(there.count, there.k_radii);
            point = min(point, there.point);
        }
    }
    return SheetDemand(select(0.0, f32(sum.y) / (f32(sum.x) * K_RADIUS_PARTS_PER_PX), sum.x > 0u), point);
}

// Whether surfels need the sheets of a cell, and there are none yet.
fn is_wanted(level: Level, cell: u32) -> bool {
    let lacks = cell < level.columns * level.rows && sheets[cell * SHEETS].radius == UNKNOWN;
    return lacks && asked_around(level, cell).k_radius_px > 0.0;
}

// Fits sheets to the clusters of a cell, largest first, until all clusters are covered or the cell is full. With
// `together`, all invocations fit the same cell.
fn fit_cell(level: Level, cell: u32) {
    let around = asked_around(level, cell);
    let first = level.first + cell;
    var left: array<f32, SLABS>;
    for (var index = 0u; index < SLABS; index++) {
        left[index] = clusters[cluster_at(first, index)].w;
    }
    var len = 0u;
    while len < SHEETS {
        var largest = 0u;
        for (var index = 1u; index < SLABS; index++) {
            largest = select(largest, index, left[index] > left[largest]);
        }
        if left[largest] == 0.0 {
            break;
        }
        left[largest] = 0.0;
        let center = clusters[cluster_at(first, largest)].xyz;
        let radius = around.k_radius_px * pixel_size(center.z);
        let measured_noise = noise_at(statistics.noise, radius);
        let known = known_beyond(measured_noise, center, around.point).noise;
        let noise = max(measured_noise, known);
        let enough = good_enough(noise, radius, center.z);
        let quadric = choose(center, radius, vec4f(-1.0), noise, enough, most_scatter(noise, known > 0.0));
        if quadric.len == 0u {
            continue;
        }
        let error = quadric.error * noise;
        // Points of two surfaces scatter more than noise does.
        let beyond = max(quadric.scatter / noise, 1.0);
        let sheet = Sheet(
            center,
            quadric.radius,
            quadric.axis,
            quadric.height / quadric.radius,
            quadric.bend,
            error,
            quadric.curvature,
            quadric.scatter,
            // error^-¾, times the excess of scatter to the power of -3.
            1.0 / (sqrt(error) * sqrt(sqrt(error)) * (beyond * beyond * beyond)),
        );
        for (var index = 0u; index < SLABS; index++) {
            if left[index] > 0.0 {
                let over = under(sheet, clusters[cluster_at(first, index)].xyz);
                let is_covered = abs(over.height) < COVERED_NOISES * noise && over.near > 1.0 - COVERED_REACH;
                left[index] = select(left[index], 0.0, is_covered);
            }
        }
        if tells() {
            sheets[cell * SHEETS + len] = sheet;
        }
        len++;
    }
    if len == 0u && tells() {
        sheets[cell * SHEETS].radius = NONE;
    }
}
