// Marks and counts, per block, the passive points that matter to the picture and may be visible despite the
// depth map [Paper, §7, Grid Culling].
//
// Reads: points, counters, density, depth_map. Reads and writes: passive. Writes: block_sums.

#import frame
#import density
#import groups
#import hidden
#import matters
#import recovered
#import screen

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read_write> passive: array<u32>;
@group(0) @binding(3) var<storage, read> counters: array<u32>;
@group(0) @binding(4) var<storage, read> density: array<DensityCell>;
@group(0) @binding(5) var<storage, read> depth_map: array<u32>;
@group(0) @binding(6) var<storage, read_write> block_sums: array<u32>;

var<workgroup> recovered_points: atomic<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn recover_count(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&recovered_points, 0u);
    }
    workgroupBarrier();
    let block = group_index(workgroup);
    let cell_px = counters[CELL_PX];
    let cell_columns = counters[CELL_COLUMNS];
    var own = 0u;
    for (var step = 0u; step < RANK_BLOCK_FLAGS / LARGE_GROUP; step++) {
        let index = block * RANK_BLOCK_FLAGS + step * LARGE_GROUP + local;
        if index < counters[PASSIVE] {
            let passive_point = passive[index];
            let point = points[passive_point];
            let cell = density[density_cell(pixel_xy(point.pixel), cell_px, cell_columns)];
            if matters(point, cell, cell_px) && is_back(point, cell, cell_px) {
                passive[index] = passive_point | RECOVERED_FLAG;
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

fn is_back(point: ScreenPoint, cell: DensityCell, cell_px: u32) -> bool {
    let depth = point.position_view.z;
    if !is_hidden(point.pixel, depth) {
        return true;
    }
    let pixel = pixel_xy(point.pixel);
    let last = frame.size - 1u;
    let reach = u32(min(RECOVER_DISTANCE_RADII * initial_radius_px(cell.count, cell_px), 65535.0));
    let low = pixel - min(pixel, vec2u(reach));
    let high = min(pixel + reach, last);
    return !(is_hidden(low.x | (pixel.y << 16u), depth) && is_hidden(high.x | (pixel.y << 16u), depth)
        && is_hidden(pixel.x | (low.y << 16u), depth) && is_hidden(pixel.x | (high.y << 16u), depth));
}
