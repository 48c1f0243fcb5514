// Fills the finest cells with screen points: an invocation per cell.
//
// Reads: counters, levels, cell_start, points. Writes: clusters.

#import frame
#import divide
#import filling
#import groups
#import levels
#import screen

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> levels: array<Level>;
@group(0) @binding(3) var<storage, read> cell_start: array<u32>;
@group(0) @binding(4) var<storage, read> points: array<ScreenPoint>;
@group(0) @binding(5) var<storage, read_write> clusters: array<vec4f>;

@compute @workgroup_size(SMALL_GROUP)
fn fill(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let level = levels[0];
    let index = group_index(workgroup) * SMALL_GROUP + local;
    if index >= level.columns * level.rows {
        return;
    }
    let slabs = slabs_of(level.side_px);
    let low = place_in(level, index) * level.side_px;
    // Exclusive.
    let high = min(low + level.side_px, frame.size);
    let strip_px = counters[STRIP_PX];
    let last = divide(high.y - 1u, strip_px).x;
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
    finish(index);
}
