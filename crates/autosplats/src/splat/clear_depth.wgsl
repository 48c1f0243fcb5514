// Clears the depth map to infinity.
//
// Writes: depth_map.

#import frame
#import depth_map
#import groups

@group(0) @binding(1) var<storage, read_write> depth_map: array<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn clear_depth(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let at = group_index(workgroup) * LARGE_GROUP + local;
    if at < arrayLength(&depth_map) {
        depth_map[at] = depth_key(infinity());
    }
}
