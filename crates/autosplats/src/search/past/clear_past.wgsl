// Clears the k-radii of the last frame, after the last search.
//
// Writes: past.

#import frame
#import groups

@group(0) @binding(1) var<storage, read_write> past: array<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn clear_past(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if index < arrayLength(&past) {
        past[index] = 0u;
    }
}
