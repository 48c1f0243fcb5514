// Screen points summed up in cells of several sizes, finest first, each level's twice as wide as those before. Imports: nothing.

// Slabs of depth in a cell. A cell has that many clusters, those used first: the mean of some points, view space, and their
// number, 0 after the last.
const SLABS = 8u;
// Those of them that lie side by side.
const BUNCH = 4u;

struct Level {
    // Side of a cell in pixels; 0 if there is no such level.
    side_px: u32,
    columns: u32,
    rows: u32,
    // Its first cell.
    first: u32,
}
