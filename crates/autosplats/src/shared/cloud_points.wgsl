// The points of a chunk of a cloud or a pool. The including pass binds `chunk` and `positions`.
//
// Points have origins of their own in slots of successive indices; a whole cloud is one slot.

// A run of points, in a buffer of its own.
struct Chunk {
    // Index in the cloud of its first point.
    first: u32,
    len: u32,
    // Words of values per point: a colour, sRGB in the low three bytes, then the bits of a number.
    values: u32,
    // Binary logarithm of the number of points in a slot.
    slot_shift: u32,
    // Place of the first slot in the positions. A slot has five numbers: the eye about its origin, how many of its
    // points are drawn, and how many slots further on their ordinals are.
    slots: u32,
}

fn slot_place(at: u32) -> u32 {
    return chunk.slots + 5u * (at >> chunk.slot_shift);
}

// Whether there is a point at this place in the chunk that is to be drawn.
fn is_drawn(at: u32) -> bool {
    let place_in_slot = at & ((1u << chunk.slot_shift) - 1u);
    return at < chunk.len && f32(place_in_slot) < positions[slot_place(at) + 3u];
}

// Ordinal of the point at this place in the chunk: see `project/slots.rs`.
fn ordinal_of(at: u32) -> u32 {
    return chunk.first + at + (u32(i32(positions[slot_place(at) + 4u])) << chunk.slot_shift);
}

// From the eye to the point at this place in the chunk, in world axes.
fn from_eye(at: u32) -> vec3f {
    let slot = slot_place(at);
    let eye = vec3f(positions[slot], positions[slot + 1u], positions[slot + 2u]);
    return vec3f(positions[3u * at], positions[3u * at + 1u], positions[3u * at + 2u]) - eye;
}
