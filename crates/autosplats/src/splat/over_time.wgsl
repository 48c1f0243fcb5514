// Draws surfels towards the surface that the last frame showed. The CPU form, `over_time.rs`, says how.
//
// Reads: counters, surface (of the last frame: normals and depths). Reads and writes: surfels.

#import frame
#import groups
#import counters
#import surfel
#import reproject

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> surface: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> surfels: array<Surfel>;

// 0: the active points; 1: the recovered ones, which follow them.
override ROUND: u32;
override NEAR: f32;
override ALIKE: f32;

@compute @workgroup_size(64)
fn over_time(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = select(0u, counters[ACTIVE], ROUND == 1u);
    let len = counters[select(ACTIVE, RECOVERED, ROUND == 1u)];
    let index = group_index(workgroup) * 64u + local;
    if index >= len || !has_past() {
        return;
    }
    let place = first + index;
    let surfel = surfels[place];
    let position = past_position(surfel.center);
    let pixel = past_pixel(position);
    if pixel == NO_PIXEL || !is_finite(surface[pixel].w) {
        return;
    }
    let seen = surface[pixel];
    let distance = dot(seen.xyz, position - past_unproject(pixel, seen.w));
    let turned = transpose(frame.past_rotation) * seen.xyz;
    let facing = dot(turned, surfel.normal);
    if !(abs(distance) <= NEAR * surfel.k_radius && abs(facing) >= ALIKE && surfel.radius > 0.0) {
        return;
    }
    let before = turned * sign(facing);
    let center = surfel.center - frame.smoothing * distance * turned;
    let normal = turned_to_eye(normalize(surfel.normal + frame.smoothing * (before - surfel.normal)), center);
    surfels[place].normal = normal;
    surfels[place].major_axis = normalize(surfel.major_axis - normal * dot(normal, surfel.major_axis));
    let middle = to_pixel(center);
    // A centre beside the picture has no pixel to be hidden at.
    if center.z > frame.near && all(middle >= vec2f(0.0)) && all(middle < vec2f(frame.size)) {
        let own = vec2u(middle);
        surfels[place].center = center;
        surfels[place].pixel = (own.y << 16u) | own.x;
    }
}
