// Like `project`, for devices whose 64-bit atomics can load and whose invocations run in subgroups. Most points lose:
// they lie behind the nearest point that is known, or beside a nearer one. Such points ask for no atomic maximum.
//
// Reads: a chunk of the cloud. Writes: keys, counters, sixteenths, near.

#import frame
#import add_sixteenth
#import cloud_points
#import count_dropped
#import count_near
#import groups
#import project_point

@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> positions: array<f32>;
@group(0) @binding(3) var<storage, read_write> keys: array<atomic<u64>>;
@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> sixteenths: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> near: array<atomic<u32>>;

// Slot of an invocation without a point that may own one.
const SLOT_NONE = 0xfffffffcu;

// Whether a point of the subgroup in the same slot surely wins over an invocation's own. To be called by all
// invocations together.
fn loses(slot: u32, depth: u32, ordinal: u32) -> bool {
    // Dense scans have all points of a subgroup in a slot.
    if subgroupAll(slot == subgroupBroadcastFirst(slot)) {
        let least = subgroupMin(depth);
        return depth != least || ordinal != subgroupMin(select(NO_POINT, ordinal, depth == least));
    }
    let other_slot = subgroupShuffleXor(slot, 1u);
    let other_depth = subgroupShuffleXor(depth, 1u);
    let other_ordinal = subgroupShuffleXor(ordinal, 1u);
    return other_slot == slot && (other_depth < depth || (other_depth == depth && other_ordinal < ordinal));
}

@compute @workgroup_size(LARGE_GROUP)
fn project_lanes(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    count_dropped_clear(local);
    for (var turn = 0u; turn < POINTS_PER_LANE; turn++) {
        let index = (group_index(workgroup) * POINTS_PER_LANE + turn) * LARGE_GROUP + local;
        var slot = SLOT_NONE;
        var depth = 0u;
        var ordinal = 0u;
        if is_drawn(index) {
            let projected = project_point(from_eye(index));
            ordinal = ordinal_of(index);
            count_near(projected, ordinal);
            if projected.slot >= SLOT_OUTSIDE {
                count_dropped(projected.slot);
            } else {
                slot = projected.slot;
                depth = bitcast<u32>(projected.depth);
                add_sixteenth(projected.sixteenths);
            }
        }
        if !loses(slot, depth, ordinal) && slot != SLOT_NONE {
            let key = (u64(~depth) << 32u) | u64(~ordinal);
            if key > atomicLoad(&keys[slot]) {
                atomicMax(&keys[slot], key);
            }
        }
    }
    count_dropped_finish(local);
}
