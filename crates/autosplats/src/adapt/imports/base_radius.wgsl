// Base radius of the balls around a surfel. The including pass binds `density`.

#import density
#import screen
#import surfel

// First search radius of a surfel's point, world units.
fn initial_radius(surfel: Surfel, cell_px: u32, cell_columns: u32) -> f32 {
    let cell = density[density_cell(pixel_xy(surfel.pixel), cell_px, cell_columns)];
    return first_radius(cell.x, cell_px, surfel.center.z);
}

// Radius in world units whose multiples are the radii of the balls around a surfel.
fn base_radius(surfel: Surfel, cell_px: u32, cell_columns: u32) -> f32 {
    return max(surfel.k_radius, MIN_BASE_FIRST_RADII * initial_radius(surfel, cell_px, cell_columns));
}
