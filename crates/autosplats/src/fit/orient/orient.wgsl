// Marks the surfels that show the side that their sensor did not see. The CPU form, `mod.rs`, explains the rule.
//
// Reads: counters, sensors. Reads and writes: surfels.

#import frame
#import groups
#import surfel

// Position of the sensor of a run of points.
struct Sensor {
    // Position about the cloud's origin; infinite if unknown.
    position: vec3f,
    // Index of the first point of the run.
    first: u32,
}

@group(0) @binding(1) var<storage, read> counters: array<u32>;
// Runs of points, in the order of the points. The first begins at point 0.
@group(0) @binding(2) var<storage, read> sensors: array<Sensor>;
@group(0) @binding(3) var<storage, read_write> surfels: array<Surfel>;

// The sensor of a point.
fn sensor_of(point: u32) -> vec3f {
    var low = 0u;
    var high = arrayLength(&sensors);
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if sensors[middle].first <= point {
            low = middle;
        } else {
            high = middle;
        }
    }
    return sensors[low].position;
}

fn is_seen_from_behind(surfel: Surfel, sensor: vec3f) -> bool {
    let eye = to_eye(surfel.center);
    let to_sensor = to_view(sensor) - surfel.center;
    // Thickness of the neighbourhood over its width: about the tangent of the normal's error angle.
    let rough = sqrt(2.0 * surfel.curvature);
    return dot(surfel.normal, to_sensor) < -max(rough, MIN_SENSOR_COSINE) * length(to_sensor)
        && dot(surfel.normal, eye) > max(rough, MIN_EYE_COSINE) * length(eye);
}

@compute @workgroup_size(SMALL_GROUP)
fn orient(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = counters[ROUND_FIRST];
    let len = counters[ROUND_LEN];
    let index = group_index(workgroup) * SMALL_GROUP + local;
    if index >= len {
        return;
    }
    let place = first + index;
    let sensor = sensor_of(surfels[place].source);
    if is_finite(sensor.x) && is_seen_from_behind(surfels[place], sensor) {
        surfels[place].screen_and_flags |= BACK;
    }
}
