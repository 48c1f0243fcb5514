// Counts the active points of each block of screen points: points that matter and that grid culling keeps.
//
// Reads: points, density, counters. Writes: block_sums.

#import frame
#import culled
#import groups
#import matters
#import screen

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> density: array<vec2u>;
@group(0) @binding(3) var<storage, read> counters: array<u32>;
@group(0) @binding(4) var<storage, read_write> block_sums: array<u32>;

var<workgroup> active_points: atomic<u32>;

@compute @workgroup_size(256)
fn split_count(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&active_points, 0u);
    }
    workgroupBarrier();
    let block = group_index(workgroup);
    let visible = counters[VISIBLE];
    var own = 0u;
    for (var step = 0u; step < RANK_BLOCK_FLAGS / 256u; step++) {
        let index = block * RANK_BLOCK_FLAGS + step * 256u + local;
        if index < visible && matters(points[index]) && !is_culled(points[index]) {
            own += 1u;
        }
    }
    atomicAdd(&active_points, own);
    workgroupBarrier();
    if local == 0u {
        block_sums[block] = atomicLoad(&active_points);
    }
}
