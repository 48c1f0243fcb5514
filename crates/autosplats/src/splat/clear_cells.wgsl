// Refinement begins with no cell marked.
//
// Writes: cells.

#import frame
#import groups

@group(0) @binding(1) var<storage, read_write> cells: array<u32>;

@compute @workgroup_size(256)
fn clear_cells(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let at = group_index(workgroup) * 256u + local;
    if at < arrayLength(&cells) {
        cells[at] = 0u;
    }
}
