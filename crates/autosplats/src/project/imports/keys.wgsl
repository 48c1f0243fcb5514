// Keys of the nearest point per slot, which is a pixel or half of one. All bits are inverted, so that an empty slot is
// zero, as new buffers are. Positive floats have the order of their bits: as a 64-bit number, a key is the larger the
// nearer its point is, then the lower its ordinal.
//
// Keys are empty between frames, so none clears them. `compact` empties what it lists, `occupancy` what it erases.
// The steps of projection are submitted together, and a submission runs whole or not at all. A device that fails while
// it runs is lost, with its buffers. The host gives up no frame between these: where each is timed by itself, each
// is a submission, and all are made. Every slot is visited, whatever the counters say.

struct Key {
    // Inverted ordinal of the point; 0 in an empty slot, because no ordinal is the largest number.
    ordinal: u32,
    // Inverted bits of the depth.
    depth: u32,
}

const EMPTY_KEY = Key(0u, 0u);

fn is_owned(key: Key) -> bool {
    return key.ordinal != 0u;
}

// Bits of the depth of an owner.
fn depth_of(key: Key) -> u32 {
    return ~key.depth;
}
