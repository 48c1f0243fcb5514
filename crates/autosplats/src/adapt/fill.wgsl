// Lays out the levels of cells, and fills the finest with screen points: an invocation per cell. A workgroup takes a
// tile of cells and fills coarser levels within it. Discards the sheets of the last frame.
//
// Reads: counters, cell_start, points. Writes: levels, asked, sheets. Reads and writes: clusters.

#import frame
#import divide
#import filling
#import groups
#import layout
#import levels
#import merging
#import screen
#import sheet

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read_write> levels: array<Level>;
@group(0) @binding(3) var<storage, read> cell_start: array<u32>;
@group(0) @binding(4) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(5) var<storage, read_write> clusters: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> asked: array<Asked>;
@group(0) @binding(7) var<storage, read_write> sheets: array<Sheet>;

@compute @workgroup_size(LARGE_GROUP)
fn fill(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        lay_out(counters[CELL_PX]);
    }
    workgroupBarrier();
    let group = group_index(workgroup);
    if group == 0u && local < MOST_LEVELS {
        levels[local] = all_levels[local];
    }
    forget(group * LARGE_GROUP + local);
    let tile = tile_of(all_levels[0], group);
    let place = TILE * tile + vec2u(local % TILE, local / TILE);
    if has_cell(all_levels[0], place) {
        fill_cell(place);
    }
    merge_tile(0u, tile, local);
}

// Sums up the points of a finest cell.
fn fill_cell(place: vec2u) {
    let level = all_levels[0];
    let slabs = slabs_of(level.side_px);
    let low = place * level.side_px;
    // Exclusive.
    let high = min(low + level.side_px, frame.size);
    let strip_px = counters[STRIP_PX];
    let last = divide(high.y - 1u, strip_px).x;
    begin();
    // A strip's points are stored column by column, so those of a cell's columns are contiguous.
    for (var strip = divide(low.y, strip_px).x; strip <= last; strip++) {
        let row = strip * frame.size.x;
        let end = cell_start[row + high.x];
        for (var at = cell_start[row + low.x]; at < end; at++) {
            let point = points[at];
            let y = pixel_xy(point.pixel).y;
            if y >= low.y && y < high.y {
                add(point.position_view, 1.0, slab_of(slabs, point.position_view.z));
            }
        }
    }
    finish(place.y * level.columns + place.x);
}

// Discards the sheets of a cell. There are as many invocations as finest cells at least, and sheets in coarser ones.
fn forget(cell: u32) {
    let level = all_levels[SHEET_LEVELS[0]];
    if level.side_px > 0u && cell < level.columns * level.rows {
        asked[cell] = Asked(0u, 0u, NO_POINT);
        for (var index = 0u; index < SHEETS; index++) {
            sheets[cell * SHEETS + index].radius = UNKNOWN;
        }
    }
}
