// The choice of a quadric's scale: see the CPU form. Imports: frame, quadric. The including pass binds `levels` and
// `clusters`.

#import quadric

override STEP: f32;
override RELIABLE: f32;
override LEAST_TRACE: f32;
override THICKEST: f32;
override AGREE: f32;
override FARTHEST: f32;

// The quadric of the largest ball around `center` that agrees with the smaller ones and with the `first` normal, whose
// standard error follows it, negative if it is not known; of no clusters if none is better than the first neighbours. Radii
// are multiples of `least_radius`.
fn choose(center: vec3f, least_radius: f32, first: vec4f, noise: f32, enough: f32, scatter: f32) -> Quadric {
    var radius = least_radius;
    // Normals to agree with, and their errors.
    var reliable: array<vec4f, SCALES + 1u>;
    var count = 0u;
    if first.w >= 0.0 {
        reliable[0] = first;
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
        let ball = ball_around(center, radius);
        if !has_axis {
            plane = plane_of(ball);
            let least = noise * (1.0 / (RELIABLE * radius));
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
        if !(thin && error < RELIABLE) {
            if fallback.len == 0u || quadric.error < fallback.error {
                fallback = quadric;
            }
            continue;
        }
        var agrees = count == 0u || quadric.scatter <= scatter;
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
