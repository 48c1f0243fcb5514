// Counts the active points of each block of screen points: points that matter and that grid culling keeps.
//
// Reads: points, density, counters. Writes: block_sums.

#import frame
#import active
#import density
#import groups
#import screen

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> density: array<DensityCell>;
@group(0) @binding(3) var<storage, read> counters: array<u32>;
@group(0) @binding(4) var<storage, read_write> block_sums: array<u32>;

var<workgroup> active_points: atomic<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn split_count(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&active_points, 0u);
    }
    workgroupBarrier();
    let block = group_index(workgroup);
    let visible = counters[VISIBLE];
    let cell_px = counters[CELL_PX];
    let cell_columns = counters[CELL_COLUMNS];
    var own = 0u;
    for (var step = 0u; step < RANK_BLOCK_FLAGS / LARGE_GROUP; step++) {
        let index = block * RANK_BLOCK_FLAGS + step * LARGE_GROUP + local;
        if index < visible {
            let point = points[index];
            let cell = density[density_cell(pixel_xy(point.pixel), cell_px, cell_columns)];
            if is_active(point, cell, cell_px) {
                own += 1u;
            }
        }
    }
    atomicAdd(&active_points, own);
    workgroupBarrier();
    if local == 0u {
        block_sums[block] = atomicLoad(&active_points);
    }
}
