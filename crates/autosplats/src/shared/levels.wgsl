// Levels of cells that sum up the screen points, finest first; cells double in width from level to level. Imports:
// nothing.

// Slabs of depth in a cell, each with a cluster: the mean position of some points, view space, and their number. The
// used clusters come first; the others have number 0.
const SLABS = 8u;
// Clusters of a cell that are stored side by side.
const BUNCH = 4u;

struct Level {
    // Side of a cell in pixels; 0 if the level does not exist.
    side_px: u32,
    columns: u32,
    rows: u32,
    // Index of its first cell.
    first: u32,
}
