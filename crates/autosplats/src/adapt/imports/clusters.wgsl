// Storage of the cells' clusters: the first `BUNCH` of all cells, then the others, which most cells do not have. The
// including pass binds `clusters`.

// Index of a cell's cluster.
fn cluster_at(cell: u32, slab: u32) -> u32 {
    let before = select(0u, arrayLength(&clusters) / (SLABS / BUNCH), slab >= BUNCH);
    return before + cell * BUNCH + slab % BUNCH;
}
