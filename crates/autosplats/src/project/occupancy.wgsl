// Erases points far behind the other point of their pixel. Counts the screen points, and the blocks of pixels that hold
// any. These blocks are the covered part of the screen, whose density determines the sizes of cells. Also counts the
// sixteenths with points in each small block, for the trim.
//
// Reads: sixteenths. Reads and writes: keys. Writes: counters, held. One workgroup per block.

#import frame
#import divide
#import groups
#import held
#import keys

@group(0) @binding(1) var<storage, read_write> keys: array<Key>;
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read> sixteenths: array<u32>;
@group(0) @binding(4) var<storage, read_write> held: array<u32>;

// Small blocks along the side of a block.
const SMALL_BLOCKS = OCCUPANCY_BLOCK_PX / COUNTED_BLOCK_PX;

var<workgroup> owned: atomic<u32>;
var<workgroup> held_here: array<atomic<u32>, SMALL_BLOCKS * SMALL_BLOCKS>;

@compute @workgroup_size(OCCUPANCY_BLOCK_PX * OCCUPANCY_BLOCK_PX)
fn occupancy(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&owned, 0u);
    }
    if local < SMALL_BLOCKS * SMALL_BLOCKS {
        atomicStore(&held_here[local], 0u);
    }
    workgroupBarrier();
    let columns = (frame.size.x + OCCUPANCY_BLOCK_PX - 1u) / OCCUPANCY_BLOCK_PX;
    let block = divide(group_index(workgroup), columns);
    let at = vec2u(local % OCCUPANCY_BLOCK_PX, local / OCCUPANCY_BLOCK_PX);
    let pixel = OCCUPANCY_BLOCK_PX * block.yx + at;
    if all(pixel < frame.size) {
        let marks = pixel_sixteenths(pixel);
        if marks != 0u {
            let first = half_sixteenths(pixel, 0u);
            let has_both = frame.halves == 1u && (marks & first) != 0u && (marks & ~first) != 0u;
            let erases = has_both && erase_far(2u * (pixel.y * frame.size.x + pixel.x));
            atomicAdd(&owned, select(1u, 2u, has_both && !erases));
            let of_block = at / COUNTED_BLOCK_PX;
            atomicAdd(&held_here[of_block.y * SMALL_BLOCKS + of_block.x], countOneBits(marks));
        }
    }
    workgroupBarrier();
    let small_blocks = (frame.size + COUNTED_BLOCK_PX - 1u) / COUNTED_BLOCK_PX;
    let small = SMALL_BLOCKS * block.yx + vec2u(local % SMALL_BLOCKS, local / SMALL_BLOCKS);
    if local < SMALL_BLOCKS * SMALL_BLOCKS && all(small < small_blocks) {
        held[small.y * small_blocks.x + small.x] = atomicLoad(&held_here[local]);
    }
    if local == 0u && atomicLoad(&owned) > 0u {
        atomicAdd(&counters[NEAR_FIRST], atomicLoad(&owned));
        atomicAdd(&counters[BLOCKS], 1u);
    }
}

// Empties the slot of a pixel's farther point if it lies too far behind the nearer; returns whether it does.
fn erase_far(slot: u32) -> bool {
    let depth = bitcast<vec2f>(vec2u(depth_of(keys[slot]), depth_of(keys[slot + 1u])));
    let near = min(depth.x, depth.y);
    if max(depth.x, depth.y) <= near + MAX_SECOND_DEPTH_PX * pixel_size(near) {
        return false;
    }
    keys[slot + u32(depth.y > depth.x)] = EMPTY_KEY;
    return true;
}
