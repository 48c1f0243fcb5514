// Moves each noisy surfel onto the sheets beside it, and shrinks surfels that are no surface: an invocation per surfel.
// Scan lines are left to `turn_rows`. See the CPU form.
//
// Reads: density, levels, clusters, statistics, sheets, depth_noise. Reads and writes: counters, surfels.

#import frame
#import alone
#import base_radius
#import calls
#import choose
#import density
#import depth_noise
#import groups
#import levels
#import moved
#import noise
#import orthonormal
#import round
#import screen
#import sheet
#import shrink
#import surfel

@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> density: array<DensityCell>;
@group(0) @binding(3) var<storage, read> levels: array<Level>;
@group(0) @binding(4) var<storage, read> clusters: array<vec4f>;
@group(0) @binding(5) var<storage, read> statistics: FrameStatistics;
@group(0) @binding(6) var<storage, read> sheets: array<Sheet>;
@group(0) @binding(7) var<storage, read> depth_noise: array<DepthRun>;
@group(0) @binding(8) var<storage, read_write> surfels: array<Surfel>;

// The surface beside a surfel.
struct Surface {
    // From the surfel to the surface, world units.
    offset: vec3f,
    // Sum of weights; 0 without sheets, below 0 if none of the sheets agrees.
    weight: f32,
    // Unit normal, of either sign.
    normal: vec3f,
    curvature: f32,
}

// The surface beside a surfel, from the sheets of the four cells around. `first` is a normal and its standard error,
// below 0 if unreliable. Sheets have to agree with a reliable one.
fn blend(center: vec3f, first: vec4f, noise: f32, scatter: f32) -> Surface {
    var sum = Surface();
    let level = levels[statistics.sheet_level];
    if level.side_px == 0u {
        return sum;
    }
    let at = to_pixel(center) * (1.0 / f32(level.side_px)) - 0.5;
    let low = vec2u(max(floor(at), vec2f(0.0)));
    let high = min(vec2u(max(at + 1.0, vec2f(0.0))), vec2u(level.columns, level.rows) - 1u);
    let per_farthest = 1.0 / (MAX_MOVE_NOISES * noise);
    var disagrees = false;
    for (var row = low.y; row <= high.y; row++) {
        for (var column = low.x; column <= high.x; column++) {
            let cell = row * level.columns + column;
            // Falls to 0 where the next cells begin.
            let apart = 1.0 - abs(at - vec2f(vec2u(column, row)));
            for (var index = 0u; index < SHEETS; index++) {
                let sheet = sheets[cell * SHEETS + index];
                if !(sheet.radius > 0.0) {
                    break;
                }
                let over = under(sheet, center);
                let away = over.height * per_farthest;
                let rest = 1.0 - away * away;
                if !(over.near > 0.0 && rest > 0.0) {
                    continue;
                }
                let normal = sheet_normal(sheet, over);
                let across = cross(normal, first.xyz);
                // The smallest of a sheet's balls has not been held against any normal.
                let agrees = dot(across, across) <= AGREE_ERRORS * AGREE_ERRORS * (sheet.error * sheet.error + first.w * first.w);
                if first.w >= 0.0 && !(agrees && sheet.scatter <= scatter) {
                    disagrees = true;
                    continue;
                }
                // The eighth power is about the likelihood of such a distance under noise.
                let second = rest * rest;
                let fourth = second * second;
                let weight = apart.x * apart.y * (over.near * over.near) * (fourth * fourth) * sheet.trust;
                sum.normal += normal * select(weight, -weight, dot(normal, sum.normal) < 0.0);
                sum.offset += sheet.axis * (over.height * weight);
                sum.curvature += sheet.curvature * weight;
                sum.weight += weight;
            }
        }
    }
    if sum.weight > 0.0 {
        let per_total = 1.0 / sum.weight;
        sum.offset *= per_total;
        // Weights may be so small that their squares are zero.
        sum.normal = normalize(sum.normal * per_total);
        sum.curvature *= per_total;
    } else {
        sum.weight = select(0.0, -1.0, disagrees);
    }
    return sum;
}

// Replaces a move by `offset` onto the plane with a `normal` by a move along the ray. Where the ray nearly lies in the
// plane, the move stays along the normal.
fn offset_along(known: KnownNoise, normal: vec3f, offset: vec3f) -> vec3f {
    let distance = dot(offset, normal);
    let slope = dot(known.ray, normal);
    let inverse = 1.0 / (slope * slope + GRAZING_COSINE * GRAZING_COSINE);
    let along = distance * slope * inverse;
    let rest = distance * GRAZING_COSINE * GRAZING_COSINE * inverse;
    let limit = FARTHEST_ALONG * known.noise;
    let part = select(1.0, limit / abs(along), abs(along) > limit);
    return (known.ray * along + normal * rest) * part;
}

// The shadow that a disc with the normal `before` casts along the ray onto a plane with the normal `after`: major axis
// and ratio. Returns `otherwise` if the shadow is no longer than the disc.
fn shadow_along(known: KnownNoise, before: vec3f, after: vec3f, otherwise: vec4f) -> vec4f {
    let slope = dot(known.ray, after);
    let ratio = min(abs(dot(known.ray, before)) / max(abs(slope), GRAZING_COSINE), LONGEST_SHADOW);
    let major = known.ray - after * slope;
    let length_squared = dot(major, major);
    if ratio > 1.0 && length_squared > 0.0 {
        return vec4f(major * inverseSqrt(length_squared), ratio);
    }
    return otherwise;
}

// Turns and moves a surfel onto a surface, along the sensor's ray where the noise is known. The surfel becomes a dot
// where `noise` does not explain its distance from the surface.
fn moved_onto(surfel: Surfel, surface: Surface, noise: f32, known: KnownNoise) -> Surfel {
    var offset = surface.offset;
    if known.noise > 0.0 {
        offset = offset_along(known, surface.normal, offset);
    }
    let center = surfel.center + offset;
    let normal = turned_to_eye(surface.normal, center);
    var out = surfel;
    out.normal = normal;
    let is_stray = length(surface.offset) > select(OUTLIER_OFFSET_NOISES, OUTLIER_OFFSET_KNOWN_NOISES, known.noise > 0.0) * noise;
    var shadow = vec4f(any_orthonormal(normal), 1.0);
    if known.noise > 0.0 && !is_stray {
        shadow = shadow_along(known, surfel.normal, normal, shadow);
    }
    out.major_axis = shadow.xyz;
    out.major_ratio = shadow.w;
    out.curvature = surface.curvature;
    out = moved(out, center);
    if is_stray {
        out.radius = dot_radius(out);
    }
    return out;
}

@compute @workgroup_size(SMALL_GROUP)
fn adapt(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let active_points = atomicLoad(&counters[ACTIVE]);
    let first_of_round = select(0u, active_points, ROUND == 1u);
    let len = select(active_points, atomicLoad(&counters[RECOVERED]), ROUND == 1u);
    let index = group_index(workgroup) * SMALL_GROUP + local;
    if index >= len {
        return;
    }
    let place = first_of_round + index;
    var surfel = surfels[place];
    let known = known_beyond(noise_at(statistics.noise, surfel.k_radius), surfel.center, surfel.source);
    if is_row(surfel, known.noise) {
        return;
    }
    let noise = max(known.noise, noise_at(statistics.noise, surfel.k_radius));
    let cell_px = atomicLoad(&counters[CELL_PX]);
    // Read before the surfel moves, possibly to an empty place.
    let cell = density[density_cell(pixel_xy(surfel.pixel), cell_px, atomicLoad(&counters[CELL_COLUMNS]))];
    let own_radius = initial_radius_of(cell.count, cell_px, surfel.center.z);
    // A line has no width to draw.
    surfel.major_ratio = select(min(surfel.major_ratio, frame.longest), 1.0, is_line(surfel));
    if is_near(surfel) {
        // Cells lack the neighbours of near points.
        surfels[place] = surfel;
        return;
    }
    let enough = good_enough(noise, surfel.k_radius, surfel.center.z);
    let is_noisy = calls(surfel, noise, enough);
    var surface = Surface();
    if is_noisy {
        let is_reliable = noise < MAX_NOISE_K_RADII * surfel.k_radius;
        let first = vec4f(surfel.normal, select(-1.0, noise / surfel.k_radius, is_reliable));
        let scatter = most_scatter(noise, known.noise > 0.0);
        surface = blend(surfel.center, first, noise, scatter);
        if surface.weight == 0.0 {
            let radius = base_radius(surfel, own_radius);
            let quadric = choose(surfel.center, radius, first, noise, enough, scatter);
            if quadric.len > 0u {
                surface = Surface(quadric.axis * quadric.height, 1.0, quadric.normal, quadric.curvature);
            }
        }
    }
    if surface.weight > 0.0 {
        if known.noise > 0.0 {
            // Between two surfaces the k-radius is the distance to one of them.
            surfel.radius *= min(MAX_K_RADIUS_FIRST_RADII * own_radius / surfel.k_radius, 1.0);
        }
        surfel = moved_onto(surfel, surface, noise, known);
    } else if !is_dropped(surfel) {
        surfel.radius = shrunk(surfel, own_radius, statistics.k_radius);
        if is_dropped(surfel) {
            atomicAdd(&counters[OUTLIERS], 1u);
        }
    }
    if surfel.k_radius > MIN_TESTED_FIRST_RADII * own_radius {
        surfel.radius = opened(surfel, select(0.0, noise, is_noisy));
    }
    surfels[place] = surfel;
}
