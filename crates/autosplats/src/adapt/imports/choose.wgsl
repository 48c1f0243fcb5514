// The choice of a quadric's scale: see the CPU form. The including pass binds `levels` and `clusters`. See
// docs/decisions/0006-scale-by-agreement.md.

#import orthonormal
#import quadric

// The same surface with heights along its normal at the point. Accurate to second order near the point.
fn upright(quadric: Quadric) -> Quadric {
    let u = any_orthonormal(quadric.axis);
    let v = cross(quadric.axis, u);
    let p = any_orthonormal(quadric.normal);
    let q = cross(quadric.normal, p);
    let at_p = vec2f(dot(p, u), dot(p, v));
    let at_q = vec2f(dot(q, u), dot(q, v));
    let cosine = dot(quadric.axis, quadric.normal);
    let bend = quadric.bend;
    var found = quadric;
    found.bend = cosine * vec3f(
        dot(bend, vec3f(at_p.x * at_p.x, at_p.x * at_p.y, at_p.y * at_p.y)),
        dot(bend, vec3f(2.0 * at_p.x * at_q.x, at_p.x * at_q.y + at_q.x * at_p.y, 2.0 * at_p.y * at_q.y)),
        dot(bend, vec3f(at_q.x * at_q.x, at_q.x * at_q.y, at_q.y * at_q.y)),
    );
    found.height *= cosine;
    found.axis = quadric.normal;
    found.slope = vec2f(0.0);
    return found;
}

// Interpolates from an upright quadric to that of a larger ball with the same axis: `smaller` at share 0, `larger` at
// share 1.
fn towards(smaller: Quadric, larger: Quadric, share: f32) -> Quadric {
    var found = larger;
    found.radius = mix(smaller.radius, larger.radius, share);
    found.slope = share * larger.slope;
    // Bends are in radii of their own balls; curvatures in world units can be compared.
    found.bend = found.radius * mix(smaller.bend / smaller.radius, larger.bend / larger.radius, vec3f(share));
    let u = any_orthonormal(larger.axis);
    let v = cross(larger.axis, u);
    found.normal = normalize(larger.axis - u * found.slope.x - v * found.slope.y);
    found.height = mix(smaller.height, larger.height, share);
    found.scatter = mix(smaller.scatter, larger.scatter, share);
    found.error = mix(smaller.error, larger.error, share);
    return found;
}

// The upright quadric around `center`, from balls that grow until its standard error is below `enough`. Without
// clusters if no ball beats the first neighbours. The radii are `least_radius` times powers of `STEP`.
//
// `first` is the normal of the first neighbours and its standard error, negative if unknown; the smallest ball has to
// agree with it. Each ball weighs by its agreement with the smaller ones. A ball that disagrees or has more than
// `scatter` ends the search.
fn choose(center: vec3f, least_radius: f32, first: vec4f, noise: f32, enough: f32, scatter: f32) -> Quadric {
    var radius = least_radius;
    // The normal to agree with, and its standard error; negative if there is none yet.
    var reliable = first;
    var best = Quadric();
    // The quadric of least error, in case none is reliable.
    var fallback = Quadric();
    // The heights of the first ball are along its plane's normal, those of larger balls along the last quadric's
    // normal.
    var plane = Plane();
    var has_axis = false;
    for (var scale = 0u; scale < SCALES; scale++) {
        radius *= STEP;
        // A ball that is filled by noise has no surface; the largest is used as a last resort.
        let thin = noise < MAX_NOISE_BALL_RADII * radius;
        if !thin && scale + 1u < SCALES {
            continue;
        }
        let ball = ball_around(center, radius, CELLS_PER_RADIUS);
        if !has_axis {
            plane = plane_of(ball);
            let least = noise * (1.0 / (MAX_RELIABLE_ERROR_RAD * radius));
            let is_vain = plane.weight < LEAST_TRACE * least * least && scale + 1u < SCALES;
            if plane.len < LEAST_CLUSTERS || is_vain {
                continue;
            }
        }
        let quadric = quadric_of(ball, plane.axis, curvature_of(plane));
        if quadric.len < LEAST_CLUSTERS {
            continue;
        }
        let error = quadric.error * noise;
        if !(thin && error < MAX_RELIABLE_ERROR_RAD) {
            if fallback.len == 0u || quadric.error < fallback.error {
                fallback = quadric;
            }
            continue;
        }
        var share = 1.0;
        if reliable.w >= 0.0 {
            let across = cross(quadric.normal, reliable.xyz);
            share = 1.0 - dot(across, across) / (AGREE_ERRORS * AGREE_ERRORS * (error * error + reliable.w * reliable.w));
            if !(share > 0.0 && quadric.scatter <= scatter) {
                break;
            }
        }
        if best.len == 0u {
            best = upright(quadric);
        } else {
            best = upright(towards(best, quadric, share));
        }
        reliable = vec4f(best.normal, best.error * noise);
        plane.axis = best.normal;
        has_axis = true;
        if reliable.w < enough {
            break;
        }
    }
    if reliable.w < 0.0 {
        best = upright(fallback);
    }
    // A quadric further away is another surface.
    if !(abs(best.height) <= MAX_MOVE_NOISES * noise) {
        return Quadric();
    }
    return best;
}
