// Ends a level: sums the chunks, makes the children of the nodes that are split, and lists large children for the next
// level and small children for later. All in the order of the nodes, so that the result does not depend on timing.
//
// Reads: state. Reads and writes: large, chunk_sums. Writes: next_state, next_large, small, nodes, and the arguments
// of the next level. One workgroup.

#import kd_build
#import kd_tree
#import put_work

@group(0) @binding(0) var<storage, read> state: KdState;
@group(0) @binding(1) var<storage, read_write> large: array<KdLarge>;
@group(0) @binding(2) var<storage, read_write> chunk_sums: array<u32>;
@group(0) @binding(3) var<storage, read_write> next_state: KdState;
@group(0) @binding(4) var<storage, read_write> next_large: array<KdLarge>;
@group(0) @binding(5) var<storage, read_write> small: array<KdSmall>;
@group(0) @binding(6) var<storage, read_write> nodes: array<KdNode>;
@group(0) @binding(7) var<storage, read_write> arguments: array<Dispatch>;

// Sums over runs of nodes: nodes split, large children, their chunks, small children.
var<workgroup> made: array<vec4u, LARGE_GROUP + 1u>;
// Points that go left, summed over runs of chunks.
var<workgroup> sums: array<u32, LARGE_GROUP + 1u>;

fn points_left(own: KdLarge) -> u32 {
    let chunks = (own.len + CHUNK_POINTS - 1u) / CHUNK_POINTS;
    return chunk_sums[own.first_chunk + chunks] - chunk_sums[own.first_chunk];
}

// Whether a node is split. Splits that leave all points on one side are refused, as they might never end.
fn is_split(own: KdLarge, left: u32) -> bool {
    // A level without room for its children is the last.
    let has_room = state.nodes + 2u * state.large <= arrayLength(&small);
    return has_room && (own.axis == KD_FINITE_LEFT || (own.axis != KD_UNSPLIT && left > 0u && left < own.len));
}

fn is_large(len: u32) -> bool {
    return len > MAX_SMALL_NODE_POINTS;
}

fn child(len: u32) -> vec4u {
    if is_large(len) {
        return vec4u(0u, 1u, (len + CHUNK_POINTS - 1u) / CHUNK_POINTS, 0u);
    }
    return vec4u(0u, 0u, 0u, select(0u, 1u, len > 0u));
}

fn children(own: KdLarge, left: u32) -> vec4u {
    if !is_split(own, left) {
        return vec4u(0u);
    }
    let of_left = vec4u(1u, 0u, 0u, 0u) + child(left);
    // Points that are not finite enter no list.
    return select(of_left + child(own.len - left), of_left, vec4<bool>(own.axis == KD_FINITE_LEFT));
}

// Appends a child to its list, at the places `at`. Returns its place in the next level's large nodes, or KD_NONE.
fn put(node: u32, first: u32, len: u32, parent_len: u32, at: vec4u) -> u32 {
    if is_large(len) {
        let empty_low = vec3u(0xffffffffu);
        next_large[at.y] =
            KdLarge(node, first, len, at.z, empty_low, KD_UNSPLIT, vec3u(0u), 0.0, parent_len, 0u, KD_NONE, KD_NONE);
        return at.y;
    }
    if len > 0u {
        // Points of an even level are scattered to the second list.
        small[state.small + at.w] = KdSmall(node, first, len, 1u - (state.level % 2u));
    }
    return KD_NONE;
}

@compute @workgroup_size(LARGE_GROUP)
fn place(@builtin(local_invocation_index) local: u32) {
    // Replace the sums of chunks by the number of points that go left before each chunk, and after the last.
    let chunks_each = (state.chunks + LARGE_GROUP - 1u) / LARGE_GROUP;
    let first_chunk = min(local * chunks_each, state.chunks);
    let end_chunk = min(first_chunk + chunks_each, state.chunks);
    var sum = 0u;
    for (var chunk = first_chunk; chunk < end_chunk; chunk++) {
        sum += chunk_sums[chunk];
    }
    sums[local + 1u] = sum;
    workgroupBarrier();
    if local == 0u {
        sums[0] = 0u;
        for (var run = 1u; run <= LARGE_GROUP; run++) {
            sums[run] += sums[run - 1u];
        }
        chunk_sums[state.chunks] = sums[256];
    }
    workgroupBarrier();
    sum = sums[local];
    for (var chunk = first_chunk; chunk < end_chunk; chunk++) {
        let own = chunk_sums[chunk];
        chunk_sums[chunk] = sum;
        sum += own;
    }
    storageBarrier();
    workgroupBarrier();

    let nodes_each = (state.large + LARGE_GROUP - 1u) / LARGE_GROUP;
    let first_node = min(local * nodes_each, state.large);
    let end_node = min(first_node + nodes_each, state.large);
    var own_made = vec4u(0u);
    for (var at = first_node; at < end_node; at++) {
        own_made += children(large[at], points_left(large[at]));
    }
    made[local + 1u] = own_made;
    workgroupBarrier();
    if local == 0u {
        made[0] = vec4u(0u);
        for (var run = 1u; run <= LARGE_GROUP; run++) {
            made[run] += made[run - 1u];
        }
        let total = made[256];
        let finite = select(state.finite, chunk_sums[state.chunks], state.level == 0u);
        next_state = KdState(state.level + 1u, state.nodes + 2u * total.x, total.y, total.z, state.small + total.w, finite);
        put_work(WORK_LARGE, total.y, SMALL_GROUP);
        put_work(WORK_CHUNKS, total.z, 1u);
        put_work(WORK_SMALL, state.small + total.w, 1u);
        put_work(WORK_POINTS, finite, SMALL_GROUP);
    }
    workgroupBarrier();
    var so_far = made[local];
    for (var at = first_node; at < end_node; at++) {
        let own = large[at];
        let left = points_left(own);
        if !is_split(own, left) {
            large[at].axis = KD_UNSPLIT;
            continue;
        }
        let both = state.nodes + 2u * so_far.x;
        let is_root = own.axis == KD_FINITE_LEFT;
        nodes[both] = KdNode(vec3f(MAX_F32), 0u, vec3f(-MAX_F32), 1u);
        nodes[both + 1u] = nodes[both];
        nodes[own.node].first = both;
        nodes[own.node].len = 0u;
        // Separating the finite points does not count as a lopsided split.
        let parent_len = select(own.len, KD_NONE, is_root);
        large[at].left = left;
        large[at].next_left = put(both, own.first, left, parent_len, so_far);
        if !is_root {
            let after = so_far + child(left);
            large[at].next_right = put(both + 1u, own.first + left, own.len - left, parent_len, after);
        }
        so_far += children(own, left);
    }
}
