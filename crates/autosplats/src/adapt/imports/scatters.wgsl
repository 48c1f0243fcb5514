// Scatter of a ball's points: bits of a standard deviation in world units, with `THICK` set if it is large relative to
// the radius.

const THICK = 0x80000000u;
// The ball holds too few clusters for a fit.
const TOO_FEW = 0xffffffffu;

// Behind the indices of the picked surfels and their number, `picked` has the number of ball sizes that were measured
// before and did not tell the noise.
const MEASURED = MOST_SAMPLED + 1u;

// `sampled` has the indices of the picked surfels, sorted by k-radius, then their number, and from here on the rank of
// each picked surfel. Scatters are in the order of picking.
const RANKS = MOST_SAMPLED + 1u;
