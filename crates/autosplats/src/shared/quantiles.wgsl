// Which surfels of the sample a quantile is of, and what it tells. Imports: nothing.

// The densest third, the sparsest, all, and all by the steady shares.
const DENSEST = 0u;
const SPARSEST = 1u;
const ALL = 2u;
const STEADY_ALL = 3u;
// How many there are.
const PARTS = 4u;

// Too few balls could be fitted; the quantile of all; that of those in which the surface is thin, which are enough.
const NONE_TELL = 0u;
const ALL_TELL = 1u;
const THIN_TELL = 2u;
