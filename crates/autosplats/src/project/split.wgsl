// Lists the active and the passive screen points, both ascending [Paper, §7, Grid Culling].
//
// Reads: points, density, block_sums. Reads and writes: counters. Writes: queries, passive, arguments. The last block
// tells the numbers of points.

#import frame
#import active
#import density
#import groups
#import put_rounds
#import rank
#import screen
#import sum_before

@group(0) @binding(1) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(2) var<storage, read> density: array<DensityCell>;
@group(0) @binding(3) var<storage, read_write> counters: array<u32>;
@group(0) @binding(4) var<storage, read> block_sums: array<u32>;
@group(0) @binding(5) var<storage, read_write> queries: array<u32>;
@group(0) @binding(6) var<storage, read_write> passive: array<u32>;
@group(0) @binding(7) var<storage, read_write> arguments: array<Dispatch>;

@compute @workgroup_size(LARGE_GROUP)
fn split(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    rank_clear(local);
    let block = group_index(workgroup);
    let visible = counters[VISIBLE];
    let cell_px = counters[CELL_PX];
    let cell_columns = counters[CELL_COLUMNS];
    var active_steps = 0u;
    for (var step = 0u; step < RANK_BLOCK_FLAGS / LARGE_GROUP; step++) {
        let flag = step * LARGE_GROUP + local;
        let index = block * RANK_BLOCK_FLAGS + flag;
        if index < visible {
            let point = points[index];
            let cell = density[density_cell(pixel_xy(point.pixel), cell_px, cell_columns)];
            if is_active(point, cell, cell_px) {
                rank_set(flag);
                active_steps |= 1u << step;
            }
        }
    }
    rank_finish(local);
    let active_before = sum_before(block, local);
    for (var step = 0u; step < RANK_BLOCK_FLAGS / LARGE_GROUP; step++) {
        let flag = step * LARGE_GROUP + local;
        let index = block * RANK_BLOCK_FLAGS + flag;
        let before = active_before + rank_of(flag);
        if index < visible {
            if (active_steps & (1u << step)) != 0u {
                queries[before] = index;
            } else {
                passive[index - before] = index;
            }
        }
    }
    if block == (max(visible, 1u) - 1u) / RANK_BLOCK_FLAGS && local == 0u {
        let active_len = active_before + block_sums[block];
        counters[ACTIVE] = active_len;
        counters[ROUND_LEN] = active_len;
        counters[PASSIVE] = visible - active_len;
        put_active(active_len);
        // One block at least: the last tells how many points are recovered.
        put_work(PASSIVE_BLOCKS, max(visible - active_len, 1u), RANK_BLOCK_FLAGS);
    }
}
