// Sheets, quadrics shared by neighbouring surfels: see the CPU form, where `bend` is a matrix. See
// docs/decisions/0007-shared-sheets.md.

#import orthonormal

// Values in place of the radius: the sheet is not requested yet, or there is none.
const UNKNOWN = 0.0;
const NONE = -1.0;

// Surfels that ask for the sheets of a cell.
struct Asked {
    count: u32,
    // Sum of their k-radii, in `K_RADIUS_PARTS_PER_PX` of a pixel.
    k_radii: u32,
    // Smallest point index.
    point: u32,
}

// An upright quadric and the extent of the balls that it was fitted to.
struct Sheet {
    center: vec3f,
    // Radius of the quadric in world units.
    radius: f32,
    // Unit normal at the centre, and direction of the heights.
    axis: vec3f,
    // Height at the centre, in radii, as is `bend`.
    height: f32,
    bend: vec3f,
    // Standard error of the normal, radians.
    error: f32,
    curvature: f32,
    // Standard deviation of points from the sheet, world units.
    scatter: f32,
    // Weight among other sheets, from error and scatter.
    trust: f32,
}

// A position relative to a sheet.
struct SheetPosition {
    u: vec3f,
    v: vec3f,
    // Coordinates along `u` and `v`, in radii.
    at: vec2f,
    // Height of the sheet above the position along its axis, world units.
    height: f32,
    // 1 on the ball's axis, 0 at its border, negative beyond.
    near: f32,
}

fn under(sheet: Sheet, place: vec3f) -> SheetPosition {
    let u = any_orthonormal(sheet.axis);
    let v = cross(sheet.axis, u);
    let offset = (place - sheet.center) * (1.0 / sheet.radius);
    let x = dot(u, offset);
    let y = dot(v, offset);
    let along_x = x * (sheet.bend.x * x + sheet.bend.y * y);
    let along_y = y * (sheet.bend.z * y);
    let height = (sheet.height + along_x + along_y - dot(sheet.axis, offset)) * sheet.radius;
    return SheetPosition(u, v, vec2f(x, y), height, 1.0 - (x * x + y * y));
}

// Unit normal of the sheet at the position.
fn sheet_normal(sheet: Sheet, over: SheetPosition) -> vec3f {
    let slope_x = 2.0 * sheet.bend.x * over.at.x + sheet.bend.y * over.at.y;
    let slope_y = 2.0 * sheet.bend.z * over.at.y + sheet.bend.y * over.at.x;
    return normalize(sheet.axis - over.u * slope_x - over.v * slope_y);
}
