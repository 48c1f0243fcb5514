// A splat's depth, pixel by pixel. The including pass binds `depth_map` as atomics.

#import frame
#import depth_map
#import splat

// Key of no depth, behind everything.
const NO_DEPTH = 0xffffffffu;

// A row of pixels of a splat: the values that are constant along the row.
struct Line {
    row: u32,
    // Offset of the pixels' centres from the splat's centre.
    dy: f32,
    // The disc's plane and coordinates at the centre's column.
    plane: f32,
    u: f32,
    v: f32,
    // Nearest and furthest depth of the disc.
    nearest: f32,
    furthest: f32,
}

fn line_of(splat: Splat, row: u32) -> Line {
    let dy = f32(row) + 0.5 - splat.center_px.y;
    let start = select(splat.depth, 1.0 / splat.depth, frame.perspective == 1u);
    return Line(
        row,
        dy,
        start + splat.plane.y * dy,
        splat.u.y * dy,
        splat.v.y * dy,
        splat.depth - splat.depth_reach,
        splat.depth + splat.depth_reach,
    );
}

// First and last column of a splat in a row, with one more on either side for rounding. The first exceeds the last if
// the row is empty. A splat seen at an angle fills little of its bounds.
fn span_of(splat: Splat, line: Line, bounds: vec2u) -> vec2i {
    // The disc is where u² + v² <= w²; all three are linear along the row.
    let in_perspective = frame.perspective == 1u;
    let level = vec3f(line.u, line.v, select(1.0, line.plane, in_perspective));
    let slope = vec3f(splat.u.x, splat.v.x, select(0.0, splat.plane.x, in_perspective));
    let a = slope.x * slope.x + slope.y * slope.y - slope.z * slope.z;
    let b = slope.x * level.x + slope.y * level.y - slope.z * level.z;
    let c = level.x * level.x + level.y * level.y - level.z * level.z;
    let rounding = 1e-5 * (b * b + abs(a) * (level.x * level.x + level.y * level.y + level.z * level.z));
    let root = b * b - a * c + rounding;
    let reach = sqrt(max(root, 0.0));
    let none = !(root >= 0.0);
    let dot = select(-1.0, DOT_RADIUS_PX, abs(line.dy) <= DOT_RADIUS_PX);
    let low = min(select((-b - reach) / a, 1.0, none), -dot);
    let high = max(select((-b + reach) / a, -1.0, none), dot);
    let middle = splat.center_px.x - 0.5;
    let first = i32(firsts(bounds).x);
    let last = i32(lasts(bounds).x);
    // Where the disc has no end in the row or the result is NaN, the bounds are used.
    if !(a > 0.0) || !(high - low < 65536.0) {
        return vec2i(first, last);
    }
    return vec2i(max(first, i32(floor(middle + low)) - 1), min(last, i32(ceil(middle + high)) + 1));
}

// Key of a splat's depth at a pixel, pushed back by ε; NO_DEPTH outside the disc and the dot. `rim` is the squared
// distance at their rim. The sums equal those of `patch`.
fn pushed_depth(splat: Splat, line: Line, column: u32, rim: f32) -> u32 {
    let dx = f32(column) + 0.5 - splat.center_px.x;
    let plane = line.plane + splat.plane.x * dx;
    var u = line.u + splat.u.x * dx;
    var v = line.v + splat.v.x * dx;
    var depth = plane;
    if frame.perspective == 1u {
        depth = 1.0 / plane;
        u *= depth;
        v *= depth;
    }
    let disc = u * u + v * v;
    let dot = (dx * dx + line.dy * line.dy) * (1.0 / (DOT_RADIUS_PX * DOT_RADIUS_PX));
    // Below an inverse depth of zero, the disc's plane is hit behind the eye.
    let is_ahead = frame.perspective == 0u || plane >= 0.0;
    if select(dot, disc, is_ahead && disc < dot) <= rim {
        // The dot reaches beyond the disc, where the disc's plane is meaningless.
        let hit = min(max(depth, line.nearest), line.furthest);
        return depth_key(hit + splat.epsilon);
    }
    return NO_DEPTH;
}

fn draw_depth(splat: Splat, line: Line, column: u32) {
    let key = pushed_depth(splat, line, column, 1.0);
    let at = line.row * frame.size.x + column;
    // Most splats lose; a plain load shows this.
    if key != NO_DEPTH && key < atomicLoad(&depth_map[at]) {
        atomicMin(&depth_map[at], key);
    }
}
