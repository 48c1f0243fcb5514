// Averages surfels with the last frame. The CPU form is `points.rs` and `surfaces.rs`.
//
// Reads: counters, surface, halves, fitted (the last three of the last frame), points. Reads and writes: surfels.
// Writes: frames.

#import frame
#import fitted
#import groups
#import half
#import moved
#import reproject
#import screen
#import surfel

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> surface: array<vec4f>;
@group(0) @binding(3) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(4) var<storage, read> halves: array<u32>;
@group(0) @binding(5) var<storage, read> fitted: array<Fitted>;
@group(0) @binding(6) var<storage, read_write> surfels: array<Surfel>;
@group(0) @binding(7) var<storage, read_write> frames: array<f32>;

// Moves a surfel to `center` and turns it by `share` of the way towards `before`, a normal on the same side.
fn draw_to(place: u32, center: vec3f, before: vec3f, share: f32) {
    var surfel = surfels[place];
    let normal = turned_to_eye(normalize(surfel.normal + share * (before - surfel.normal)), center);
    surfel.normal = normal;
    surfel.major_axis = normalize(surfel.major_axis - normal * dot(normal, surfel.major_axis));
    surfels[place] = moved(surfel, center);
}

// Index plus 1 in `fitted` of the last frame's fit to the point of the cloud now at `point`; 0 if there is none.
fn place_then(source: u32, point: vec3f) -> u32 {
    let position = past_position(point);
    let at = past_place(position);
    if !was_inside(position, at) {
        return 0u;
    }
    let place = halves[half_at(vec2u(4.0 * at))];
    if place == 0u || fitted[place - 1u].source != source {
        return 0u;
    }
    return place;
}

// Averages a surfel. Returns the number of frames in its mean.
fn smoothed(place: u32) -> f32 {
    let surfel = surfels[place];
    if !has_past() || frame.frames_averaged == 1.0 || is_dropped(surfel) {
        return 1.0;
    }
    let back = transpose(frame.past_rotation);
    if frame.same_points == 1u {
        let point = points[screen_of(surfel)].position_view;
        let found = place_then(surfel.source, point);
        if found != 0u {
            let then = fitted[found - 1u];
            let normal = back * then.normal;
            let facing = dot(normal, surfel.normal);
            if abs(facing) >= MIN_SURFACE_COSINE {
                let count = min(then.frames + 1.0, frame.frames_averaged);
                let share = 1.0 - 1.0 / count;
                let moved = surfel.center + share * (point + back * then.offset - surfel.center);
                draw_to(place, moved, normal * sign(facing), share);
                return count;
            }
        }
        if all(point == surfel.center) {
            return 1.0;
        }
    }
    let position = past_position(surfel.center);
    let pixel = past_pixel(position);
    if pixel == NO_PIXEL || !is_finite(surface[pixel].w) {
        return 1.0;
    }
    let seen = surface[pixel];
    let distance = dot(seen.xyz, position - past_unproject(pixel, seen.w));
    let normal = back * seen.xyz;
    let facing = dot(normal, surfel.normal);
    if !(abs(distance) <= MAX_SURFACE_DISTANCE_RADII * surfel.k_radius && abs(facing) >= MIN_SURFACE_COSINE) {
        return 1.0;
    }
    let share = 1.0 - 1.0 / frame.frames_averaged;
    draw_to(place, surfel.center - share * distance * normal, normal * sign(facing), share);
    return frame.frames_averaged;
}

@compute @workgroup_size(SMALL_GROUP)
fn over_time(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = counters[ROUND_FIRST];
    let len = counters[ROUND_LEN];
    let index = group_index(workgroup) * SMALL_GROUP + local;
    if index < len {
        frames[first + index] = smoothed(first + index);
    }
}
