// Which points are near the eye: see `near.rs`. The including pass binds `near` for reading.

#import near_cells

// Whether a point at a position in view space is near. `crowded` is the octave of the nearest crowded cell.
fn is_near_at(at: vec3f, crowded: u32) -> bool {
    let own = near_cell(at);
    if near[own] > NEAR_POINTS || octave_of(own) > crowded {
        return false;
    }
    let away = abs(at);
    let reach = NEAR_REACH * max(max(away.x, away.y), away.z);
    for (var side = 0u; side < 27u; side++) {
        let step = vec3f(vec3u(side, side / 3u, side / 9u) % 3u) - 1.0;
        if near[near_cell(at + step * reach)] > SPARSE_POINTS {
            return false;
        }
    }
    return true;
}
