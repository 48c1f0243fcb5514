// Whether a screen point's splat may affect the picture: the point is in the picture or near its edge. Near is relative
// to the local point density. The including pass binds `density` and `counters`.

#import density
#import picture
#import screen

fn matters(point: ScreenPoint) -> bool {
    let pixel = pixel_xy(point.pixel);
    let beside_px = beside_picture(pixel);
    let cell_px = counters[CELL_PX];
    let cell = density[density_cell(pixel, cell_px, counters[CELL_COLUMNS])];
    return beside_px == 0u || f32(beside_px) <= MARGIN_REACH * first_radius_px(cell.x, cell_px);
}
