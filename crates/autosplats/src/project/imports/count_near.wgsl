// Counts a point in the cells around the eye, and keeps its ordinal while the cell is sparse. The including pass binds
// `near` as atomics.

#import frame
#import near_cells
#import project_point

fn count_near(projected: Projected, ordinal: u32) {
    if frame.near_cells == 0u || projected.slot == SLOT_NOT_FINITE {
        return;
    }
    let cell = near_cell(projected.position_view);
    // Most cells are crowded; a plain load shows this.
    if atomicLoad(&near[cell]) <= SPARSE_POINTS {
        let at = atomicAdd(&near[cell], 1u);
        if at < SPARSE_POINTS {
            let entry = near_entries(cell) + at * ENTRY_WORDS;
            let bits = bitcast<vec3u>(projected.position_view);
            atomicStore(&near[entry], ordinal);
            atomicStore(&near[entry + 1u], bits.x);
            atomicStore(&near[entry + 2u], bits.y);
            atomicStore(&near[entry + 3u], bits.z);
        }
    }
}
