// Splats, and the tree by which pixels find them. The including pass binds `tree`.
//
// Surfels are in cell order, so that successive ones lie close together on the screen. The tree has the bounds of each
// splat and of each 16, 256 and 4096 successive ones. This needs no sorting, bins or capacity.

// A surfel ready to be drawn: like the CPU form, but with its bounds in the tree.
struct Splat {
    // Projected centre in pixels.
    center_px: vec2f,
    // Gradient per pixel of the inverse depth (perspective) or of the depth (orthographic).
    plane: vec2f,
    // Gradients of the two disc coordinates, divided by depth in perspective. The disc is where u² + v² ≤ 1.
    u: vec2f,
    v: vec2f,
    // Depth of the centre.
    depth: f32,
    // ε in world units.
    epsilon: f32,
    // Largest difference in depth between the disc and its centre.
    depth_reach: f32,
    // Pixel of the point: column in the low, row in the high 16 bits.
    pixel: u32,
}

// Levels.
const SPLATS = 0u;
const LEAVES = 1u;
const RUNS = 2u;
const TOP = 3u;
// Flag in the first column of bounds that are not drawn. No column is that large.
const DEAD = 0x8000u;

// Start of a level in `tree`, the top one first. The number of splats is at index 0.
fn level_start(level: u32) -> u32 {
    let tops = (arrayLength(&tree) - 1u) / TOP_NODES;
    let nodes_before = select(select(select(0u, 1u, level == RUNS), 17u, level == LEAVES), 273u, level == SPLATS);
    return 1u + nodes_before * tops;
}

// First columns and rows of bounds are in the low 16 bits, the last ones, included, in the high 16 bits.
fn firsts(bounds: vec2u) -> vec2u {
    return bounds & vec2u(0xffffu);
}

fn lasts(bounds: vec2u) -> vec2u {
    return bounds >> vec2u(16u);
}

// Whether bounds are empty or dead.
fn is_empty(bounds: vec2u) -> bool {
    return any(firsts(bounds) > lasts(bounds));
}

// Bounds of a dead splat without the flag.
fn living_bounds(bounds: vec2u) -> vec2u {
    return vec2u(bounds.x & ~DEAD, bounds.y);
}

// Number of rows of bounds that are not empty.
fn rows_of(bounds: vec2u) -> u32 {
    return lasts(bounds).y - firsts(bounds).y + 1u;
}

// Number of pixels of bounds that are not empty.
fn bounds_area(bounds: vec2u) -> u32 {
    let sides = lasts(bounds) - firsts(bounds) + 1u;
    return sides.x * sides.y;
}
