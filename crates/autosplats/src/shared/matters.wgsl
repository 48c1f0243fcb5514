// Whether a screen point's splat may affect the picture: the point is near the eye, in the picture, or close to its
// edge. Close is relative to the local point density, that of the point's density cell.

#import density
#import picture
#import screen

fn matters(point: ScreenPoint, cell: DensityCell, cell_px: u32) -> bool {
    if is_silent(point) || has_near_flag(point.pixel) {
        return !is_silent(point);
    }
    let beside_px = beside_picture(pixel_xy(point.pixel));
    return beside_px == 0u || f32(beside_px) <= MARGIN_REACH * initial_radius_px(cell.count, cell_px);
}
