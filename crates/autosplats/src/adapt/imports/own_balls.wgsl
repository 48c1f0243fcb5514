// Surfels with balls of their own: see the CPU form. The including pass imports `together` or `alone`, and binds what
// `adapted` and `balls` need.

#import frame
#import adapted
#import balls
#import base_radius
#import calls
#import rows
#import surfel

// A surfel of a scan line, turned to its area or thin.
fn turned_row(surfel: Surfel, own_radius: f32) -> Adapted {
    let area = area(surfel, base_radius(surfel, own_radius));
    return Adapted(turned(surfel, area), 0.0, area.radius > 0.0);
}

// The surfel, adapted to noise or its scan line, by the cells of the density grid.
fn adapted_by_balls(surfel: Surfel, cell_px: u32, cell_columns: u32) -> Surfel {
    let known = known_of(surfel);
    let own_radius = own_radius_of(surfel, cell_px, cell_columns);
    var adapted: Adapted;
    if is_row(surfel, known.noise) {
        adapted = turned_row(surfel, own_radius);
    } else {
        adapted = moved_to_surface(surfel, known, own_radius);
    }
    return ended(adapted, own_radius);
}
