// Windows: rectangles of the screen, and the screen points in them. Imports: frame. The including pass binds `cell_start`.

// Added to projected bounds in pixels, against the rounding of projected coordinates.
override MARGIN_PX: f32;

// Strips that the invocation has gone through and half of the screen points it has read, two at a time: about the rounds of its
// loops, of which software devices end an invocation silently after 65535.
var<private> rounds: u32;

// Pixels, all sides included; whole numbers.
struct Window {
    low: vec2f,
    high: vec2f,
}

// The window of the whole picture.
fn picture() -> Window {
    return Window(vec2f(0.0), vec2f(frame.size) - 1.0);
}

// Slopes of the two lines through the eye that touch the circle of `radius` about (x, z), which lies in front of it.
fn tangents(x: f32, z: f32, radius: f32) -> vec2f {
    let length = sqrt(max(x * x + z * z - radius * radius, 0.0));
    return vec2f(
        (x * length - radius * z) / (z * length + radius * x),
        (x * length + radius * z) / (z * length - radius * x),
    );
}

// Where points within `radius` of `center` (view space) can be.
fn window_of_sphere(center: vec3f, radius: f32) -> Window {
    var x = vec2f(center.x - radius, center.x + radius);
    var y = vec2f(center.y - radius, center.y + radius);
    if frame.perspective == 1u {
        // A sphere around the eye's plane projects everywhere.
        if !(center.z > 1.0001 * radius) {
            return picture();
        }
        x = tangents(center.x, center.z, radius);
        y = tangents(center.y, center.z, radius);
    }
    let middle = 0.5 * vec2f(frame.size);
    let low = floor(vec2f(x.x, y.x) * frame.focal_px + middle - MARGIN_PX);
    let high = floor(vec2f(x.y, y.y) * frame.focal_px + middle + MARGIN_PX);
    let all = picture();
    return Window(select(all.low, low, low > all.low), select(all.high, high, high < all.high));
}

// The window grown to what is read anyway: whole strips.
fn window_grown(window: Window, strip_px: f32) -> Window {
    let top = floor(window.low.y / strip_px) * strip_px;
    let bottom = floor(window.high.y / strip_px) * strip_px + strip_px - 1.0;
    return Window(vec2f(window.low.x, top), vec2f(window.high.x, min(bottom, picture().high.y)));
}

fn window_contains(outer: Window, inner: Window) -> bool {
    return all(outer.low <= inner.low) && all(outer.high >= inner.high);
}

// First and last strip of a window.
fn window_strips(window: Window, strip_px: u32) -> vec2u {
    return vec2u(u32(window.low.y), u32(window.high.y)) / strip_px;
}

// The screen points of a strip that lie in a window: from x on, below y. They are contiguous.
fn window_run(window: Window, strip: u32) -> vec2u {
    let row = strip * frame.size.x;
    return vec2u(cell_start[row + u32(window.low.x)], cell_start[row + u32(window.high.x) + 1u]);
}

// Number of screen points in the window, or of its pixels where these are few.
fn window_len(window: Window, strip_px: u32, few: u32) -> u32 {
    let sides = window.high - window.low + 1.0;
    let area = u32(sides.x * sides.y);
    if area <= few {
        return area;
    }
    let strips = window_strips(window, strip_px);
    rounds += strips.y - strips.x + 1u;
    var len = 0u;
    for (var strip = strips.x; strip <= strips.y; strip++) {
        let run = window_run(window, strip);
        len += run.y - run.x;
    }
    return len;
}
