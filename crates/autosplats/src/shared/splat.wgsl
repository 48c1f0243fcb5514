// Splats, and the tree by which the pixels find them. Imports: frame. The including pass binds `tree`.
//
// Surfels are in screen-cell order, so that any 64 in a row are a small patch of the screen. The tree has the bounds of
// each splat; of each run of 64 splats; and of each 64 runs. No sorting, no bins, no capacity.

// A surfel ready to be drawn: the CPU form's, but for its bounds, which are in the tree.
struct Splat {
    // Projected centre in pixels.
    center_px: vec2f,
    // Gradient of inverse depth (perspective) or depth (orthographic) per pixel.
    plane: vec2f,
    // Gradients of the two disc coordinates, divided by depth in perspective; the disc is where u² + v² ≤ 1.
    u: vec2f,
    v: vec2f,
    // Depth of the centre.
    depth: f32,
    // ε in world units.
    epsilon: f32,
    // Furthest that the disc's depth is from the centre's.
    depth_reach: f32,
    // Pixel of the point: column in the low, row in the high 16 bits.
    pixel: u32,
}

// Children of a node.
const FAN = 64u;
// Nodes below and including one whose children are runs: 1 + 64 + 64².
const FAMILY = 4161u;
// Levels.
const SPLATS = 0u;
const RUNS = 1u;
const RUNS_OF_RUNS = 2u;
// Set in the first column of bounds that are not drawn now: none is so far right.
const DEAD = 0x8000u;

// Where in `tree` a level begins. The first element are the first and the end of the splats to be drawn.
fn level_start(level: u32) -> u32 {
    let families = (arrayLength(&tree) - 1u) / FAMILY;
    return select(select(1u + families, 1u + families * (FAN + 1u), level == SPLATS), 1u, level == RUNS_OF_RUNS);
}

// Columns and rows of bounds, first in the low, last in the high 16 bits, both included.
fn firsts(bounds: vec2u) -> vec2u {
    return bounds & vec2u(0xffffu);
}

fn lasts(bounds: vec2u) -> vec2u {
    return bounds >> vec2u(16u);
}

// Whether it is empty, or dead.
fn is_empty(bounds: vec2u) -> bool {
    return any(firsts(bounds) > lasts(bounds));
}
