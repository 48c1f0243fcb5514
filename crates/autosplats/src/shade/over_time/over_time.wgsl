// Averages the picture with the last one where both show the same surface. The CPU form is `mod.rs`.
//
// Reads: surface, past_depths, past_image, tables. Reads and writes: image.

#import frame
#import divide
#import groups
#import picture
#import reproject
#import srgb

@group(0) @binding(1) var<storage, read> surface: array<vec4f>;
@group(0) @binding(2) var<storage, read> past_depths: array<f32>;
@group(0) @binding(3) var<storage, read> past_image: array<u32>;
// Table from linear light to sRGB, four steps to a word.
@group(0) @binding(4) var<storage, read> tables: array<u32>;
@group(0) @binding(5) var<storage, read_write> image: array<u32>;

// A pixel's channels in linear light.
fn linear_of(rgba: u32) -> vec3f {
    return from_srgb(unpack4x8unorm(rgba).xyz);
}

@compute @workgroup_size(LARGE_GROUP)
fn over_time(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let width = frame.picture.x;
    let pixel = divide(group_index(workgroup) * LARGE_GROUP + local, width).yx;
    if pixel.y >= frame.picture.y || frame.same_picture == 0u || !has_past() {
        return;
    }
    let depth = surface[screen_index(pixel)].w;
    if !is_finite(depth) {
        return;
    }
    let position = past_position(unproject(vec2f(pixel + margin()) + 0.5, depth));
    let place = past_place(position) - f32(margin()) - 0.5;
    let inside = all(place >= vec2f(0.0)) && all(place < vec2f(frame.picture) - 1.0);
    if !(inside && position.z > frame.near) {
        return;
    }
    let first = vec2u(place);
    let part = place - floor(place);
    let unit = select(1.0 / frame.past_focal_px, position.z / frame.past_focal_px, frame.perspective == 1u);
    var sum = vec3f(0.0);
    var total = 0.0;
    for (var corner = 0u; corner < 4u; corner++) {
        let offset = vec2u(corner & 1u, corner >> 1u);
        let at = (first.y + offset.y) * width + first.x + offset.x;
        if abs(past_depths[at] - position.z) < MAX_SAME_DEPTH_PX * unit {
            let along = select(1.0 - part, part, offset == vec2u(1u));
            let weight = along.x * along.y;
            sum += weight * linear_of(past_image[at]);
            total += weight;
        }
    }
    if total < MIN_SEEN_WEIGHT {
        return;
    }
    let pitch = (width + ROW_PIXELS - 1u) / ROW_PIXELS * ROW_PIXELS;
    let word = image[pixel.y * pitch + pixel.x];
    let now = linear_of(word);
    let mean = now + PAST_SHARE * (sum / total - now);
    image[pixel.y * pitch + pixel.x] = encode_color(mean, ENCODE_STEPS) | (word & 0xff000000u);
}
