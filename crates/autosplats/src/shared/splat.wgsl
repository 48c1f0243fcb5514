// Splats, and the tree by which the pixels find them. Imports: frame. The including pass binds `tree`.
//
// Surfels are in screen-cell order, so that any few in a row are a small patch of the screen. The tree has the bounds of
// each splat, and of each 16, 256 and 4096 in a row. No sorting, no bins, no capacity.

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
const FAN = 16u;
const FAN_BITS = 4u;
// Nodes of a tree of 4096 splats.
const FAMILY = 4369u;
// Levels.
const SPLATS = 0u;
const LEAVES = 1u;
const RUNS = 2u;
const TOP = 3u;
// Set in the first column of bounds that are not drawn now: none is so far right.
const DEAD = 0x8000u;

// Where in `tree` a level begins, the top one first. Before it is the number of splats.
fn level_start(level: u32) -> u32 {
    let tops = (arrayLength(&tree) - 1u) / FAMILY;
    let nodes_before = select(select(select(0u, 1u, level == RUNS), 17u, level == LEAVES), 273u, level == SPLATS);
    return 1u + nodes_before * tops;
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

// The bounds of a splat that is dead as if it were not.
fn living_bounds(bounds: vec2u) -> vec2u {
    return vec2u(bounds.x & ~DEAD, bounds.y);
}

// Pixels of bounds that are not empty.
fn bounds_area(bounds: vec2u) -> u32 {
    let sides = lasts(bounds) - firsts(bounds) + 1u;
    return sides.x * sides.y;
}
