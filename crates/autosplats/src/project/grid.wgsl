// Chooses the sizes of cells from the mean distance between screen points in covered blocks [Paper, §5.1].
//
// Reads and writes: counters. One invocation.
// Differs from the paper: the paper divides by the whole screen, and its cells are too large for a small object.

#import frame

@group(0) @binding(1) var<storage, read_write> counters: array<u32>;

@compute @workgroup_size(1)
fn grid() {
    let covered_px = f32(counters[BLOCKS] * OCCUPANCY_BLOCK_PX * OCCUPANCY_BLOCK_PX);
    let spacing_px = sqrt(covered_px / f32(max(counters[VISIBLE], 1u)));
    counters[STRIP_PX] = clamp(u32(round(STRIP_SPACINGS * spacing_px)), 1u, 256u);
    let cell_px = max(u32(round(spacing_px * sqrt(f32(frame.k)))), 2u);
    counters[CELL_PX] = cell_px;
    counters[CELL_COLUMNS] = (frame.size.x + cell_px - 1u) / cell_px;
}
