// Screen points in windows. The including pass binds `cell_start`.

#import frame
#import search_task
#import window

// Approximate number of loop rounds: strips visited, plus half the screen points read. Software devices end an
// invocation silently after 65535 rounds.
var<private> rounds: u32;

// The window grown to whole strips, which are read anyway.
fn window_grown(window: Window, strip_px: f32) -> Window {
    let top = floor(window.low.y / strip_px) * strip_px;
    let bottom = floor(window.high.y / strip_px) * strip_px + strip_px - 1.0;
    return Window(vec2f(window.low.x, top), vec2f(window.high.x, min(bottom, picture().high.y)));
}

fn window_contains(outer: Window, inner: Window) -> bool {
    return all(outer.low <= inner.low) && all(outer.high >= inner.high);
}

// The window of the points of sparse cells around the eye, among which near points have their neighbours. It lies
// beside the screen.
fn near_window() -> Window {
    return Window(vec2f(-1.0), vec2f(-1.0));
}

// First and last strip of a window.
fn window_strips(window: Window, strip_px: u32) -> vec2u {
    return vec2u(u32(max(window.low.y, 0.0)), u32(max(window.high.y, 0.0))) / strip_px;
}

// Screen points of a strip in the window's columns, which are contiguous: first index, and end.
fn window_run(window: Window, strip: u32) -> vec2u {
    if window.low.x < 0.0 {
        return vec2u(task.near_first, task.visible);
    }
    let row = strip * frame.size.x;
    return vec2u(cell_start[row + u32(window.low.x)], cell_start[row + u32(window.high.x) + 1u]);
}

// Number of screen points in the window, or an upper bound if that is at most `few`.
fn window_len(window: Window, strip_px: u32, few: u32) -> u32 {
    let sides = window.high - window.low + 1.0;
    let room = u32(sides.x * sides.y) << frame.halves;
    if room <= few {
        return room;
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
