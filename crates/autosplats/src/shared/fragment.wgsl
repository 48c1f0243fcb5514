// A splat's depth, pixel by pixel. Imports: frame, splat, depth_map. The including pass binds `depth_map` as atomics.

override DOT_RADIUS_PX: f32;

// Key of no depth: behind everything.
const NO_DEPTH = 0xffffffffu;

// First and last column of a splat in a row, with one more to either side for rounding; the first is the greater one if it has
// none. A splat seen at an angle fills little of its bounds.
fn row_span(splat: Splat, bounds: vec2u, row: u32) -> vec2i {
    let dy = f32(row) + 0.5 - splat.center_px.y;
    // The disc is where u² + v² <= w², all three of them linear along the row.
    let in_perspective = frame.perspective == 1u;
    let at_center = vec3f(
        splat.u.y * dy,
        splat.v.y * dy,
        select(1.0, 1.0 / splat.depth + splat.plane.y * dy, in_perspective),
    );
    let slope = vec3f(splat.u.x, splat.v.x, select(0.0, splat.plane.x, in_perspective));
    let a = slope.x * slope.x + slope.y * slope.y - slope.z * slope.z;
    let b = slope.x * at_center.x + slope.y * at_center.y - slope.z * at_center.z;
    let c = at_center.x * at_center.x + at_center.y * at_center.y - at_center.z * at_center.z;
    let rounding = 1e-5 * (b * b + abs(a) * (at_center.x * at_center.x + at_center.y * at_center.y + at_center.z * at_center.z));
    let root = b * b - a * c + rounding;
    let reach = sqrt(max(root, 0.0));
    var low = (-b - reach) / a;
    var high = (-b + reach) / a;
    let dot = select(-1.0, DOT_RADIUS_PX, abs(dy) <= DOT_RADIUS_PX);
    if !(root >= 0.0) {
        low = 1.0;
        high = -1.0;
    }
    low = min(low, -dot);
    high = max(high, dot);
    let middle = splat.center_px.x - 0.5;
    let first = i32(firsts(bounds).x);
    let last = i32(lasts(bounds).x);
    // Where the disc has no end in the row, or it is not a number, the bounds have to do.
    if !(a > 0.0) || !(high - low < 65536.0) {
        return vec2i(first, last);
    }
    return vec2i(max(first, i32(floor(middle + low)) - 1), min(last, i32(ceil(middle + high)) + 1));
}

// The depth of a splat, pushed back by ε, at a pixel, as a key; NO_DEPTH outside the disc and the dot, whose rim is where their
// squared distances are `rim`. The same sums as where splats are drawn by the patch.
fn pushed_depth(splat: Splat, pixel: vec2u, rim: f32) -> u32 {
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
    if select(dot, disc, disc < dot) <= rim {
        // The dot reaches beyond the disc, where its plane is of no use.
        let hit = min(max(depth, splat.depth - splat.depth_reach), splat.depth + splat.depth_reach);
        return depth_key(hit + splat.epsilon);
    }
    return NO_DEPTH;
}

fn draw_depth(splat: Splat, pixel: vec2u) {
    let key = pushed_depth(splat, pixel, 1.0);
    let at = pixel.y * frame.size.x + pixel.x;
    // Most splats lose; a plain load tells them so.
    if key != NO_DEPTH && key < atomicLoad(&depth_map[at]) {
        atomicMin(&depth_map[at], key);
    }
}
