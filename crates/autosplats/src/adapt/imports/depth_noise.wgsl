// Noise that is known of depth cameras, as in `adapt/depth/`. The including pass binds `depth_noise`: all runs, at
// least one. See docs/decisions/0009-depth-cameras.md.

#import frame

// Depth noise of one sensor and the first of its points.
struct DepthRun {
    // Position of the sensor relative to the cloud's origin.
    position: vec3f,
    // Index of the first point.
    first: u32,
    // Viewing direction of the sensor: unit vector in the axes of the cloud.
    axis: vec3f,
    // Standard deviation at depth 1 along the axis, 0 if unknown, and the power of depth by which it grows.
    factor: f32,
    power: f32,
    padding: array<u32, 3>,
}

// Noise that is known at a surfel.
struct KnownNoise {
    // Unit direction from the sensor, along which the noise acts, view space.
    ray: vec3f,
    // Standard deviation in world units; 0 if unknown.
    noise: f32,
}

// Noise that is known at a position in view space; `point` is the index in the cloud.
fn known_at(place: vec3f, point: u32) -> KnownNoise {
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
    // A sensor does not see points at its own place or behind it.
    if run.factor > 0.0 && depth > 0.0 {
        let noise = run.factor * select(pow(depth, run.power), 1.0, run.power == 0.0);
        return KnownNoise(normalize(from_sensor), noise);
    }
    return KnownNoise();
}

// Noise that is known, if it exceeds the measured noise.
fn known_beyond(measured_noise: f32, place: vec3f, point: u32) -> KnownNoise {
    let known = known_at(place, point);
    if known.noise > measured_noise {
        return known;
    }
    return KnownNoise();
}
