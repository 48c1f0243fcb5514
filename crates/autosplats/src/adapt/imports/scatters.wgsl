// Scatter of a ball's points: bits of a standard deviation in world units, with `THICK` set if it is large relative to
// the radius.

const THICK = 0x80000000u;
// The ball holds too few clusters for a fit.
const TOO_FEW = 0xffffffffu;
