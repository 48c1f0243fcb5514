// Keys of the nearest point per slot, which is a pixel or half of one. x is the index in the cloud, y the bits of the
// depth. Positive floats have the order of their bits, so the pair as a 64-bit number orders by depth, then by index.

const EMPTY_KEY = 0xffffffffu;
