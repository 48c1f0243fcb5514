// Moments to surfels, by the eigenvectors of the covariance [Paper, §6]. The CPU form says what differs from the
// paper. Keeps the k-radii as starting radii of the next frame's search: see `search/past/mod.rs`.
//
// Reads: counters, density, points, source, queries, neighborhoods. Writes: surfels, counters, past.

#import frame
#import density
#import eigen
#import groups
#import neighborhood
#import orthonormal
#import past_radii
#import screen
#import surfel

@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> density: array<DensityCell>;
@group(0) @binding(3) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(4) var<storage, read> source: array<u32>;
@group(0) @binding(5) var<storage, read> queries: array<u32>;
@group(0) @binding(6) var<storage, read> neighborhoods: array<Neighborhood>;
@group(0) @binding(7) var<storage, read_write> surfels: array<Surfel>;
@group(0) @binding(8) var<storage, read_write> past: array<atomic<u32>>;

// Values that all queries of a workgroup share.
struct Task {
    first: u32,
    len: u32,
    cell_px: u32,
    cell_columns: u32,
    // Number of screen points.
    points: u32,
}

var<workgroup> task: Task;
var<workgroup> outliers: atomic<u32>;

struct Plane {
    normal: vec3f,
    major_axis: vec3f,
    is_line: bool,
    major_ratio: f32,
    curvature: f32,
    // Variance of the point and its neighbours along the normal, in squared k-radii.
    variance: f32,
}

fn product(a: vec3f, b: vec3f) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

fn normalized_or(v: vec3f, otherwise: vec3f) -> vec3f {
    let scale = 1.0 / sqrt(product(v, v));
    return select(otherwise, v * scale, is_finite(scale) && scale > 0.0);
}

// Eigenvectors of the covariance of a point and its neighbours about their mean [Paper, Eq. 1, 2]. The unit is the
// squared k-radius, which prevents overflow and underflow.
fn axes(sums: Neighborhood) -> Eigen {
    // The point itself is one of the points fitted, but adds nothing to sums about itself.
    let share = 1.0 / (sums.count + 1.0);
    let unit = 1.0 / max(sums.k_radius, MIN_POSITIVE);
    let mean = sums.offset * unit * share;
    let of_x = sums.second_x * unit * unit * share - mean.x * mean;
    let of_yz = sums.second_yz * unit * unit * share - mean.yyz * mean.yzz;
    return eigen(vec3f(of_x.x, of_yz.x, of_yz.z), vec3f(of_yz.y, of_x.z, of_x.y));
}

// The unit normal of a neighbourhood that is no plane: as close to the direction of the eye as the line allows.
fn facing(eye: vec3f, line: vec3f, has_line: bool) -> vec3f {
    let toward = normalized_or(eye, vec3f(0.0, 0.0, -1.0));
    let across = toward - line * product(line, toward);
    let length_squared = product(across, across);
    // For a line towards the eye, the rest across it is rounding.
    let is_clear = length_squared > MIN_LINE_SINE * MIN_LINE_SINE;
    let of_line = select(any_orthonormal(line), across * (1.0 / sqrt(max(length_squared, MIN_POSITIVE))), is_clear);
    return select(toward, of_line, has_line);
}

// The plane through a neighbourhood [Paper, Eq. 1 to 3], seen from the eye. A line or a single place lies in many
// planes; the plane most perpendicular to the line of sight is taken.
fn plane(sums: Neighborhood, eye: vec3f) -> Plane {
    let found = axes(sums);
    let middle = found.values.y;
    let largest = found.values.z;
    var normal = found.least;
    var major_axis = found.largest;
    let is_plane = middle > MAX_LINE_EIGENVALUE_RATIO * largest;
    var major_ratio = largest / middle;
    if !is_plane {
        normal = facing(eye, major_axis, largest > 0.0);
        // A circle may have any tangent.
        major_axis = select(any_orthonormal(normal), major_axis, largest > 0.0);
        major_ratio = select(1.0, 1.0 / MAX_LINE_EIGENVALUE_RATIO, largest > 0.0);
    }
    let least = max(found.values.x, 0.0);
    let sum = least + middle + largest;
    let curvature = select(0.0, least / sum, sum > 0.0);
    let is_line = !is_plane && largest > 0.0;
    let facing_normal = select(normal, -normal, product(normal, eye) < 0.0);
    return Plane(facing_normal, major_axis, is_line, major_ratio, curvature, found.values.x);
}

// Splat radius of a point with `count` neighbours within `k_radius` [Paper, §6]. With a gap, k neighbours count.
fn splat_radius(k_radius: f32, count: f32) -> f32 {
    return frame.splat_scale * 2.0 * k_radius / sqrt(max(count, f32(frame.k)));
}

// Whether a point is no part of its neighbours' surface. `sparser` is the k-radius in first search radii, 0 if there
// is nothing to compare with. See `alone.rs`.
fn is_outlier(sums: Neighborhood, face: Plane, sparser: f32) -> bool {
    let count = sums.count;
    if count < MIN_COMPARED_NEIGHBORS {
        return count < min(FEW_NEIGHBORS, f32(frame.k)) && sparser > FEW_NEIGHBORS_FIRST_RADII;
    }
    let mean = sums.offset / (count * max(sums.k_radius, MIN_POSITIVE));
    let height = product(mean, face.normal);
    let beside = height * height;
    // Variance of the neighbours without the point itself.
    let all = count + 1.0;
    let scatter = (face.variance - count * beside / (all * all)) * (all / count);
    let is_beside = beside > MAX_PLANE_OFFSET_K_RADII * MAX_PLANE_OFFSET_K_RADII && beside > MIN_FLAT_OFFSET_RATIO * scatter && sparser > 0.0;
    let lopsided = select(MAX_MEAN_OFFSET_K_RADII, MAX_SPARSE_MEAN_OFFSET_K_RADII, sparser > SPARSE_FIRST_RADII);
    return product(mean, mean) > lopsided * lopsided || is_beside;
}

fn surfel(query: u32, sums: Neighborhood) -> Surfel {
    let point = points[query];
    let center = point.position_view;
    let face = plane(sums, to_eye(center));
    let cell = density[density_cell(pixel_xy(point.pixel), task.cell_px, task.cell_columns)];
    var first = initial_radius_of(cell.count, task.cell_px, center.z);
    let of_near = has_near_flag(point.pixel);
    if of_near {
        // No rule about density applies.
        first = infinity();
    }

    let fills_space = of_near && !(face.curvature <= MAX_NEAR_VARIATION);
    var radius = 0.0;
    if sums.count > 0.0 && !fills_space {
        radius = select(1.0, NEAR_RADIUS_GROWTH, of_near) * splat_radius(sums.k_radius, sums.count);
    } else if frame.keep_outliers == 1u {
        radius = ISOLATED_DOT_RADIUS_PX * max(pixel_size(center.z), 0.0);
    }
    let sparser = select(0.0, sums.k_radius / first, frame.compares_density == 1u && task.points >= MIN_SURFACE_POINTS);
    if frame.keep_outliers == 0u && (fills_space || is_outlier(sums, face, sparser)) {
        radius = 0.0;
    }
    if !of_near && center.z > culling_depth(cell.nearest, task.cell_px) {
        radius = min(radius, splat_radius(MAX_CULLED_FIRST_RADII * first, f32(frame.k)));
    }
    let screen_and_flags = query | select(0u, LINE, face.is_line);
    if frame.dot_px > 0.0 {
        let normal = normalized_or(to_eye(center), vec3f(0.0, 0.0, -1.0));
        let dot_radius = frame.dot_px * pixel_size(center.z);
        let axis = any_orthonormal(normal);
        return Surfel(
            center,
            dot_radius,
            normal,
            sums.k_radius,
            axis,
            1.0,
            DOT_CURVATURE,
            point.pixel,
            source[query],
            screen_and_flags,
        );
    }
    // A line has no width to draw.
    let drawn_ratio = select(min(face.major_ratio, frame.longest), 1.0, face.is_line);
    // Adaptation needs the full length.
    let major_ratio = select(drawn_ratio, face.major_ratio, frame.scan_lines == 1u && sums.count >= MIN_SCAN_LINE_NEIGHBORS);
    return Surfel(
        center,
        radius,
        face.normal,
        sums.k_radius,
        face.major_axis,
        major_ratio,
        face.curvature,
        point.pixel,
        source[query],
        screen_and_flags,
    );
}

// Of a pixel's points the greatest k-radius is kept, which is the same in every run.
fn keep_k_radius(of_pixel: u32, sums: Neighborhood) {
    if sums.count < f32(frame.k) || has_near_flag(of_pixel) {
        return;
    }
    let pixel = pixel_xy(of_pixel);
    let at = kept_at(pixel.y * frame.size.x + pixel.x);
    if at < arrayLength(&past) {
        atomicMax(&past[at], bitcast<u32>(sums.k_radius));
    }
}

@compute @workgroup_size(SMALL_GROUP)
fn fit(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        task.first = atomicLoad(&counters[ROUND_FIRST]);
        task.len = atomicLoad(&counters[ROUND_LEN]);
        task.cell_px = atomicLoad(&counters[CELL_PX]);
        task.cell_columns = atomicLoad(&counters[CELL_COLUMNS]);
        task.points = atomicLoad(&counters[VISIBLE]);
        atomicStore(&outliers, 0u);
    }
    workgroupBarrier();
    let index = group_index(workgroup) * SMALL_GROUP + local;
    if index < task.len {
        let place = task.first + index;
        let sums = neighborhoods[place];
        let fitted = surfel(queries[place], sums);
        surfels[place] = fitted;
        keep_k_radius(fitted.pixel, sums);
        if is_dropped(fitted) {
            atomicAdd(&outliers, 1u);
        }
    }
    workgroupBarrier();
    if local == 0u && atomicLoad(&outliers) > 0u {
        atomicAdd(&counters[OUTLIERS], atomicLoad(&outliers));
    }
}
