// Large nodes of the kd-tree while it is built. Imports: range_keys.

// Points of a small node at most.
const KD_SMALL = 64u;
// Points of a large node that one workgroup takes up.
const KD_CHUNK = 256u;

// A node that may have to be split, in the list of its level.
struct KdLarge {
    node: u32,
    // Its run of points.
    first: u32,
    len: u32,
    // Its first chunk among those of all large nodes of the level.
    first_chunk: u32,
    // Tight box of its points, as keys, so that it can be found by atomic minima and maxima.
    low: vec3u,
    // How it is split: 0 to 2 at `plane`, or one of the next two.
    axis: u32,
    high: vec3u,
    plane: f32,
    parent_len: u32,
    // Points that go to its left child.
    left: u32,
    // Where its children are in the list of the next level, if they are large.
    next_left: u32,
    next_right: u32,
}

// Where what of a large node is among its sixteen words.
const KD_LARGE_WORDS = 16u;
const KD_LOW_WORD = 4u;
const KD_HIGH_WORD = 8u;

// The root: points that are finite go left.
const KD_FINITE_LEFT = 3u;
// Not at all.
const KD_UNSPLIT = 4u;
const KD_NONE = 0xffffffffu;
// Coordinates beyond count as not finite: their squares must not overflow.
const KD_FARTHEST = 1e18;

// A node of few points: it becomes a tree by itself.
struct KdSmall {
    node: u32,
    first: u32,
    len: u32,
    // Which of the two lists of points it lies in.
    list: u32,
}

struct KdState {
    // Levels split so far.
    level: u32,
    // Nodes made.
    nodes: u32,
    // Nodes to be split, and their chunks.
    large: u32,
    chunks: u32,
    small: u32,
    // Points that are finite.
    finite: u32,
}

fn kd_position(point: vec4u) -> vec3f {
    return bitcast<vec3f>(point.xyz);
}

fn kd_coordinate(position: vec3f, axis: u32) -> f32 {
    return select(select(position.z, position.y, axis == 1u), position.x, axis == 0u);
}

fn kd_goes_left(point: vec4u, axis: u32, plane: f32) -> bool {
    // Magnitudes order as their bits do, and above all of them are those of what is not a number.
    let is_finite = all((point.xyz & vec3u(0x7fffffffu)) <= vec3u(bitcast<u32>(KD_FARTHEST)));
    return select(kd_coordinate(kd_position(point), axis) < plane, is_finite, axis == KD_FINITE_LEFT);
}
