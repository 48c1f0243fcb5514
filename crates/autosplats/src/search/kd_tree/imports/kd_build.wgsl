// Nodes of the kd-tree during its construction.

// A node of the current level that may have to be split.
struct KdLarge {
    node: u32,
    // Its run of points.
    first: u32,
    len: u32,
    // Index of its first chunk among those of the level's large nodes.
    first_chunk: u32,
    // Tight box of its points, as keys for atomic minima and maxima.
    low: vec3u,
    // Axis of the split at `plane`, 0 to 2, or `KD_FINITE_LEFT` or `KD_UNSPLIT`.
    axis: u32,
    high: vec3u,
    plane: f32,
    parent_len: u32,
    // Number of points in its left child.
    left: u32,
    // Indices of its large children in the list of the next level.
    next_left: u32,
    next_right: u32,
}

// Sizes and offsets of a large node in words.
const KD_LARGE_WORDS = 16u;
const KD_LOW_WORD = 4u;
const KD_HIGH_WORD = 8u;

// Split of the root: finite points go left.
const KD_FINITE_LEFT = 3u;
// No split.
const KD_UNSPLIT = 4u;
const KD_NONE = 0xffffffffu;
// Larger coordinates count as not finite, because their squares would overflow.
const KD_MAX_COORDINATE = 1e18;

// A node of few points, which one workgroup turns into a subtree.
struct KdSmall {
    node: u32,
    first: u32,
    len: u32,
    // Which of the two lists holds its points.
    list: u32,
}

struct KdState {
    // Number of levels split so far.
    level: u32,
    // Number of nodes made.
    nodes: u32,
    // Number of large nodes to be split, and of their chunks.
    large: u32,
    chunks: u32,
    small: u32,
    // Number of finite points.
    finite: u32,
}

fn kd_position(point: vec4u) -> vec3f {
    return bitcast<vec3f>(point.xyz);
}

fn kd_coordinate(position: vec3f, axis: u32) -> f32 {
    return select(select(position.z, position.y, axis == 1u), position.x, axis == 0u);
}

fn kd_goes_left(point: vec4u, axis: u32, plane: f32) -> bool {
    // Magnitudes have the order of their bits; those of NaN are above all others.
    let is_finite = all((point.xyz & vec3u(0x7fffffffu)) <= vec3u(bitcast<u32>(KD_MAX_COORDINATE)));
    return select(kd_coordinate(kd_position(point), axis) < plane, is_finite, axis == KD_FINITE_LEFT);
}
