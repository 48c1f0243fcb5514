// Turns and moves each surfel that the noise tilts onto the sheets beside it, and those of rows onto areas; shrinks those that are
// no surface: an invocation per surfel. See the CPU form.
//
// Reads: density, levels, clusters, measured, sheets, depth_noise. Reads and writes: counters, surfels.

#import frame
#import groups
#import counters
#import base_radius
#import calls
#import choose
#import depth_noise
#import moved
#import rows
#import sheet
#import through

@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> density: array<vec2u>;
@group(0) @binding(3) var<storage, read> levels: array<Level>;
@group(0) @binding(4) var<storage, read> clusters: array<vec4f>;
@group(0) @binding(5) var<storage, read> measured: array<f32>;
@group(0) @binding(6) var<storage, read> sheets: array<Sheet>;
@group(0) @binding(7) var<storage, read> depth_noise: array<DepthRun>;
@group(0) @binding(8) var<storage, read_write> surfels: array<Surfel>;

// 0: the active points; 1: the recovered ones, which follow them.
override ROUND: u32;
override THICKEST_FIRST: f32;
override WIDEST: f32;
override STRAY_OFFSET: f32;
override STRAY_OFFSET_KNOWN: f32;
override GRAZING: f32;
override FARTHEST_ALONG: f32;
override LONGEST_SHADOW: f32;
override SPARSE: f32;
override LONE: f32;
override AROUND_SPARSE: f32;
override ASIDE: f32;
override OFF_MIDDLE: f32;
override CROWD: f32;
override STRAY_DOT: f32;
override STRAY_DROPPED: f32;
override DOT_PX: f32;
override LEAST_ON: f32;
override ON_DISC: f32;
override ON_DISC_NOISE: f32;
override DENSER: f32;
override GOES_ON: f32;
override FLAT_AROUND: f32;
override WIDE_AROUND: f32;
override ALL_AROUND: f32;
override CELLS_TO_COUNT: f32;
override SUPPORT: f32;

// The surface beside a surfel.
struct Surface {
    // From the surfel to the surface.
    offset: vec3f,
    // Sum of weights; 0 if there is none, below 0 if there are some of which none agrees.
    weight: f32,
    // Of either sign.
    normal: vec3f,
    curvature: f32,
}

// The surface beside a surfel, from the sheets of the four cells around it that agree with the `first` normal.
fn blend(center: vec3f, first: vec4f, noise: f32, scatter: f32) -> Surface {
    var sum = Surface();
    let level = levels[sheet_level()];
    if level.side_px == 0u {
        return sum;
    }
    let at = to_pixel(center) * (1.0 / f32(level.side_px)) - 0.5;
    let low = vec2u(max(floor(at), vec2f(0.0)));
    let high = min(vec2u(max(at + 1.0, vec2f(0.0))), vec2u(level.columns, level.rows) - 1u);
    let per_farthest = 1.0 / (FARTHEST * noise);
    var disagrees = false;
    for (var row = low.y; row <= high.y; row++) {
        for (var column = low.x; column <= high.x; column++) {
            let cell = row * level.columns + column;
            // Falls to 0 where the next cells come in.
            let apart = 1.0 - abs(at - vec2f(vec2u(column, row)));
            for (var index = 0u; index < SLABS; index++) {
                let sheet = sheets[cell * SLABS + index];
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
                // The smallest of a sheet's balls was held against nothing.
                let agrees = dot(across, across) <= AGREE * AGREE * (sheet.error * sheet.error + first.w * first.w);
                if first.w >= 0.0 && !(agrees && sheet.scatter <= scatter) {
                    disagrees = true;
                    continue;
                }
                // To the eighth: about as likely as noise puts a point there.
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
        sum.normal = normalize(sum.normal);
        sum.curvature *= per_total;
    } else {
        sum.weight = select(0.0, -1.0, disagrees);
    }
    return sum;
}

// A move by `offset` onto the plane with a `normal`, made along the ray instead; along the normal where the ray is nearly in
// the plane.
fn offset_along(known: Known, normal: vec3f, offset: vec3f) -> vec3f {
    let distance = dot(offset, normal);
    let slope = dot(known.ray, normal);
    let inverse = 1.0 / (slope * slope + GRAZING * GRAZING);
    let along = distance * slope * inverse;
    let rest = distance * GRAZING * GRAZING * inverse;
    let limit = FARTHEST_ALONG * known.noise;
    let part = select(1.0, limit / abs(along), abs(along) > limit);
    return (known.ray * along + normal * rest) * part;
}

// The shadow that a disc with the normal `before` casts along the ray on a plane with the normal `after`, as its major axis
// and ratio; `otherwise` if it is no longer.
fn shadow_along(known: Known, before: vec3f, after: vec3f, otherwise: vec4f) -> vec4f {
    let slope = dot(known.ray, after);
    let ratio = min(abs(dot(known.ray, before)) / max(abs(slope), GRAZING), LONGEST_SHADOW);
    let major = known.ray - after * slope;
    let length_squared = dot(major, major);
    if ratio > 1.0 && length_squared > 0.0 {
        return vec4f(major * inverseSqrt(length_squared), ratio);
    }
    return otherwise;
}

// Radius of a surfel that is drawn as a dot.
fn dot_radius(surfel: Surfel) -> f32 {
    return min(surfel.radius, DOT_PX * pixel_size(surfel.center.z));
}

// Turns and moves a surfel onto a surface, along the ray along which its noise was made if that is known. Where `noise` does not
// explain how far it is from there, it becomes a dot.
fn move_onto(place: u32, surfel: Surfel, surface: Surface, noise: f32, known: Known) {
    var offset = surface.offset;
    if known.noise > 0.0 {
        offset = offset_along(known, surface.normal, offset);
    }
    let center = surfel.center + offset;
    let normal = turned_to_eye(surface.normal, center);
    var out = surfel;
    out.normal = normal;
    let is_stray = length(surface.offset) > select(STRAY_OFFSET, STRAY_OFFSET_KNOWN, known.noise > 0.0) * noise;
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
    surfels[place] = out;
}

fn own_initial_radius(surfel: Surfel) -> f32 {
    return initial_radius(surfel, atomicLoad(&counters[CELL_PX]), atomicLoad(&counters[CELL_COLUMNS]));
}

// Shrinks or drops a surfel that is no surface: its neighbours are far away and fill the space between, or are cut off from all
// others.
fn shrink(place: u32, surfel: Surfel) {
    let usual = measured[2];
    // A handful of points has nothing that is usual.
    if usual == 0.0 {
        return;
    }
    let ratio = surfel.k_radius / usual;
    var stray = surfel.curvature * ratio * ratio;
    let is_sparse = ratio > SPARSE;
    let local = surfel.k_radius / own_initial_radius(surfel);
    if is_sparse || surfel.curvature * local * local > LONE {
        let around = plane_of(ball_around(surfel.center, AROUND_SPARSE * surfel.k_radius, CELLS_PER_RADIUS));
        if is_sparse && around.len >= LEAST_CLUSTERS {
            stray = max(stray, curvature_of(around) * ratio * ratio);
        } else if is_sparse && around.weight < f32(frame.k) {
            stray = max(stray, STRAY_DOT);
        }
        let is_crowd = around.weight > CROWD * f32(frame.k);
        let is_aside = abs(dot(around.axis, around.mean)) * AROUND_SPARSE > ASIDE;
        let is_outside = length(around.mean) * AROUND_SPARSE > OFF_MIDDLE;
        let stands_alone = ((is_crowd || around.len < LEAST_CLUSTERS) && is_aside) || (is_crowd && is_outside);
        if around.len >= LEAST_OF_PLANE && stands_alone {
            stray = max(stray, STRAY_DOT);
        }
    }
    if stray > STRAY_DROPPED && frame.keep_outliers == 0u {
        surfels[place].radius = 0.0;
        atomicAdd(&counters[OUTLIERS], 1u);
    } else if stray >= STRAY_DOT {
        surfels[place].radius = dot_radius(surfel);
    }
}

// Shrinks a surfel, whose points scatter by `noise`, to its share of what is seen where it is, unless it is one of a surface; to a
// dot at least. Of an ellipse the circle within is asked, and the ellipse shrinks.
fn open(place: u32, noise: f32) {
    let surfel = surfels[place];
    let least = dot_radius(surfel);
    if !(surfel.radius > least) {
        return;
    }
    let radius = SUPPORT * surfel.radius;
    let disc = ball_around(surfel.center, radius, CELLS_TO_COUNT);
    let points = seen(disc, surfel.normal, max(ON_DISC * radius, ON_DISC_NOISE * noise)).points;
    // Its own point is on it, and may have moved.
    let on = max(points.x, 1.0);
    let share = on / (on + points.y);
    if !(share < LEAST_ON) {
        return;
    }
    let around = plane_of(ball_around(surfel.center, GOES_ON * surfel.k_radius, CELLS_PER_RADIUS));
    let is_flat = curvature_of(around) < FLAT_AROUND;
    let is_wide = around.variances.y > WIDE_AROUND * around.variances.z;
    let is_all_around = length(around.mean) < ALL_AROUND;
    if around.len < LEAST_CLUSTERS || !(is_flat && is_wide && is_all_around) {
        surfels[place].radius = max(surfel.radius * (share / LEAST_ON), least);
    }
}

@compute @workgroup_size(64)
fn adapt(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let active_points = atomicLoad(&counters[ACTIVE]);
    let first_of_round = select(0u, active_points, ROUND == 1u);
    let len = select(active_points, atomicLoad(&counters[RECOVERED]), ROUND == 1u);
    let index = group_index(workgroup) * 64u + local;
    if index >= len {
        return;
    }
    let place = first_of_round + index;
    let surfel = surfels[place];
    let known = known_beyond(noise_at(surfel.k_radius), surfel.center, surfel.source);
    let noise = max(known.noise, noise_at(surfel.k_radius));
    let is_sparser = surfel.k_radius > DENSER * own_initial_radius(surfel);
    if is_row(surfel, known.noise) {
        let radius = base_radius(surfel, atomicLoad(&counters[CELL_PX]), atomicLoad(&counters[CELL_COLUMNS]));
        let area = area(surfel, radius);
        let out = turned(surfel, area);
        surfels[place] = out;
        if area.radius == 0.0 {
            shrink(place, out);
        }
        if is_sparser {
            open(place, 0.0);
        }
        return;
    }
    // A line has no width to draw.
    let drawn_ratio = select(1.0, min(surfel.major_ratio, frame.longest), surfel.major_ratio < MOST);
    surfels[place].major_ratio = drawn_ratio;
    let enough = good_enough(noise, surfel.k_radius, surfel.center.z);
    let is_noisy = calls(surfel, noise, enough);
    var surface = Surface();
    if is_noisy {
        let is_reliable = noise < THICKEST_FIRST * surfel.k_radius;
        let first = vec4f(surfel.normal, select(-1.0, noise / surfel.k_radius, is_reliable));
        let scatter = most_scatter(noise, known.noise > 0.0);
        surface = blend(surfel.center, first, noise, scatter);
        if surface.weight == 0.0 {
            let cell_px = atomicLoad(&counters[CELL_PX]);
            let radius = base_radius(surfel, cell_px, atomicLoad(&counters[CELL_COLUMNS]));
            let quadric = choose(surfel.center, radius, first, noise, enough, scatter);
            if quadric.len > 0u {
                surface = Surface(quadric.axis * quadric.height, 1.0, quadric.normal, quadric.curvature);
            }
        }
    }
    if surface.weight > 0.0 {
        var shrunk = surfel;
        if known.noise > 0.0 {
            // Between two surfaces the k-radius is the way to one of them.
            let widest = WIDEST * own_initial_radius(surfel);
            shrunk.radius *= min(widest / surfel.k_radius, 1.0);
        }
        move_onto(place, shrunk, surface, noise, known);
    } else if surfel.radius > 0.0 {
        shrink(place, surfel);
    }
    if is_sparser {
        open(place, select(0.0, noise, is_noisy));
    }
}
