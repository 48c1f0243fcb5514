// Cells around the eye, by direction and octave of distance: see `near.rs`. The including pass binds `near`: the number
// of points of each cell, then SPARSE_POINTS entries for each cell: index and bits of the position of a point.

#import frame

fn octave_of(cell: u32) -> u32 {
    return cell / OCTAVE_CELLS;
}

// Cell of a position in view space.
fn near_cell(at: vec3f) -> u32 {
    let away = abs(at);
    let most = max(max(away.x, away.y), away.z);
    var face = 4u;
    var along = at.z;
    var aside = at.xy;
    if away.x == most {
        face = 0u;
        along = at.x;
        aside = at.yz;
    } else if away.y == most {
        face = 2u;
        along = at.y;
        aside = at.xz;
    }
    face += u32(along < 0.0);
    let half = 0.5 * f32(FACE_CELLS);
    let place = min(vec2u(max(aside * (half / most) + half, vec2f(0.0))), vec2u(FACE_CELLS - 1u));
    let first_octave = (bitcast<u32>(frame.near) >> 23u) + FIRST_OCTAVE;
    let exponent = bitcast<u32>(most) >> 23u;
    let octave = min(max(exponent, first_octave) - first_octave, OCTAVES - 1u);
    return ((octave * 6u + face) * FACE_CELLS + place.y) * FACE_CELLS + place.x;
}

// First word of the entries of a cell.
fn near_entries(cell: u32) -> u32 {
    return NEAR_CELLS + cell * SPARSE_POINTS * ENTRY_WORDS;
}
