// Which surfels of the sample a quantile is of, and what it tells. Imports: nothing.

// The nearest third, the farthest, and all.
const NEAR = 0u;
const FAR = 1u;
const ALL = 2u;
// Not of scatters but of k-radii, of all.
const K_RADII = 3u;

// Too few balls could be fitted; the quantile of all; that of those in which the surface is thin, which are enough.
const NONE_TELL = 0u;
const ALL_TELL = 1u;
const THIN_TELL = 2u;
