// Like `project`, for devices without 64-bit atomics. The first turn finds the nearest depth of each slot, the second
// the lowest ordinal among the points at that depth. Both turns share one program, because two programs need not
// compute the same bits: a depth that differed between them would leave a hole.
//
// Reads: a chunk of the cloud, turn. Writes: keys, counters, sixteenths, near.

#import frame
#import add_sixteenth
#import cloud_points
#import count_dropped
#import count_near
#import groups
#import project_point

@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> positions: array<f32>;
@group(0) @binding(3) var<storage, read_write> keys: array<AtomicKey>;
@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> sixteenths: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> near: array<atomic<u32>>;
// 0 for depths, 1 for ordinals.
@group(0) @binding(7) var<uniform> turn: u32;

// As in `keys`, with atomics.
struct AtomicKey {
    ordinal: atomic<u32>,
    depth: atomic<u32>,
}

@compute @workgroup_size(LARGE_GROUP)
fn project_32(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    count_dropped_clear(local);
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if is_drawn(index) {
        let projected = project_point(from_eye(index));
        let depth = ~bitcast<u32>(projected.depth);
        if turn == 0u {
            count_near(projected, ordinal_of(index));
        }
        if projected.slot >= SLOT_OUTSIDE {
            if turn == 0u {
                count_dropped(projected.slot);
            }
        } else if turn == 0u {
            // Most points lie behind others; a load shows this.
            if depth > atomicLoad(&keys[projected.slot].depth) {
                atomicMax(&keys[projected.slot].depth, depth);
            }
            add_sixteenth(projected.sixteenths);
        } else if atomicLoad(&keys[projected.slot].depth) == depth {
            atomicMax(&keys[projected.slot].ordinal, ~ordinal_of(index));
        }
    }
    count_dropped_finish(local);
}
