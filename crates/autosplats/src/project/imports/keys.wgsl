// Keys of the nearest point per slot, which is a pixel or half of one. Positive floats have the order of their bits, so
// a key as a 64-bit number orders by depth, then by ordinal.

struct Key {
    // Ordinal of the point; `NO_POINT` in an empty slot.
    ordinal: u32,
    // Bits of the depth.
    depth: u32,
}

const EMPTY_KEY = Key(NO_POINT, 0xffffffffu);
