// Counts the screen points of each block of slots in cell order. Counts the screen points of each density cell
// and finds its nearest depth [Paper, §5.1].
//
// Reads: keys, counters. Writes: block_sums, density.

#import frame
#import cell_order
#import density
#import groups
#import keys

@group(0) @binding(1) var<storage, read> keys: array<Key>;
@group(0) @binding(2) var<storage, read> counters: array<u32>;
@group(0) @binding(3) var<storage, read_write> block_sums: array<u32>;
@group(0) @binding(4) var<storage, read_write> density: array<CountedCell>;

// A density cell with atomics. Depths, which are positive, have the order of their bits.
struct CountedCell {
    count: atomic<u32>,
    nearest: atomic<u32>,
}

var<workgroup> owned: atomic<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn count(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&owned, 0u);
    }
    workgroupBarrier();
    let block = group_index(workgroup);
    let strip_px = counters[STRIP_PX];
    let cell_px = counters[CELL_PX];
    let cell_columns = counters[CELL_COLUMNS];
    var own = 0u;
    for (var step = 0u; step < RANK_BLOCK_FLAGS / LARGE_GROUP; step++) {
        let at = block * RANK_BLOCK_FLAGS + step * LARGE_GROUP + local;
        if at < arrayLength(&keys) {
            let place = cell_slot(at, strip_px);
            let key = keys[place.slot];
            if key.ordinal != NO_POINT {
                own += 1u;
                let cell = density_cell(place.pixel, cell_px, cell_columns);
                atomicAdd(&density[cell].count, 1u);
                atomicMin(&density[cell].nearest, key.depth);
            }
        }
    }
    atomicAdd(&owned, own);
    workgroupBarrier();
    if local == 0u {
        block_sums[block] = atomicLoad(&owned);
    }
}
