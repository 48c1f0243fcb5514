// Counts, of each block of 2048 passive points, those that the depth map does not hide for sure [Paper, §7, Grid Culling].
//
// Reads: points, passive, counters, density, depth_map. Writes: block_sums.

#import frame
#import groups
#import counters
#import density
#import screen
#import depth_map
#import hidden
#import recovered

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> passive: array<u32>;
@group(0) @binding(3) var<storage, read> counters: array<u32>;
@group(0) @binding(4) var<storage, read> density: array<vec2u>;
@group(0) @binding(5) var<storage, read> depth_map: array<u32>;
@group(0) @binding(6) var<storage, read_write> block_sums: array<u32>;

var<workgroup> recovered_points: atomic<u32>;

@compute @workgroup_size(256)
fn recover_count(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&recovered_points, 0u);
    }
    workgroupBarrier();
    let block = group_index(workgroup);
    var own = 0u;
    for (var step = 0u; step < 8u; step++) {
        let index = block * 2048u + step * 256u + local;
        if index < counters[PASSIVE] {
            let point = points[passive[index]];
            if is_back(point) {
                own += 1u;
            }
        }
    }
    if own > 0u {
        atomicAdd(&recovered_points, own);
    }
    workgroupBarrier();
    if local == 0u && block < arrayLength(&block_sums) {
        block_sums[block] = atomicLoad(&recovered_points);
    }
}
