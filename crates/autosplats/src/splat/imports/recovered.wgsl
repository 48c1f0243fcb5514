// Flag in the index of a passive point that is reconstructed after all. Screen points are fewer than 2³⁰, so the bit is
// free.
const RECOVERED_FLAG = 0x80000000u;
