// How far the points of a ball scatter: bits of a standard deviation in world units, with THICK if it is a large part of the
// radius. Imports: nothing.

const THICK = 0x80000000u;
// The ball holds too little to fit.
const TOO_FEW = 0xffffffffu;
