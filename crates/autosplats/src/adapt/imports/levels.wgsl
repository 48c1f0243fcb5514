// Levels of cells that sum up the screen points, finest first; cells double in width from level to level.

struct Level {
    // Side of a cell in pixels; 0 if the level does not exist.
    side_px: u32,
    columns: u32,
    rows: u32,
    // Index of its first cell.
    first: u32,
}
