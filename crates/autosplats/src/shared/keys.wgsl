// The nearest point of each pixel, or of its halves one after the other: x its index in the cloud, y the bits of its depth.
// Positive floats order as their bits do, so that the pair, taken as one 64-bit number, orders by depth, then by index.

const EMPTY_KEY = 0xffffffffu;
