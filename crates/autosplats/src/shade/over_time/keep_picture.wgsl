// Keeps the picture and its depths for the next one.
//
// Reads: surface, image. Writes: past_depths, past_image.

#import frame
#import divide
#import groups
#import picture

@group(0) @binding(1) var<storage, read> surface: array<vec4f>;
@group(0) @binding(2) var<storage, read> image: array<u32>;
@group(0) @binding(3) var<storage, read_write> past_depths: array<f32>;
@group(0) @binding(4) var<storage, read_write> past_image: array<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn keep_picture(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let width = frame.picture.x;
    let at = group_index(workgroup) * LARGE_GROUP + local;
    let pixel = divide(at, width).yx;
    if pixel.y >= frame.picture.y {
        return;
    }
    let pitch = (width + ROW_PIXELS - 1u) / ROW_PIXELS * ROW_PIXELS;
    past_depths[at] = surface[screen_index(pixel)].w;
    past_image[at] = image[pixel.y * pitch + pixel.x];
}
