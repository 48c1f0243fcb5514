// First search radius of a screen point, world units [Paper, §5.1]. The including pass binds `density` and `counters`.

#import density
#import screen

fn first_radius(point: ScreenPoint) -> f32 {
    let cell_px = counters[CELL_PX];
    let cell = density_cell(pixel_xy(point.pixel), cell_px, counters[CELL_COLUMNS]);
    return max(initial_radius_of(density[cell].count, cell_px, point.position_view.z), MIN_POSITIVE);
}
