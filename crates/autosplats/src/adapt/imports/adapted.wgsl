// Surfels adapted to noise, and shrunk where they are no surface: see the CPU form. The including pass binds
// `counters`, `density`, `levels`, `statistics`, `sheets`, `depth_noise` and `surfels`. It imports `balls` or `later`,
// which define who fits the balls that a surfel needs. See docs/decisions/0010-outliers.md.

#import frame
#import calls
#import density
#import depth_noise
#import levels
#import moved
#import noise
#import orthonormal
#import screen
#import sheet
#import surface
#import surfel

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

// Noise that is known at a surfel, beyond what is measured.
fn known_of(surfel: Surfel) -> KnownNoise {
    return known_beyond(noise_at(statistics.noise, surfel.k_radius), surfel.center, surfel.source);
}

// First search radius of a surfel's point, before the surfel moves, possibly to an empty place.
fn own_radius_of(surfel: Surfel, cell_px: u32, cell_columns: u32) -> f32 {
    let cell = density[density_cell(pixel_xy(surfel.pixel), cell_px, cell_columns)];
    return initial_radius_of(cell.count, cell_px, surfel.center.z);
}

// Radius of a surfel after the outlier test; 0 if the surfel is dropped. Outliers have neighbours that are far away and
// fill space, or that are cut off from all other points. `own_radius` is the first search radius.
fn shrunk(surfel: Surfel, own_radius: f32) -> f32 {
    let usual = statistics.k_radius;
    // Too few points have no usual k-radius.
    if usual == 0.0 {
        return surfel.radius;
    }
    let ratio = surfel.k_radius / usual;
    var stray = surfel.curvature * ratio * ratio;
    let is_sparse = ratio > SPARSE_MEDIAN_K_RADII;
    let local = surfel.k_radius / own_radius;
    if is_sparse || surfel.curvature * local * local > ISOLATED_SCORE {
        stray = stray_around(surfel, stray, ratio);
    }
    if stray > DROPPED_OUTLIER_SCORE && frame.keep_outliers == 0u {
        return 0.0;
    }
    return select(surfel.radius, dot_radius(surfel), stray >= DOT_OUTLIER_SCORE);
}

// Radius of a surfel, reduced if few of the points seen at its disc lie on the disc. Unchanged if the surfel belongs to
// a surface; at least a dot. `noise` is the scatter of its points. Only surfels are tested whose neighbours are far for
// the first search radius `own_radius`.
fn opened(surfel: Surfel, own_radius: f32, noise: f32) -> f32 {
    let least = dot_radius(surfel);
    if surfel.k_radius > MIN_TESTED_FIRST_RADII * own_radius && surfel.radius > least {
        return opened_to(surfel, least, noise);
    }
    return surfel.radius;
}

// A surfel that has been adapted to noise or its scan line.
struct Adapted {
    surfel: Surfel,
    // Scatter of its points, world units.
    noise: f32,
    // Whether a surface was found, so that it is no outlier.
    has_surface: bool,
}

// A surfel, not on a scan line, moved onto the surface beside it if it is noisy.
fn moved_to_surface(fitted: Surfel, known: KnownNoise, own_radius: f32) -> Adapted {
    var surfel = fitted;
    // A line has no width to draw.
    surfel.major_ratio = select(min(surfel.major_ratio, frame.longest), 1.0, is_line(surfel));
    let noise = max(known.noise, noise_at(statistics.noise, surfel.k_radius));
    let enough = good_enough(noise, surfel.k_radius, surfel.center.z);
    let is_noisy = calls(surfel, noise, enough);
    var surface = Surface();
    if is_noisy {
        let is_reliable = noise < MAX_NOISE_K_RADII * surfel.k_radius;
        let first = vec4f(surfel.normal, select(-1.0, noise / surfel.k_radius, is_reliable));
        let scatter = most_scatter(noise, known.noise > 0.0);
        surface = blend(surfel.center, first, noise, scatter);
        if surface.weight == 0.0 {
            surface = surface_around(surfel, own_radius, first, noise, enough, scatter);
        }
    }
    if surface.weight > 0.0 {
        if known.noise > 0.0 {
            // Between two surfaces the k-radius is the distance to one of them.
            surfel.radius *= min(MAX_K_RADIUS_FIRST_RADII * own_radius / surfel.k_radius, 1.0);
        }
        surfel = moved_onto(surfel, surface, noise, known);
    }
    return Adapted(surfel, select(0.0, noise, is_noisy), surface.weight > 0.0);
}

// The surfel, shrunk where it is no surface. Once for all surfels, because devices inline each call.
fn ended(adapted: Adapted, own_radius: f32) -> Surfel {
    var surfel = adapted.surfel;
    // Cells lack the neighbours of near points.
    if is_near(surfel) {
        return surfel;
    }
    if !adapted.has_surface && !is_dropped(surfel) {
        surfel.radius = shrunk(surfel, own_radius);
    }
    surfel.radius = opened(surfel, own_radius, adapted.noise);
    return surfel;
}

// Stores an adapted surfel, and counts it if that dropped it.
fn keep_adapted(place: u32, before: Surfel, now: Surfel) {
    surfels[place] = now;
    if is_dropped(now) && !is_dropped(before) {
        atomicAdd(&counters[OUTLIERS], 1u);
    }
}
