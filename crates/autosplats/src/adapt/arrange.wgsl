// Lays out the levels of cells, whose sizes follow from the density of screen points, and says how many workgroups fill each.
//
// Reads: counters. Writes: levels, arguments. One invocation.

#import frame
#import groups
#import counters
#import levels

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read_write> levels: array<Level>;
@group(0) @binding(3) var<storage, read_write> arguments: array<u32>;

override MOST_LEVELS: u32;

// Side of the finest cells: about the distance between screen points, at least two pixels.
fn finest_side_px() -> u32 {
    // A quotient of exactly a half more is rounded up, also where a division is off in the last place.
    let side = f32(counters[CELL_PX]) / sqrt(f32(frame.k)) * 1.000001;
    return max(u32(floor(side + 0.5)), 2u);
}

@compute @workgroup_size(1)
fn arrange() {
    var level = Level(finest_side_px(), 0u, 0u, 0u);
    level.columns = (frame.size.x + level.side_px - 1u) / level.side_px;
    level.rows = (frame.size.y + level.side_px - 1u) / level.side_px;
    let doublings = firstLeadingBit(max(max(level.columns, level.rows) / 4u, 1u));
    for (var index = 0u; index < MOST_LEVELS; index++) {
        let cells = select(0u, level.columns * level.rows, index <= doublings);
        level.side_px = select(0u, level.side_px, index <= doublings);
        levels[index] = level;
        let groups = (cells + 63u) / 64u;
        arguments[3u * index] = min(groups, GROUPS_PER_ROW);
        arguments[3u * index + 1u] = (groups + GROUPS_PER_ROW - 1u) / GROUPS_PER_ROW;
        arguments[3u * index + 2u] = 1u;
        level.side_px *= 2u;
        level.columns = (level.columns + 1u) / 2u;
        level.rows = (level.rows + 1u) / 2u;
        level.first += cells;
    }
}
