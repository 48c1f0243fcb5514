// Visibility pass: the nearest depth, pushed back by ε, of the splats that cover each pixel [Paper, §7].
//
// Reads: splats, tree. Reads and writes: depth_map. With recovered splats alone it adds to the map that is there.

#import frame
#import groups
#import splat
#import patch

@group(0) @binding(1) var<storage, read> splats: array<Splat>;
@group(0) @binding(2) var<storage, read> tree: array<vec2u>;
@group(0) @binding(3) var<storage, read_write> depth_map: array<f32>;

// Centres of the invocation's pixels.
var<private> own_x: f32;
var<private> own_y: vec4f;
var<private> nearest: vec4f;

fn load(slot: u32, index: u32) {}

fn draw(slot: u32) {
    let hit = fragments(slot, own_x, own_y);
    let pushed = min(nearest, hit.depth + brushes[slot].epsilon);
    nearest = select(nearest, pushed, hit.squared <= vec4f(1.0));
}

@compute @workgroup_size(64)
fn depth(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup);
    if index >= patches().x * patches().y {
        return;
    }
    let corner = PATCH * vec2u(index % patches().x, index / patches().x);
    let pixel = corner + own_offset(local);
    let first = tree[0].x;
    own_x = f32(pixel.x) + 0.5;
    own_y = f32(pixel.y) + vec4f(0.5, 1.5, 2.5, 3.5);
    nearest = vec4f(infinity());
    draw_patch(corner, local, first);
    write(pixel, nearest.x, first);
    write(pixel + vec2u(0u, 1u), nearest.y, first);
    write(pixel + vec2u(0u, 2u), nearest.z, first);
    write(pixel + vec2u(0u, 3u), nearest.w, first);
}

fn write(pixel: vec2u, drawn: f32, first: u32) {
    if all(pixel < frame.size) {
        let at = pixel.y * frame.size.x + pixel.x;
        // Without the first splats, it is added to what these drew.
        if first > 0u {
            depth_map[at] = min(depth_map[at], drawn);
        } else {
            depth_map[at] = drawn;
        }
    }
}
