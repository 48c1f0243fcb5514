// Whether a screen point's splat may matter to the picture: it lies in it, or not far beside for how dense points are there.
// Imports: frame, density, screen, counters, picture. The including pass binds `density` and `counters`.

// In first search radii: project/mod.rs says what for.
override MARGIN_REACH: f32;

fn matters(point: ScreenPoint) -> bool {
    let pixel = pixel_xy(point.pixel);
    let beside_px = beside_picture(pixel);
    let cell_px = counters[CELL_PX];
    let cell = density[density_cell(pixel, cell_px, counters[CELL_COLUMNS])];
    return beside_px == 0u || f32(beside_px) <= MARGIN_REACH * first_radius_px(cell.x, cell_px);
}
