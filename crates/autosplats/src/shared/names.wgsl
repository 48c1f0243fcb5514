// Names and ordinals of points: see `project/slots.rs`. The including pass binds `names`: a shift, then for each slot
// the name of its first point, beside the index of the first point of the run of that number.

fn name_of(index: u32) -> u32 {
    return names[1u + 2u * (index >> names[0])] + (index & ((1u << names[0]) - 1u));
}

fn index_of(ordinal: u32) -> u32 {
    return names[2u + 2u * (ordinal >> names[0])] + (ordinal & ((1u << names[0]) - 1u));
}
