// What is known of the noise of depth cameras, as `adapt/depth/` has it. Imports: frame. The including pass binds
// `depth_noise`: all runs, one at least.

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

// The same if it is more than what was `measured`.
fn known_beyond(measured_noise: f32, place: vec3f, point: u32) -> Known {
    let known = known_at(place, point);
    if known.noise > measured_noise {
        return known;
    }
    return Known();
}
