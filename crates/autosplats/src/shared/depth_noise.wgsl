// What is known of the noise of depth cameras, as `adapt/depth/` has it. Wants a binding `depth_noise` of all runs, one at least, and
// `frame`.

override GRAZING: f32;
override FARTHEST_ALONG: f32;
override LONGEST_SHADOW: f32;

// How depths scatter that one sensor measured, those of the points from one index on.
struct DepthRun {
    // Where it stood, about the cloud's origin.
    position: vec3f,
    // Index of the first point.
    first: u32,
    // Where it looked: a unit vector, in the axes of the cloud.
    axis: vec3f,
    // Standard deviation at depth 1 along the axis; 0 if nothing is known.
    factor: f32,
    power: f32,
    padding: array<u32, 3>,
}

// What is known of the noise at a surfel.
struct Known {
    // Unit direction along which it was made, view space.
    ray: vec3f,
    // Standard deviation; 0 if nothing is known.
    noise: f32,
}

// At a place in view space; of a cloud's point.
fn known_at(place: vec3f, point: u32) -> Known {
    var low = 0u;
    var high = arrayLength(&depth_noise);
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if depth_noise[middle].first <= point {
            low = middle;
        } else {
            high = middle;
        }
    }
    let run = depth_noise[low];
    let m = frame.view_from_world;
    let axis = m[0] * run.axis.x + m[1] * run.axis.y + m[2] * run.axis.z;
    let from_sensor = place - to_view(run.position);
    let depth = dot(from_sensor, axis);
    // What is in the sensor itself, or behind it, was not seen by it.
    if run.factor > 0.0 && depth > 0.0 {
        let noise = run.factor * select(pow(depth, run.power), 1.0, run.power == 0.0);
        return Known(normalize(from_sensor), noise);
    }
    return Known();
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
