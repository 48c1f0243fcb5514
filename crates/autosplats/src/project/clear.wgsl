// Empties for a new frame what its passes add to: density cells, counters, sixteenths, the cells around the eye, the
// depth map, the centres of splats and the k-radii to keep. Keys are empty: see `keys`.
//
// Writes: density, counters, sixteenths, near, depth_map, centers, past.

#import frame
#import density
#import depth_map
#import groups
#import past_radii

@group(0) @binding(1) var<storage, read_write> density: array<DensityCell>;
@group(0) @binding(2) var<storage, read_write> counters: array<u32>;
@group(0) @binding(3) var<storage, read_write> sixteenths: array<u32>;
@group(0) @binding(4) var<storage, read_write> near: array<u32>;
@group(0) @binding(5) var<storage, read_write> depth_map: array<u32>;
@group(0) @binding(6) var<storage, read_write> centers: array<u32>;
@group(0) @binding(7) var<storage, read_write> past: array<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn clear(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(workgroup) * LARGE_GROUP + local;
    if index < arrayLength(&density) {
        density[index] = DensityCell(0u, infinity());
    }
    if index < arrayLength(&counters) {
        counters[index] = 0u;
    }
    if index < arrayLength(&sixteenths) {
        sixteenths[index] = 0u;
    }
    if index < NEAR_CELLS {
        near[index] = 0u;
    }
    if index < arrayLength(&depth_map) {
        depth_map[index] = depth_key(infinity());
        centers[index] = 0u;
        if kept_at(index) < arrayLength(&past) {
            past[kept_at(index)] = 0u;
        }
    }
}
