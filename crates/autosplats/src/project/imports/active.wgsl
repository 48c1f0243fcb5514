// Which screen points are active: those that matter, unless grid culling postpones them [Paper, §7, Grid Culling].

#import frame
#import density
#import matters
#import screen

fn is_active(point: ScreenPoint, cell: DensityCell, cell_px: u32) -> bool {
    let may_cull = frame.grid_culling == 1u && !has_near_flag(point.pixel);
    let is_culled = may_cull && point.position_view.z > culling_depth(cell.nearest, cell_px);
    return matters(point, cell, cell_px) && !is_culled;
}
