// Counts the screen points of each block of slots in cell order. Counts the screen points of each density cell
// and finds its nearest depth [Paper, §5.1]. The first workgroup lists the points of sparse cells around the eye.
//
// Reads: keys, sixteenths, near. Reads and writes: counters. Writes: block_sums, density, source, arguments.

#import frame
#import cell_order
#import cell_sizes
#import density
#import groups
#import held
#import keys
#import list_near

@group(0) @binding(1) var<storage, read> keys: array<Key>;
@group(0) @binding(2) var<storage, read_write> counters: array<u32>;
@group(0) @binding(3) var<storage, read_write> block_sums: array<u32>;
@group(0) @binding(4) var<storage, read_write> density: array<CountedCell>;
@group(0) @binding(5) var<storage, read> near: array<u32>;
@group(0) @binding(6) var<storage, read_write> source: array<u32>;
@group(0) @binding(7) var<storage, read> sixteenths: array<u32>;
@group(0) @binding(8) var<storage, read_write> arguments: array<Dispatch>;

// A density cell with atomics. Depths, which are positive, have the order of their bits.
struct CountedCell {
    count: atomic<u32>,
    nearest: atomic<u32>,
}

var<workgroup> owned: atomic<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn count(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    // No workgroup reads what another writes.
    let sizes = cell_sizes(counters[NEAR_FIRST], counters[BLOCKS]);
    if workgroup.x == 0u && workgroup.y == 0u {
        if local == 0u {
            counters[STRIP_PX] = sizes.strip_px;
            counters[CELL_PX] = sizes.cell_px;
            counters[CELL_COLUMNS] = sizes.cell_columns;
        }
        list_near(local);
    } else {
        count_block(group_index(workgroup) - 1u, sizes, local);
    }
}

// To be called by all invocations of a workgroup.
fn count_block(block: u32, sizes: CellSizes, local: u32) {
    if local == 0u {
        atomicStore(&owned, 0u);
    }
    workgroupBarrier();
    var own = 0u;
    for (var step = 0u; step < RANK_BLOCK_FLAGS / LARGE_GROUP; step++) {
        let at = block * RANK_BLOCK_FLAGS + step * LARGE_GROUP + local;
        if at < arrayLength(&keys) {
            let place = cell_slot(at, sizes.strip_px);
            if is_held(place.pixel, place.half) {
                let key = keys[place.slot];
                if is_owned(key) {
                    own += 1u;
                    let cell = density_cell(place.pixel, sizes.cell_px, sizes.cell_columns);
                    atomicAdd(&density[cell].count, 1u);
                    atomicMin(&density[cell].nearest, depth_of(key));
                }
            }
        }
    }
    atomicAdd(&owned, own);
    workgroupBarrier();
    if local == 0u {
        block_sums[block] = atomicLoad(&owned);
    }
}
