// Marks the empty pixels and the cores of each block of pixels. In frames with noise, also counts the sixteenths with
// points in each block, and marks empty blocks. An invocation per block.
//
// Reads: cover, sixteenths, statistics. Writes: blocks.

#import frame
#import blocks
#import groups
#import layers
#import noise
#import patches
#import picture

@group(0) @binding(1) var<storage, read> cover: array<Cover>;
@group(0) @binding(2) var<storage, read> sixteenths: array<u32>;
@group(0) @binding(3) var<storage, read> statistics: FrameStatistics;
@group(0) @binding(4) var<storage, read_write> blocks: array<Block>;

@compute @workgroup_size(SMALL_GROUP)
fn sum_blocks(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let at = group_index(workgroup) * SMALL_GROUP + local;
    let all = block_counts();
    if at >= all.x * all.y {
        return;
    }
    let first = BLOCK_PX * vec2u(at % all.x, at / all.x);
    let end = min(first + BLOCK_PX, frame.size);
    let is_left_empty = cover[patch_mark(first)].point == LEFT_EMPTY;
    var rims = 0u;
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            var rim = EMPTY_RIM;
            if !is_left_empty {
                rim = cover[y * frame.size.x + x].rim;
            }
            let bit = BLOCK_PX * (y - first.y) + x - first.x;
            rims |= select(select(0u, 0x10000u, rim < EMPTY_RIM), 1u, rim == EMPTY_RIM) << bit;
        }
    }
    blocks[at].rims = rims;
    if !(statistics.noise.level > 0.0) {
        return;
    }
    var held = 0u;
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            let pixel = y * frame.size.x + x;
            held += countOneBits((sixteenths[pixel / 2u] >> (16u * (pixel % 2u))) & 0xffffu);
        }
    }
    let pixels = (end.x - first.x) * (end.y - first.y);
    let is_empty = countOneBits(rims & 0xffffu) == pixels;
    // Most of the margin has no splats, although it may hold a surface.
    let goes_on = held > 0u && beside_picture(first) > 0u && beside_picture(first + BLOCK_PX - 1u) > 0u;
    blocks[at].held = held | select(0u, EMPTY_BLOCK, is_empty && !goes_on);
}
