// Flag in the index of a passive point that is reconstructed after all. Screen points are fewer than 2³⁰, so the bit is
// free.
const BACK = 0x80000000u;
