// Whether a passive point is to be reconstructed after all. Imports: frame, counters, density, screen, depth_map, hidden. The
// including pass binds `counters`, `density` and `depth_map`.

// In first search radii: splat/setup.rs says what for.
override RECOVER_REACH: f32;

fn is_back(point: ScreenPoint) -> bool {
    let depth = point.position_view.z;
    if !is_hidden(point.pixel, depth) {
        return true;
    }
    let pixel = pixel_xy(point.pixel);
    let cell_px = counters[CELL_PX];
    let cell = density_cell(pixel, cell_px, counters[CELL_COLUMNS]);
    let last = frame.size - 1u;
    let reach = u32(min(RECOVER_REACH * first_radius_px(density[cell].x, cell_px), 65535.0));
    let low = pixel - min(pixel, vec2u(reach));
    let high = min(pixel + reach, last);
    return !(is_hidden(low.x | (pixel.y << 16u), depth) && is_hidden(high.x | (pixel.y << 16u), depth)
        && is_hidden(pixel.x | (low.y << 16u), depth) && is_hidden(pixel.x | (high.y << 16u), depth));
}
