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

var<private> own_center: vec2f;
var<private> nearest: f32;

fn load(slot: u32, index: u32) {}

fn draw(slot: u32) {
    let hit = fragment(slot, own_center);
    if hit.squared <= 1.0 {
        nearest = min(nearest, hit.depth + brushes[slot].epsilon);
    }
}

@compute @workgroup_size(64)
fn depth(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup);
    if index >= patches().x * patches().y {
        return;
    }
    let corner = PATCH * vec2u(index % patches().x, index / patches().x);
    let pixel = corner + vec2u(local % PATCH, local / PATCH);
    let first = tree[0].x;
    let at = pixel.y * frame.size.x + pixel.x;
    let inside = all(pixel < frame.size);
    own_center = vec2f(pixel) + 0.5;
    nearest = infinity();
    if inside && first > 0u {
        nearest = depth_map[at];
    }
    draw_patch(corner, local, first);
    if inside {
        depth_map[at] = nearest;
    }
}
