// The kd-tree over all points of the cloud, and walks over its leaves. The pass binds `nodes`.

struct KdNode {
    // Tight box of the node's points; inverted if there are none, so that no sphere meets it.
    low: vec3f,
    // Inner node: the first of its two adjacent children. Leaf: its first point.
    first: u32,
    high: vec3f,
    // Points of a leaf; 0 for an inner node.
    len: u32,
}

// The root's children are the finite points and the others, which no walk visits.
const KD_FINITE = 1u;
// Most levels of the tree.
const KD_DEPTH = 64u;

// A point of the tree: bits of its position relative to the cloud's origin, and its index in the cloud.
alias KdPoint = vec4u;

// A walk over the leaves that a sphere meets, near ones first.
struct KdWalk {
    center: vec3f,
    squared: f32,
    // Stack of nodes to visit, all of which meet the sphere.
    open: array<u32, KD_DEPTH>,
    depth: u32,
    // Number of visited nodes and points, which bounds the work.
    seen: u32,
}

// Fused, so that all passes get the same bits.
fn kd_squared_length(v: vec3f) -> f32 {
    return fma(v.z, v.z, fma(v.y, v.y, v.x * v.x));
}

// Squared distance from a point to the box of a node.
fn kd_squared_distance(node: u32, center: vec3f) -> f32 {
    return kd_squared_length(max(max(nodes[node].low - center, center - nodes[node].high), vec3f(0.0)));
}

fn kd_walk(center: vec3f, radius: f32) -> KdWalk {
    var walk: KdWalk;
    walk.center = center;
    walk.squared = min(radius * radius, MAX_F32);
    walk.open[0] = KD_FINITE;
    walk.depth = select(0u, 1u, kd_squared_distance(KD_FINITE, center) <= walk.squared);
    walk.seen = 0u;
    return walk;
}

// The next leaf: its first point and number of points; 0 points at the end of the walk.
fn kd_next_leaf(walk: ptr<function, KdWalk>) -> vec2u {
    if (*walk).depth == 0u {
        return vec2u(0u);
    }
    (*walk).depth -= 1u;
    var node = (*walk).open[(*walk).depth];
    while nodes[node].len == 0u {
        let left = nodes[node].first;
        let to_left = kd_squared_distance(left, (*walk).center);
        let to_right = kd_squared_distance(left + 1u, (*walk).center);
        let right_is_near = to_right < to_left;
        node = select(left, left + 1u, right_is_near);
        if max(to_left, to_right) <= (*walk).squared && (*walk).depth < KD_DEPTH {
            (*walk).open[(*walk).depth] = select(left + 1u, left, right_is_near);
            (*walk).depth += 1u;
        }
        (*walk).seen += 1u;
        // The sphere may meet the box of a node and of neither child.
        if !(min(to_left, to_right) <= (*walk).squared) {
            if (*walk).depth == 0u {
                return vec2u(0u);
            }
            (*walk).depth -= 1u;
            node = (*walk).open[(*walk).depth];
        }
    }
    return vec2u(nodes[node].first, nodes[node].len);
}
