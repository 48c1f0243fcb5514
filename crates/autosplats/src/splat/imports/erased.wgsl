// Erases a splat's depth, pixel by pixel. The including pass binds `depth_map` and `cells` as atomics.

#import frame
#import depth_map
#import fragment
#import redraw
#import splat

// Tolerances, because passes may round the same sums differently: keys this close count as equal, and pixels this close
// to the rim count as covered. Depths erased needlessly are drawn again.
const MAX_KEY_DIFFERENCE = 64u;
const WIDER_RIM = 1.0 + 1e-4;

fn erase_depth(splat: Splat, line: Line, column: u32) {
    let key = pushed_depth(splat, line, column, WIDER_RIM);
    let at = line.row * frame.size.x + column;
    if key != NO_DEPTH && key - MAX_KEY_DIFFERENCE <= atomicLoad(&depth_map[at]) {
        atomicStore(&depth_map[at], depth_key(infinity()));
        atomicStore(&cells[cell_of(vec2u(column, line.row))], 1u);
    }
}
