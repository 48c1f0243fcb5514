// Counts screen points, and the blocks of 16² pixels that hold any: the covered part of the screen, whose density says how
// large cells must be.
//
// Reads: keys. Writes: counters. One workgroup per block.

#import frame
#import groups
#import counters
#import keys
#import divide

@group(0) @binding(1) var<storage, read> keys: array<vec2u>;
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;

var<workgroup> owned: atomic<u32>;

@compute @workgroup_size(256)
fn occupancy(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&owned, 0u);
    }
    workgroupBarrier();
    let columns = (frame.size.x + 15u) / 16u;
    let block = divide(group_index(workgroup), columns);
    let pixel = 16u * block.yx + vec2u(local % 16u, local / 16u);
    if all(pixel < frame.size) && keys[pixel.y * frame.size.x + pixel.x].x != EMPTY_KEY {
        atomicAdd(&owned, 1u);
    }
    workgroupBarrier();
    if local == 0u && atomicLoad(&owned) > 0u {
        atomicAdd(&counters[VISIBLE], atomicLoad(&owned));
        atomicAdd(&counters[BLOCKS], 1u);
    }
}
