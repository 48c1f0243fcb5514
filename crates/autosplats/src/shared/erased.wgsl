// Erasing a splat's depth, pixel by pixel. Imports: frame, splat, depth_map, fragment, redraw. The including pass binds
// `depth_map` and `cells` as atomics.

// Keys this near are taken to be one, and pixels this near to the rim to be covered: passes may round the same sums
// differently. What is erased without need is drawn again.
const ROUNDING = 64u;
const WIDER_RIM = 1.0 + 1e-4;

fn erase_depth(splat: Splat, pixel: vec2u) {
    let key = pushed_depth(splat, pixel, WIDER_RIM);
    let at = pixel.y * frame.size.x + pixel.x;
    if key != NO_DEPTH && key - ROUNDING <= atomicLoad(&depth_map[at]) {
        atomicStore(&depth_map[at], depth_key(infinity()));
        atomicStore(&cells[cell_of(pixel)], 1u);
    }
}
