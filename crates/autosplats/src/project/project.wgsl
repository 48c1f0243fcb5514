// Every point goes to its pixel, or half pixel, and the nearest wins [Paper, §3], by a 64-bit atomic maximum.
//
// Reads: a chunk of the cloud. Writes: keys, counters, sixteenths, near. `project_32` does the same with 32 bits.

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

@compute @workgroup_size(LARGE_GROUP)
fn project(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    count_dropped_clear(local);
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if is_drawn(index) {
        let projected = project_point(from_eye(index));
        count_near(projected, ordinal_of(index));
        if projected.slot >= SLOT_OUTSIDE {
            count_dropped(projected.slot);
        } else {
            let key = (u64(~bitcast<u32>(projected.depth)) << 32u) | u64(~ordinal_of(index));
            atomicMax(&keys[projected.slot], key);
            add_sixteenth(projected.sixteenths);
        }
    }
    count_dropped_finish(local);
}
