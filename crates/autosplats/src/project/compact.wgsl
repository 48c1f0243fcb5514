// Lists the owners of slots in cell order, and stores the start of each cell.
//
// Reads: keys, counters, block_sums, names. Writes: source, pixels, cell_start.

#import frame
#import cell_order
#import groups
#import keys
#import names
#import rank
#import sum_before

@group(0) @binding(1) var<storage, read> keys: array<Key>;
@group(0) @binding(2) var<storage, read> counters: array<u32>;
@group(0) @binding(3) var<storage, read> block_sums: array<u32>;
@group(0) @binding(4) var<storage, read_write> source: array<u32>;
@group(0) @binding(5) var<storage, read_write> pixels: array<u32>;
@group(0) @binding(6) var<storage, read_write> cell_start: array<u32>;
@group(0) @binding(7) var<storage, read> names: array<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn compact(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    rank_clear(local);
    let block = group_index(workgroup);
    let strip_px = counters[STRIP_PX];
    for (var step = 0u; step < RANK_BLOCK_FLAGS / LARGE_GROUP; step++) {
        let flag = step * LARGE_GROUP + local;
        let at = block * RANK_BLOCK_FLAGS + flag;
        if at < arrayLength(&keys) {
            if keys[cell_slot(at, strip_px).slot].ordinal != NO_POINT {
                rank_set(flag);
            }
        }
    }
    rank_finish(local);
    let before = sum_before(block, local);
    for (var step = 0u; step < RANK_BLOCK_FLAGS / LARGE_GROUP; step++) {
        let flag = step * LARGE_GROUP + local;
        let at = block * RANK_BLOCK_FLAGS + flag;
        if at < arrayLength(&keys) {
            let place = cell_slot(at, strip_px);
            let index = before + rank_of(flag);
            if place.first {
                cell_start[place.cell] = index;
            }
            let key = keys[place.slot];
            if key.ordinal != NO_POINT {
                source[index] = index_of(key.ordinal);
                pixels[index] = (place.pixel.y << 16u) | place.pixel.x;
            }
        }
    }
    if block == 0u && local == 0u {
        // The end of the last cell.
        let strips = (frame.size.y + strip_px - 1u) / strip_px;
        cell_start[strips * frame.size.x] = counters[NEAR_FIRST];
    }
}
