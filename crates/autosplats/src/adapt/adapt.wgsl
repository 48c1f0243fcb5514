// Fits each surfel anew at the scale that the frame's noise calls for: an invocation per surfel. See the CPU form.
//
// Reads: density, levels, clusters, measured, depth_noise. Reads and writes: counters, surfels.

#import frame
#import groups
#import counters
#import quadric
#import depth_noise

@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> density: array<vec2u>;
@group(0) @binding(3) var<storage, read> levels: array<Level>;
@group(0) @binding(4) var<storage, read> clusters: array<vec4f>;
@group(0) @binding(5) var<storage, read> measured: array<f32>;
@group(0) @binding(6) var<storage, read_write> surfels: array<Surfel>;
// In the order of the points, the first from point 0 on.
@group(0) @binding(7) var<storage, read> depth_noise: array<DepthRun>;

// 0: the active points; 1: the recovered ones, which follow them.
override ROUND: u32;
override STEP: f32;
override ENOUGH: f32;
override TINY_PX: f32;
override TINY_SLOPE: f32;
override RELIABLE: f32;
override THICKEST: f32;
override THICKEST_FIRST: f32;
override SCATTER: f32;
override AGREE: f32;
override WIDEST: f32;
override FARTHEST: f32;
override STRAY_DOT: f32;
override STRAY_DROPPED: f32;
override DOT_PX: f32;

// Standard deviation of points from their surface at a depth above 0.
fn noise_at(depth: f32) -> f32 {
    let power = measured[1];
    return measured[0] * select(pow(depth, power), 1.0, power == 0.0);
}

// Standard error of a normal, radians, that no larger ball need better.
fn good_enough(noise: f32, depth: f32) -> f32 {
    return ENOUGH + TINY_SLOPE * max(TINY_PX - noise / pixel_size(depth), 0.0);
}

// The quadric of the largest ball that agrees with the smaller ones; of no clusters if none is better than the first
// neighbours.
fn choose(surfel: Surfel, noise: f32, enough: f32) -> Quadric {
    let cell_px = atomicLoad(&counters[CELL_PX]);
    var radius = base_radius(surfel, cell_px, atomicLoad(&counters[CELL_COLUMNS]));
    // Normals to agree with, and their errors.
    var reliable: array<vec4f, SCALES + 1u>;
    var count = 0u;
    if noise < THICKEST_FIRST * surfel.k_radius {
        reliable[0] = vec4f(surfel.normal, noise / surfel.k_radius);
        count = 1u;
    }
    var best = Quadric();
    // Where nothing is reliable, the least error.
    var fallback = Quadric();
    // Heights of the first ball are along its plane's normal, those of larger ones along the normal found before.
    var plane = Plane();
    var has_axis = false;
    for (var scale = 0u; scale < SCALES; scale++) {
        radius *= STEP;
        // Points of a ball that the noise fills are no surface. The largest ball has to do where there is no better.
        let thin = noise < THICKEST * radius;
        if !thin && scale + 1u < SCALES {
            continue;
        }
        let ball = ball_around(surfel.center, radius);
        if !has_axis {
            plane = plane_of(ball);
            if plane.len < LEAST_CLUSTERS {
                continue;
            }
        }
        let quadric = quadric_of(ball, plane.axis, plane.curvature);
        if quadric.len < LEAST_CLUSTERS {
            continue;
        }
        let error = quadric.error * noise;
        if !(thin && error < RELIABLE) {
            if fallback.len == 0u || quadric.error < fallback.error {
                fallback = quadric;
            }
            continue;
        }
        var agrees = count == 0u || quadric.scatter <= SCATTER * noise;
        for (var index = 0u; index < count; index++) {
            let other = reliable[index];
            let across = cross(quadric.normal, other.xyz);
            agrees &= dot(across, across) <= AGREE * AGREE * (error * error + other.w * other.w);
        }
        if !agrees {
            break;
        }
        reliable[count] = vec4f(quadric.normal, error);
        count++;
        plane.axis = quadric.normal;
        has_axis = true;
        best = quadric;
        if error < enough {
            break;
        }
    }
    if count == 0u {
        best = fallback;
    }
    // A quadric further away is another surface.
    if !(abs(best.height) <= FARTHEST * noise) {
        return Quadric();
    }
    return best;
}

// Turns and moves a surfel onto a quadric: along its axis, or the ray along which its noise was made.
fn move_onto(place: u32, surfel: Surfel, quadric: Quadric, known: Known) {
    var offset = quadric.axis * quadric.height;
    if known.noise > 0.0 {
        offset = offset_along(known, quadric.normal, offset);
    }
    let center = surfel.center + offset;
    let to_eye = select(vec3f(0.0, 0.0, -1.0), -center, frame.perspective == 1u);
    let normal = select(quadric.normal, -quadric.normal, dot(quadric.normal, to_eye) < 0.0);
    surfels[place].normal = normal;
    var shadow = vec4f(any_orthonormal(normal), 1.0);
    if known.noise > 0.0 {
        shadow = shadow_along(known, surfel.normal, normal, shadow);
    }
    surfels[place].major_axis = shadow.xyz;
    surfels[place].major_ratio = shadow.w;
    surfels[place].curvature = quadric.curvature;
    let at = to_pixel(center);
    // A centre beside the picture has no pixel to be hidden at.
    if center.z > frame.near && all(at >= vec2f(0.0)) && all(at < vec2f(frame.size)) {
        let pixel = vec2u(at);
        surfels[place].center = center;
        surfels[place].pixel = (pixel.y << 16u) | pixel.x;
    }
}

// Most that the k-radius of a depth camera's point counts as: between two surfaces it is the way to one of them.
fn widest(surfel: Surfel) -> f32 {
    let cell_px = atomicLoad(&counters[CELL_PX]);
    let cell = density[density_cell(pixel_xy(surfel.pixel), cell_px, atomicLoad(&counters[CELL_COLUMNS]))];
    return WIDEST * first_radius(cell.x, cell_px, surfel.center.z);
}

// Shrinks or drops a surfel that is no surface: its neighbours are far away and fill the space between.
fn shrink(place: u32, surfel: Surfel) {
    let usual = measured[2];
    // A handful of points has nothing that is usual.
    if usual == 0.0 {
        return;
    }
    let ratio = surfel.k_radius / usual;
    let stray = surfel.curvature * ratio * ratio;
    if stray > STRAY_DROPPED && frame.keep_outliers == 0u {
        surfels[place].radius = 0.0;
        atomicAdd(&counters[OUTLIERS], 1u);
    } else if stray > STRAY_DOT {
        surfels[place].radius = min(surfel.radius, DOT_PX * pixel_size(surfel.center.z));
    }
}

@compute @workgroup_size(64)
fn adapt(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let active_points = atomicLoad(&counters[ACTIVE]);
    let first = select(0u, active_points, ROUND == 1u);
    let len = select(active_points, atomicLoad(&counters[RECOVERED]), ROUND == 1u);
    let index = group_index(workgroup) * 64u + local;
    if index >= len {
        return;
    }
    let surfel = surfels[first + index];
    // The first neighbourhood's error is about that of its k points over the k-radius.
    let measured_noise = noise_at(surfel.center.z);
    var known = known_at(surfel.center, surfel.source);
    if known.noise <= measured_noise {
        known = Known();
    }
    let noise = max(known.noise, measured_noise);
    let enough = good_enough(noise, surfel.center.z);
    var quadric = Quadric();
    if surfel.radius > 0.0 && noise > enough * surfel.k_radius {
        quadric = choose(surfel, noise, enough);
    }
    if quadric.len > 0u {
        if known.noise > 0.0 {
            surfels[first + index].radius = surfel.radius * min(widest(surfel) / surfel.k_radius, 1.0);
        }
        move_onto(first + index, surfel, quadric, known);
    } else if surfel.radius > 0.0 {
        shrink(first + index, surfel);
    }
}
