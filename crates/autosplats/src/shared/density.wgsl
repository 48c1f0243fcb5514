// The low-resolution grid of [Paper, §5.1]: square cells of about k screen points.

#import frame
#import divide

struct DensityCell {
    // Number of screen points.
    count: u32,
    // Depth of the nearest point, infinite in an empty cell.
    nearest: f32,
}

// Index of the density cell of a pixel.
fn density_cell(pixel: vec2u, cell_px: u32, columns: u32) -> u32 {
    return divide(pixel.y, cell_px).x * columns + divide(pixel.x, cell_px).x;
}

// Depth beyond which points of a cell are probably hidden: the nearest depth, plus the cell's width in world units
// there [Paper, §7, Grid Culling].
fn culling_depth(nearest: f32, cell_px: u32) -> f32 {
    return nearest + f32(cell_px) * pixel_size(nearest);
}

// First search radius in world units: of the circle that holds k points at the cell's density [Paper, §5.1].
fn initial_radius_of(count: u32, cell_px: u32, depth: f32) -> f32 {
    return initial_radius_px(count, cell_px) * pixel_size(depth);
}

// First search radius in pixels.
fn initial_radius_px(count: u32, cell_px: u32) -> f32 {
    let area_px = f32(cell_px * cell_px);
    return sqrt(area_px * f32(frame.k) / (3.14159265 * f32(count)));
}
