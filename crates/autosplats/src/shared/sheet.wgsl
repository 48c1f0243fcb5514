// Quadrics that the surfels around share: see the CPU form, which has `bend` as a matrix. Imports: orthonormal.

#import orthonormal

// Most sheets of a cell.
const SHEETS = 4u;

// In place of the radius: no sheet, as nobody has asked for any yet, or as none was found.
const UNKNOWN = 0.0;
const NONE = -1.0;

// An upright quadric over the balls that it was fitted to.
struct Sheet {
    center: vec3f,
    // Of the quadric.
    radius: f32,
    // Unit normal at the centre, and direction of the heights.
    axis: vec3f,
    // At the centre; radii, as `bend`.
    height: f32,
    bend: vec3f,
    // Standard error of its normal, radians.
    error: f32,
    curvature: f32,
    // Standard deviation of points from it, world units.
    scatter: f32,
    // How much it counts beside others, by its error and its scatter.
    trust: f32,
}

// Where a place is over a sheet.
struct Over {
    u: vec3f,
    v: vec3f,
    // Along `u` and `v`, in radii.
    at: vec2f,
    // Of the sheet above the place, along its axis; world units.
    height: f32,
    // 1 above the ball's centre, 0 at its border, negative beyond.
    near: f32,
}

fn under(sheet: Sheet, place: vec3f) -> Over {
    let u = any_orthonormal(sheet.axis);
    let v = cross(sheet.axis, u);
    let offset = (place - sheet.center) * (1.0 / sheet.radius);
    let x = dot(u, offset);
    let y = dot(v, offset);
    let along_x = x * (sheet.bend.x * x + sheet.bend.y * y);
    let along_y = y * (sheet.bend.z * y);
    let height = (sheet.height + along_x + along_y - dot(sheet.axis, offset)) * sheet.radius;
    return Over(u, v, vec2f(x, y), height, 1.0 - (x * x + y * y));
}

// Unit normal.
fn sheet_normal(sheet: Sheet, over: Over) -> vec3f {
    let slope_x = 2.0 * sheet.bend.x * over.at.x + sheet.bend.y * over.at.y;
    let slope_y = 2.0 * sheet.bend.z * over.at.y + sheet.bend.y * over.at.x;
    return normalize(sheet.axis - over.u * slope_x - over.v * slope_y);
}
