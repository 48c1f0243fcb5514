// Moves the points of a level to the halves of their nodes' runs, in order, and finds the boxes of the large children.
// Points of a node that is not split keep their place in the other list.
//
// Reads: state, large, chunk_sums, points. Writes: next_points, next_large. One workgroup per chunk of a large node.

#import groups
#import kd_build
#import kd_chunk
#import range_keys

@group(0) @binding(0) var<storage, read> state: KdState;
@group(0) @binding(1) var<storage, read> large: array<KdLarge>;
@group(0) @binding(2) var<storage, read> chunk_sums: array<u32>;
@group(0) @binding(3) var<storage, read> points: array<vec4u>;
@group(0) @binding(4) var<storage, read_write> next_points: array<vec4u>;
@group(0) @binding(5) var<storage, read_write> next_large: array<atomic<u32>>;

// Bits of the chunk's points that go left.
var<workgroup> bits: array<atomic<u32>, 8>;
// Boxes of the points that each invocation moves left and right: least and negated greatest coordinates.
var<workgroup> boxes: array<f32, 12u * SMALL_GROUP>;

fn bound(place: u32, local: u32, value: vec3f) {
    boxes[place * SMALL_GROUP + local] = value.x;
    boxes[(place + 1u) * SMALL_GROUP + local] = value.y;
    boxes[(place + 2u) * SMALL_GROUP + local] = value.z;
}

@compute @workgroup_size(SMALL_GROUP)
fn scatter(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let chunk = group_index(workgroup);
    if local == 0u {
        task = kd_task(chunk, state);
    }
    if local < 8u {
        atomicStore(&bits[local], 0u);
    }
    workgroupBarrier();
    for (var flag = local; task.first + flag < task.end; flag += SMALL_GROUP) {
        if kd_goes_left(points[task.first + flag], task.axis, task.plane) {
            atomicOr(&bits[flag / 32u], 1u << (flag % 32u));
        }
    }
    workgroupBarrier();
    let own = large[task.large];
    let before = chunk_sums[chunk] - chunk_sums[own.first_chunk];
    var left_low = vec3f(MAX_F32);
    var left_high = vec3f(MAX_F32);
    var right_low = vec3f(MAX_F32);
    var right_high = vec3f(MAX_F32);
    for (var flag = local; task.first + flag < task.end; flag += SMALL_GROUP) {
        let at = task.first + flag;
        let point = points[at];
        if task.axis == KD_UNSPLIT {
            next_points[at] = point;
            continue;
        }
        let word = flag / 32u;
        let bit = 1u << (flag % 32u);
        let in_word = atomicLoad(&bits[word]);
        var rank = before + countOneBits(in_word & (bit - 1u));
        for (var earlier = 0u; earlier < word; earlier++) {
            rank += countOneBits(atomicLoad(&bits[earlier]));
        }
        let position = kd_position(point);
        if (in_word & bit) != 0u {
            next_points[own.first + rank] = point;
            left_low = min(left_low, position);
            left_high = min(left_high, -position);
        } else {
            next_points[own.left + at - rank] = point;
            right_low = min(right_low, position);
            right_high = min(right_high, -position);
        }
    }
    bound(0u, local, left_low);
    bound(3u, local, left_high);
    bound(6u, local, right_low);
    bound(9u, local, right_high);
    workgroupBarrier();
    // Each of twelve invocations reduces one value.
    let slot = select(own.next_right, own.next_left, local < 6u);
    if local >= 12u || task.first >= task.end || task.axis == KD_UNSPLIT || slot == KD_NONE {
        return;
    }
    var least = MAX_F32;
    for (var invocation = 0u; invocation < SMALL_GROUP; invocation++) {
        least = min(least, boxes[local * SMALL_GROUP + invocation]);
    }
    let axis = local % 3u;
    let words = slot * KD_LARGE_WORDS;
    if least == MAX_F32 {
        // No point of this chunk goes to that child.
        return;
    }
    if local % 6u < 3u {
        atomicMin(&next_large[words + KD_LOW_WORD + axis], value_key(least));
    } else {
        atomicMax(&next_large[words + KD_HIGH_WORD + axis], value_key(-least));
    }
}
