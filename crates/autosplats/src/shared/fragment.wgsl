// A splat's depth, pixel by pixel. Imports: frame, splat, depth_map. The including pass binds `depth_map` as atomics.

override DOT_RADIUS_PX: f32;

// Key of no depth: behind everything.
const NO_DEPTH = 0xffffffffu;

// The depth of a splat, pushed back by ε, at a pixel, as a key. The same sums as where splats are drawn by the patch.
fn pushed_depth(splat: Splat, pixel: vec2u) -> u32 {
    let dx = f32(pixel.x) + 0.5 - splat.center_px.x;
    let dy = f32(pixel.y) + 0.5 - splat.center_px.y;
    let start = select(splat.depth, 1.0 / splat.depth, frame.perspective == 1u);
    let plane = (start + splat.plane.y * dy) + splat.plane.x * dx;
    var u = splat.u.y * dy + splat.u.x * dx;
    var v = splat.v.y * dy + splat.v.x * dx;
    var depth = plane;
    if frame.perspective == 1u {
        depth = 1.0 / plane;
        u *= depth;
        v *= depth;
    }
    let disc = u * u + v * v;
    let dot = (dx * dx + dy * dy) * (1.0 / (DOT_RADIUS_PX * DOT_RADIUS_PX));
    if select(dot, disc, disc < dot) <= 1.0 {
        // The dot reaches beyond the disc, where its plane is of no use.
        let hit = min(max(depth, splat.depth - splat.depth_reach), splat.depth + splat.depth_reach);
        return depth_key(hit + splat.epsilon);
    }
    return NO_DEPTH;
}

fn draw_depth(splat: Splat, pixel: vec2u) {
    let key = pushed_depth(splat, pixel);
    let at = pixel.y * frame.size.x + pixel.x;
    // Most splats lose; a plain load tells them so.
    if key != NO_DEPTH && key < atomicLoad(&depth_map[at]) {
        atomicMin(&depth_map[at], key);
    }
}
