// The clusters of cells: the first ones of all, then those that follow, which most cells have none of. Imports: levels. The
// including pass binds `clusters`.

// Where a cluster of a cell is.
fn cluster_at(cell: u32, slab: u32) -> u32 {
    let before = select(0u, arrayLength(&clusters) / (SLABS / BUNCH), slab >= BUNCH);
    return before + cell * BUNCH + slab % BUNCH;
}
