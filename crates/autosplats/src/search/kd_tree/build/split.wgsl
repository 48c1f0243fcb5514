// Chooses the split of each large node of a level: at the spatial median of the longest axis of its tight box.
//
// The tight box cuts off all empty space, where [ZHWG08] makes empty nodes of large enough parts.
//
// Reads: state, points. Reads and writes: large. Writes: nodes. One invocation per large node.

#import groups
#import kd_build
#import kd_tree
#import range_keys

@group(0) @binding(0) var<storage, read> state: KdState;
@group(0) @binding(1) var<storage, read> points: array<vec4u>;
@group(0) @binding(2) var<storage, read_write> large: array<KdLarge>;
@group(0) @binding(3) var<storage, read_write> nodes: array<KdNode>;

// Number of points whose median stands for the median of a node.
const MEDIAN_SAMPLES = 15u;

fn corner(keys: vec3u) -> vec3f {
    return bitcast<vec3f>(vec3u(key_bits(keys.x), key_bits(keys.y), key_bits(keys.z)));
}

// Coordinate of one of the points spread evenly over a node's run.
fn sample(at: u32, large_node: KdLarge, axis: u32) -> f32 {
    let place = large_node.first + at * (large_node.len / MEDIAN_SAMPLES);
    return kd_coordinate(kd_position(points[place]), axis);
}

fn sampled_median(large_node: KdLarge, axis: u32) -> f32 {
    var median = 0.0;
    for (var own = 0u; own < MEDIAN_SAMPLES; own++) {
        let x = sample(own, large_node, axis);
        var less = 0u;
        var up_to = 0u;
        for (var other = 0u; other < MEDIAN_SAMPLES; other++) {
            let y = sample(other, large_node, axis);
            less += select(0u, 1u, y < x);
            up_to += select(0u, 1u, y <= x);
        }
        if less <= MEDIAN_SAMPLES / 2u && up_to > MEDIAN_SAMPLES / 2u {
            median = x;
        }
    }
    return median;
}

@compute @workgroup_size(SMALL_GROUP)
fn split(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let at = group_index(workgroup) * SMALL_GROUP + local;
    if at >= state.large {
        return;
    }
    let own = large[at];
    if own.node == 0u {
        large[at].axis = KD_FINITE_LEFT;
        return;
    }
    let low = corner(own.low);
    let high = corner(own.high);
    // A leaf, unless `place` gives the node children.
    nodes[own.node] = KdNode(low, own.first, high, own.len);
    let extent = high - low;
    let longest = max(max(extent.x, extent.y), extent.z);
    if !(longest > 0.0) {
        // All points are coincident.
        large[at].axis = KD_UNSPLIT;
        return;
    }
    let axis = select(select(2u, 1u, extent.y == longest), 0u, extent.x == longest);
    let least = kd_coordinate(low, axis);
    let most = kd_coordinate(high, axis);
    var plane = 0.5 * least + 0.5 * most;
    // Differs from [ZHWG08]: no two lopsided splits follow each other, which bounds the levels. Otherwise a distant
    // cluster would take a level for each halving of the space around.
    if own.len > own.parent_len / 4u * 3u {
        let median = sampled_median(own, axis);
        plane = select(plane, median, median > least);
    }
    // The mean of two adjacent floats is one of them. Points at `most` go right, points at `least` left.
    large[at].plane = select(most, plane, plane > least);
    large[at].axis = axis;
}
