// Splat set-up: makes surfels ready to be drawn over their pixels. The CPU form is `setup.rs`. Adds the centre of each
// splat to its pixel, for the trim: `centers.rs`.
//
// Reads: surfels. Reads and writes: counters, centers. Writes: splats, tree, large.

#import frame
#import groups
#import screen
#import splat
#import surfel

@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(3) var<storage, read_write> splats: array<Splat>;
@group(0) @binding(4) var<storage, read_write> tree: array<vec2u>;
// Splats too large for one workgroup, in any order.
@group(0) @binding(5) var<storage, read_write> large: array<u32>;
@group(0) @binding(6) var<storage, read_write> centers: array<atomic<u32>>;

// Empty bounds: the first pixel lies beyond all, the last is 0.
const NOWHERE = 0x7fffu;

@compute @workgroup_size(LARGE_GROUP)
fn set_up(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let at = group_index(workgroup) * LARGE_GROUP + local;
    if at >= atomicLoad(&counters[ROUND_LEN]) {
        return;
    }
    let index = atomicLoad(&counters[ROUND_FIRST]) + at;
    let surfel = surfels[index];
    let c = vec3f(surfel.center.xy, center_depth(surfel.center));
    let n = surfel.normal;
    let a = surfel.major_axis;
    let b = vec3f(n.y * a.z - n.z * a.y, n.z * a.x - n.x * a.z, n.x * a.y - n.y * a.x);
    let perspective = frame.perspective == 1u;
    let minor = SUPPORT * surfel.radius;
    let major = minor * surfel.major_ratio;
    let place = level_start(SPLATS) + index;
    if !(minor > 0.0) {
        tree[place] = vec2u(NOWHERE);
        return;
    }

    let focal = frame.focal_px;
    let a_scale = 1.0 / (focal * major);
    let b_scale = 1.0 / (focal * minor);
    // How much the disc faces the line of sight, and the shear of each axis along that line.
    var facing = n.z;
    var least_facing = MIN_FACING_COSINE;
    var along = vec2f(a.z, b.z);
    var plane = vec2f(-n.x, -n.y);
    if perspective {
        facing = n.x * c.x + n.y * c.y + n.z * c.z;
        least_facing = MIN_FACING_COSINE * sqrt(c.x * c.x + c.y * c.y + c.z * c.z);
        along = vec2f(a.x * c.x + a.y * c.y + a.z * c.z, b.x * c.x + b.y * c.y + b.z * c.z);
        plane = vec2f(n.x, n.y);
    }
    plane = plane / (focal * facing);
    let shear = along / facing;
    var u = vec2f((a.x - n.x * shear.x) * a_scale, (a.y - n.y * shear.x) * a_scale);
    var v = vec2f((b.x - n.x * shear.y) * b_scale, (b.y - n.y * shear.y) * b_scale);
    if !(abs(facing) > least_facing) {
        // A disc seen from its edge is drawn as the dot alone.
        let per_dot = 1.0 / (DOT_RADIUS_PX * select(1.0, c.z, perspective));
        plane = vec2f(0.0);
        u = vec2f(per_dot, 0.0);
        v = vec2f(0.0, per_dot);
    }

    let axis_a = a * major;
    let axis_b = b * minor;
    let center_px = to_pixel(c);
    let across = vec2f(axis_a.z, axis_b.z);
    let depth_reach = sqrt(across.x * across.x + across.y * across.y);
    if perspective && !(c.z > 0.0) {
        // A disc has no sides on a line of sight whose other end meets its centre.
        let is_opposite = all(center_px > vec2f(-1.0)) && all(center_px < vec2f(frame.size) + 1.0);
        if is_opposite || !(c.z + depth_reach > 0.0) {
            tree[place] = vec2u(NOWHERE);
            return;
        }
    }
    let x = extent(c.x, c.z, vec2f(axis_a.x, axis_b.x), across, center_px.x, frame.size.x, frame.middle.x);
    let y = extent(c.y, c.z, vec2f(axis_a.y, axis_b.y), across, center_px.y, frame.size.y, frame.middle.y);
    let bounds = vec2u(x, y);
    tree[place] = bounds;
    if !is_empty(bounds) {
        if bounds_area(bounds) > MAX_GROUP_PX {
            large[atomicAdd(&counters[LARGE], 1u)] = index;
        }
        add_center(center_px, surfel.pixel);
    }
    let epsilon = EPSILON_RADII * surfel.radius;
    splats[index] = Splat(center_px, plane, u, v, c.z, epsilon, depth_reach, surfel.pixel);
}

fn add_center(center_px: vec2f, of_pixel: u32) {
    if has_near_flag(of_pixel) {
        // The pixel need not be that of the centre.
        return;
    }
    let pixel = pixel_xy(of_pixel);
    let place = vec2u(clamp(CENTER_STEPS * (center_px - vec2f(pixel)), vec2f(0.0), vec2f(CENTER_STEPS - 1.0)));
    atomicAdd(&centers[pixel.y * frame.size.x + pixel.x], (1u << 24u) | (place.y << 12u) | place.x);
}

// Depth of a disc's centre, moved off the plane of the eye.
fn center_depth(center: vec3f) -> f32 {
    let least = MIN_DEPTH_SHARE * sqrt(center.x * center.x + center.y * center.y + center.z * center.z);
    if frame.perspective == 1u && abs(center.z) < least {
        return select(least, -least, (bitcast<u32>(center.z) >> 31u) == 1u);
    }
    return center.z;
}

// Range of slopes of the part of an ellipse in front of the eye: see the CPU form. Places are an offset aside and a
// depth.
fn front_extent(tangents: vec2f, c: vec2f, a: vec2f, b: vec2f) -> vec2f {
    var range = vec2f(-infinity(), infinity());
    for (var side = 0u; side < 2u; side++) {
        let slope = tangents[side];
        let away = c.x - slope * c.y;
        let touched = c.y - (a.y * (a.x - slope * a.y) + b.y * (b.x - slope * b.y)) / away;
        if touched > 0.0 {
            range[u32(away < 0.0)] = slope;
        }
    }
    return range;
}

// First and last pixel along an axis whose centre the disc or its dot may cover. `axes` are the coordinates of the
// disc's axes along that axis, `across` their depths.
fn extent(c: f32, cz: f32, axes: vec2f, across: vec2f, center_px: f32, size: u32, middle: f32) -> u32 {
    let squared = axes.x * axes.x + axes.y * axes.y;
    var low: f32;
    var high: f32;
    if frame.perspective == 1u {
        // The lines of sight s = x/z that touch the ellipse c + a·cos + b·sin: (c - s·cz)² = (a - s·az)² + (b - s·bz)².
        let qa = cz * cz - across.x * across.x - across.y * across.y;
        let qb = c * cz - axes.x * across.x - axes.y * across.y;
        let qc = c * c - squared;
        let square = qb * qb - qa * qc;
        let root = sqrt(max(square, 0.0));
        low = (qb - root) / qa;
        high = (qb + root) / qa;
        if qa <= 0.0 || cz <= 0.0 {
            // The disc meets the plane of the eye. It ends at the lines of sight that touch it in front of the eye.
            var range = vec2f(-infinity(), infinity());
            if square > 0.0 {
                range = front_extent(vec2f(low, high), vec2f(c, cz), vec2f(axes.x, across.x), vec2f(axes.y, across.y));
            }
            low = range.x;
            high = range.y;
        }
    } else {
        let reach = sqrt(squared);
        low = c - reach;
        high = c + reach;
    }
    low = low * frame.focal_px + middle;
    high = high * frame.focal_px + middle;
    // A centre behind the eye has no dot.
    if cz > 0.0 || frame.perspective == 0u {
        low = min(low, center_px - DOT_RADIUS_PX);
        high = max(high, center_px + DOT_RADIUS_PX);
    }
    // Pixel i is covered if its centre i + ½ lies within.
    let first = max(ceil(low - 0.5), 0.0);
    let last = min(floor(high - 0.5), f32(size) - 1.0);
    if first <= last {
        return u32(first) | (u32(last) << 16u);
    }
    return NOWHERE;
}
