// Keeps the fit to each point for the next frame, which finds it by the half of a pixel that the point lies in.
//
// Reads: counters, points, surfels, frames. Writes: fitted, halves (cleared to 0 first).

#import frame
#import fitted
#import groups
#import half
#import screen
#import surfel

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(3) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(4) var<storage, read> frames: array<f32>;
@group(0) @binding(5) var<storage, read_write> fitted: array<Fitted>;
@group(0) @binding(6) var<storage, read_write> halves: array<atomic<u32>>;

@compute @workgroup_size(LARGE_GROUP)
fn keep_fitted(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if index >= counters[ACTIVE] + counters[RECOVERED] {
        return;
    }
    let surfel = surfels[index];
    let point = points[screen_of(surfel)].position_view;
    fitted[index] = Fitted(surfel.center - point, surfel.source, surfel.normal, frames[index]);
    let at = to_pixel(point);
    if !is_dropped(surfel) && !is_near(surfel) && all(at >= vec2f(0.0)) && all(at < vec2f(frame.size)) {
        // Rounding may put two points into one half. The maximum always keeps the same one.
        atomicMax(&halves[half_at(vec2u(4.0 * at))], index + 1u);
    }
}
