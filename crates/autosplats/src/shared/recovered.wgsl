// Set in the index of a passive point that is reconstructed after all. There are fewer points than pixels, so that it is free.
const BACK = 0x80000000u;
