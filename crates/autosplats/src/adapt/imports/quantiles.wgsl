// Parts of the sample that quantiles of the scatter are computed for, and kinds of results.

// The densest third, the sparsest third, the whole sample, and the whole sample adjusted by the steady shares.
const DENSEST = 0u;
const SPARSEST = 1u;
const ALL = 2u;
const STEADY_ALL = 3u;

struct Quantile {
    kind: u32,
    // A scatter, world units, or a share.
    value: f32,
}

// Kinds: too few balls for a result; a quantile of all balls; a quantile of the balls in which the surface is thin.
const TOO_FEW_BALLS = 0u;
const OF_ALL_BALLS = 1u;
const OF_THIN_BALLS = 2u;
