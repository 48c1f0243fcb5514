// Which points are near the eye: see `near.rs`. The including pass binds `near` for reading.

#import near_cells

// Cells with points that the search for a point's neighbours met.
var<private> met: array<u32, NEAR_POINTS + 1u>;

// Whether a cell misses no point in the list, of which there are `octaves`.
fn is_listed_cell(cell: u32, octaves: u32) -> bool {
    let count = near[cell];
    return count == 0u || (count <= SPARSE_POINTS && octave_of(cell) < octaves);
}

// Whether a point at a position in view space is near, where the cells of `octaves` are listed.
fn is_near_at(at: vec3f, octaves: u32) -> bool {
    let own = near_cell(at);
    if near[own] > NEAR_POINTS || !is_listed_cell(own, octaves) {
        return false;
    }
    let neighbors = min(frame.k, NEAR_POINTS);
    let away = abs(at);
    var reach = NEAR_REACH * max(max(away.x, away.y), away.z);
    var cells = 0u;
    var points = 0u;
    for (var round = 0u; round < NEAR_REACHES; round++) {
        for (var side = 0u; side < 27u; side++) {
            let step = vec3f(vec3u(side, side / 3u, side / 9u) % 3u) - 1.0;
            let cell = near_cell(at + step * reach);
            if !is_listed_cell(cell, octaves) {
                return false;
            }
            var is_new = near[cell] > 0u && points <= neighbors;
            for (var other = 0u; other < cells && is_new; other++) {
                is_new = met[other] != cell;
            }
            if is_new {
                met[cells] = cell;
                cells += 1u;
                points += near[cell];
            }
        }
        // The point itself is one of them.
        if points > neighbors {
            return true;
        }
        reach *= NEAR_REACH_GROWTH;
    }
    return true;
}
