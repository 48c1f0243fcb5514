// Lays out the levels of cells, whose sizes follow from the density of screen points. Counts the workgroups that fill
// each level, then those that fit sheets. Resets the number of picked surfels.
//
// Reads: counters. Writes: levels, arguments, picked. One invocation.

#import frame
#import levels
#import put_work

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read_write> levels: array<Level>;
@group(0) @binding(3) var<storage, read_write> arguments: array<Dispatch>;
@group(0) @binding(4) var<storage, read_write> picked: array<u32>;

override MOST_FINEST: u32;
// Cells of a workgroup that fits sheets.
override ITEMS_PER_GROUP: u32;

// Columns and rows of cells in a picture.
fn cells_across(side_px: u32) -> vec2u {
    return (frame.size + side_px - 1u) / side_px;
}

// Side of the finest cells in pixels: about the distance between screen points, at least 2, more in a large picture.
fn finest_side_px() -> u32 {
    var least = 2u;
    while cells_across(least).x * cells_across(least).y > MOST_FINEST {
        least++;
    }
    // The factor rounds a quotient of exactly a half up even if the division is off in the last place.
    let side = f32(counters[CELL_PX]) / sqrt(f32(frame.k)) * 1.000001;
    return max(u32(floor(side + 0.5)), least);
}

@compute @workgroup_size(1)
fn arrange() {
    picked[MOST_SAMPLED] = 0u;
    var level = Level(finest_side_px(), 0u, 0u, 0u);
    level.columns = cells_across(level.side_px).x;
    level.rows = cells_across(level.side_px).y;
    let doublings = firstLeadingBit(max(max(level.columns, level.rows) / 4u, 1u));
    for (var index = 0u; index < MOST_LEVELS; index++) {
        let cells = select(0u, level.columns * level.rows, index <= doublings);
        level.side_px = select(0u, level.side_px, index <= doublings);
        levels[index] = level;
        put_work(index, cells, SMALL_GROUP);
        // The finest level that may have sheets has the most cells.
        if index == SHEET_LEVELS[0] {
            put_work(WORK_SHEETS, cells, ITEMS_PER_GROUP);
        }
        level.side_px *= 2u;
        level.columns = (level.columns + 1u) / 2u;
        level.rows = (level.rows + 1u) / 2u;
        level.first += cells;
    }
}
