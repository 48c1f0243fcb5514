// Makes a tree of each small node by the voxel volume heuristic [ZHWG08, §5]. Of all planes through a node's points,
// the split takes the one with the least
//
//     VVH(x) = C_L·V(L ± R) + C_R·V(R ± R),
//
// that is, the points of either side times the volume from which a query of radius R reaches them. The node is split
// if that is less than C·V(node ± R). As in [ZHWG08, §3.3] the points of a node, and the points before each candidate
// plane, are masks whose bits are counted.
//
// Reads: state, small, points_b. Reads and writes: points_a. Writes: nodes. One workgroup per small node; one
// invocation per point and its three candidate planes.

#import frame
#import groups
#import kd_build
#import kd_tree

@group(0) @binding(1) var<storage, read> state: KdState;
@group(0) @binding(2) var<storage, read> small: array<KdSmall>;
@group(0) @binding(3) var<storage, read_write> points_a: array<vec4u>;
@group(0) @binding(4) var<storage, read> points_b: array<vec4u>;
@group(0) @binding(5) var<storage, read_write> nodes: array<KdNode>;

// Coordinates of the points, axis by axis.
var<workgroup> coordinates: array<f32, 192>;
// Masks of the nodes still to be processed, and their places in `nodes`.
var<workgroup> masks: array<vec2u, 16>;
var<workgroup> places: array<u32, 16>;
var<workgroup> open: u32;
// Nodes made, and points put into leaves.
var<workgroup> made: u32;
var<workgroup> put: u32;
// Box of a node: least and negated greatest coordinates.
var<workgroup> box: array<f32, 6>;
var<workgroup> best_cost: atomic<u32>;
var<workgroup> best: atomic<u32>;

fn ones(mask: vec2u) -> u32 {
    return countOneBits(mask.x) + countOneBits(mask.y);
}

fn bit(at: u32) -> vec2u {
    return select(vec2u(0u, 1u << (at % 32u)), vec2u(1u << (at % 32u), 0u), at < 32u);
}

fn is_in(mask: vec2u, at: u32) -> bool {
    return any((mask & bit(at)) != vec2u(0u));
}

// Mask of the points before a plane.
fn before(axis: u32, plane: f32, len: u32) -> vec2u {
    var mask = vec2u(0u);
    for (var at = 0u; at < len; at++) {
        mask |= select(vec2u(0u), bit(at), coordinates[64u * axis + at] < plane);
    }
    return mask;
}

// The cost of a split, relative to V(node ± R): volumes differ along the axis only.
fn split_cost(axis: u32, plane: f32, left: u32, count: u32) -> f32 {
    let low = box[axis];
    let high = -box[3u + axis];
    let around = 2.0 * frame.first_radius;
    let to_left = f32(left) * (plane - low + around);
    let to_right = f32(count - left) * (high - plane + around);
    let cost = STEP_COST_POINTS + (to_left + to_right) / (high - low + around);
    return select(MAX_F32, cost, left >= MIN_LEAF_POINTS && count - left >= MIN_LEAF_POINTS);
}

@compute @workgroup_size(64)
fn small_tree(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let at = group_index(workgroup);
    var root = KdSmall(0u, 0u, 0u, 0u);
    if at < state.small {
        root = small[at];
    }
    let len = root.len;
    var point = vec4u(0u);
    if local < len {
        if root.list == 0u {
            point = points_a[root.first + local];
        } else {
            point = points_b[root.first + local];
        }
    }
    let position = kd_position(point);
    coordinates[local] = position.x;
    coordinates[64u + local] = position.y;
    coordinates[128u + local] = position.z;
    if local == 0u {
        masks[0] = vec2u(0xffffffffu >> (32u - min(len, 32u)), select(0u, 0xffffffffu >> (64u - len), len > 32u));
        places[0] = root.node;
        open = select(0u, 1u, len > 0u);
        made = 0u;
        put = 0u;
    }
    workgroupBarrier();
    let before_x = before(0u, position.x, len);
    let before_y = before(1u, position.y, len);
    let before_z = before(2u, position.z, len);
    // Nodes below small nodes follow the nodes above them, at a place of their own.
    let room = arrayLength(&small) + root.first / 4u;

    loop {
        let still_open = workgroupUniformLoad(&open);
        if still_open == 0u {
            break;
        }
        let mask = masks[still_open - 1u];
        let node = places[still_open - 1u];
        let already_put = put;
        let count = ones(mask);
        let is_mine = is_in(mask, local);
        if local < 6u {
            var least = MAX_F32;
            let sign = select(-1.0, 1.0, local < 3u);
            for (var at = 0u; at < len; at++) {
                least = min(least, select(MAX_F32, sign * coordinates[64u * (local % 3u) + at], is_in(mask, at)));
            }
            box[local] = least;
        }
        if local == 0u {
            atomicStore(&best_cost, 0xffffffffu);
            atomicStore(&best, KD_NONE);
        }
        workgroupBarrier();
        var cost = MAX_F32;
        var axis = 0u;
        if is_mine {
            let costs = vec3f(
                split_cost(0u, position.x, ones(before_x & mask), count),
                split_cost(1u, position.y, ones(before_y & mask), count),
                split_cost(2u, position.z, ones(before_z & mask), count),
            );
            cost = min(min(costs.x, costs.y), costs.z);
            axis = select(select(2u, 1u, costs.y == cost), 0u, costs.x == cost);
            if cost < f32(count) {
                // Positive numbers order as their bits do.
                atomicMin(&best_cost, bitcast<u32>(cost));
            }
        }
        workgroupBarrier();
        if is_mine && bitcast<u32>(cost) == atomicLoad(&best_cost) {
            atomicMin(&best, local);
        }
        workgroupBarrier();
        let splitter = atomicLoad(&best);
        let low = vec3f(box[0], box[1], box[2]);
        let high = -vec3f(box[3], box[4], box[5]);
        if splitter == KD_NONE {
            // A leaf: its points are stored together, in their previous order.
            if is_mine {
                points_a[root.first + already_put + ones(mask & before_bit(local))] = point;
            }
            if local == 0u {
                nodes[node] = KdNode(low, root.first + already_put, high, count);
                put = already_put + count;
                open = still_open - 1u;
            }
        } else if local == splitter {
            let left = mask & select(select(before_z, before_y, axis == 1u), before_x, axis == 0u);
            let child = room + made;
            nodes[node] = KdNode(low, child, high, 0u);
            made += 2u;
            masks[still_open - 1u] = mask & ~left;
            places[still_open - 1u] = child + 1u;
            masks[still_open] = left;
            places[still_open] = child;
            open = still_open + 1u;
        }
    }
}

// The bits below a bit.
fn before_bit(at: u32) -> vec2u {
    let low = (1u << (at % 32u)) - 1u;
    return select(vec2u(0xffffffffu, low), vec2u(low, 0u), at < 32u);
}
