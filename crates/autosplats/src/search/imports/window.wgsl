// Windows: rectangles of the screen.

#import frame

// First and last pixels, both included; whole numbers.
struct Window {
    low: vec2f,
    high: vec2f,
}

// The window of the whole screen.
fn picture() -> Window {
    return Window(vec2f(0.0), vec2f(frame.size) - 1.0);
}

// Slopes of the two lines through the eye that touch the circle of `radius` about (x, z), which lies in front of the
// eye.
fn tangents(x: f32, z: f32, radius: f32) -> vec2f {
    let length = sqrt(max(x * x + z * z - radius * radius, 0.0));
    return vec2f(
        (x * length - radius * z) / (z * length + radius * x),
        (x * length + radius * z) / (z * length - radius * x),
    );
}

// Window that contains all points within `radius` of `center` (view space).
fn window_of_sphere(center: vec3f, radius: f32) -> Window {
    var x = vec2f(center.x - radius, center.x + radius);
    var y = vec2f(center.y - radius, center.y + radius);
    if frame.perspective == 1u {
        // A sphere that meets the eye's plane projects everywhere.
        if !(center.z > 1.0001 * radius) {
            return picture();
        }
        x = tangents(center.x, center.z, radius);
        y = tangents(center.y, center.z, radius);
    }
    let middle = frame.middle;
    let low = floor(vec2f(x.x, y.x) * frame.focal_px + middle - MARGIN_PX);
    let high = floor(vec2f(x.y, y.y) * frame.focal_px + middle + MARGIN_PX);
    let all = picture();
    return Window(select(all.low, low, low > all.low), select(all.high, high, high < all.high));
}
