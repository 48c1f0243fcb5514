// Lists the owners of slots in cell order, empties their slots, and stores the start of each cell. The first workgroup
// puts indices for the ordinals that `count` listed.
//
// Reads: counters, block_sums, names, sixteenths. Reads and writes: keys, source. Writes: pixels, cell_start.

#import frame
#import cell_order
#import groups
#import held
#import keys
#import names
#import rank
#import sum_before

@group(0) @binding(1) var<storage, read_write> keys: array<Key>;
@group(0) @binding(2) var<storage, read> counters: array<u32>;
@group(0) @binding(3) var<storage, read> block_sums: array<u32>;
@group(0) @binding(4) var<storage, read_write> source: array<u32>;
@group(0) @binding(5) var<storage, read_write> pixels: array<u32>;
@group(0) @binding(6) var<storage, read_write> cell_start: array<u32>;
@group(0) @binding(7) var<storage, read> names: array<u32>;
@group(0) @binding(8) var<storage, read> sixteenths: array<u32>;

@compute @workgroup_size(LARGE_GROUP)
fn compact(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    rank_clear(local);
    let block = group_index(workgroup);
    let strip_px = counters[STRIP_PX];
    var owned_steps = 0u;
    for (var step = 0u; step < RANK_BLOCK_FLAGS / LARGE_GROUP; step++) {
        let flag = step * LARGE_GROUP + local;
        let at = block * RANK_BLOCK_FLAGS + flag;
        if at < arrayLength(&keys) {
            let place = cell_slot(at, strip_px);
            if is_held(place.pixel, place.half) && is_owned(keys[place.slot]) {
                rank_set(flag);
                owned_steps |= 1u << step;
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
            if (owned_steps & (1u << step)) != 0u {
                source[index] = index_of(~keys[place.slot].ordinal);
                keys[place.slot] = EMPTY_KEY;
                pixels[index] = (place.pixel.y << 16u) | place.pixel.x;
            }
        }
    }
    if block == 0u {
        let near_first = counters[NEAR_FIRST];
        for (var listed = near_first + local; listed < counters[VISIBLE]; listed += LARGE_GROUP) {
            source[listed] = index_of(source[listed]);
        }
        if local == 0u {
            // The end of the last cell.
            let strips = (frame.size.y + strip_px - 1u) / strip_px;
            cell_start[strips * frame.size.x] = near_first;
        }
    }
}
