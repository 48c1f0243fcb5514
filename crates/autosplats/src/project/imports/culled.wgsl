// Whether grid culling postpones a screen point [Paper, §7, Grid Culling]. The including pass binds `density` and
// `counters`.

#import frame
#import density
#import screen

fn is_culled(point: ScreenPoint) -> bool {
    let cell_px = counters[CELL_PX];
    let cell = density[density_cell(pixel_xy(point.pixel), cell_px, counters[CELL_COLUMNS])];
    return frame.grid_culling == 1u && point.position_view.z > culling_depth(bitcast<f32>(cell.y), cell_px);
}
