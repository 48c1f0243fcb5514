// Fills the cells of coarser levels from finer ones. A workgroup of LARGE_GROUP takes a tile of TILE×TILE cells of a
// level, and the levels above as far as the tile has whole cells of them. The including pass binds `clusters` for
// writing.

#import clusters
#import divide
#import filling
#import levels

// Coarser levels that a workgroup fills within its tile.
override COARSER: u32;

// The levels, to be set first.
var<workgroup> all_levels: array<Level, MOST_LEVELS>;

// Column and row of a workgroup's tile among those of a level.
fn tile_of(level: Level, group: u32) -> vec2u {
    return divide(group, (level.columns + TILE - 1u) / TILE).yx;
}

// Whether a level exists and has this cell.
fn has_cell(level: Level, place: vec2u) -> bool {
    return level.side_px > 0u && place.x < level.columns && place.y < level.rows;
}

// Fills a cell of a level from the next finer one.
fn merge_cell(index: u32, place: vec2u) {
    let level = all_levels[index];
    let below = all_levels[index - 1u];
    let slabs = slabs_of(level.side_px);
    let low = 2u * place;
    let high = min(low + 2u, vec2u(below.columns, below.rows));
    begin();
    for (var y = low.y; y < high.y; y++) {
        for (var x = low.x; x < high.x; x++) {
            let cell = below.first + y * below.columns + x;
            for (var slab = 0u; slab < SLABS; slab++) {
                let cluster = clusters[cluster_at(cell, slab)];
                if cluster.w == 0.0 {
                    break;
                }
                add(cluster.xyz, cluster.w, slab_of(slabs, cluster.z));
            }
        }
    }
    finish(level.first + place.y * level.columns + place.x);
}

// Fills the levels above `filled` within a tile of that level. To be called by all invocations of a workgroup.
fn merge_tile(filled: u32, tile: vec2u, local: u32) {
    for (var up = 1u; up <= COARSER; up++) {
        // The cells below are those of this workgroup.
        storageBarrier();
        let level = filled + up;
        let side = TILE >> up;
        let place = side * tile + vec2u(local % side, local / side);
        if local < side * side && level < MOST_LEVELS {
            if has_cell(all_levels[level], place) {
                merge_cell(level, place);
            }
        }
    }
}
