// Sizes of cells, from the mean distance between screen points in covered blocks [Paper, §5.1].
// Differs from the paper: the paper divides by the whole screen, and its cells are too large for a small object.

#import frame

struct CellSizes {
    // Height of a strip of cells, pixels.
    strip_px: u32,
    // Side of a density cell, pixels.
    cell_px: u32,
    // Density cells per row.
    cell_columns: u32,
}

// The sizes for this many screen points in this many covered blocks.
fn cell_sizes(points: u32, blocks: u32) -> CellSizes {
    let covered_px = f32(blocks * OCCUPANCY_BLOCK_PX * OCCUPANCY_BLOCK_PX);
    let spacing_px = sqrt(covered_px / f32(max(points, 1u)));
    let strip_px = clamp(u32(round(STRIP_SPACINGS * spacing_px)), 1u, 256u);
    let cell_px = max(u32(round(spacing_px * sqrt(f32(frame.k)))), 2u);
    return CellSizes(strip_px, cell_px, (frame.size.x + cell_px - 1u) / cell_px);
}
