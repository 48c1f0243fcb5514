//! The splat-communication engine: the paper's own k-radius search [Paper, §4, §5, §6], in two forms that take the same
//! steps. The raster form draws, as the paper does; the compute form splats the same boxes in compute shaders.
//!
//! # How the raster form works
//! Points exchange data by drawing. A point draws a *box splat*, two triangles that tightly cover the projection of a
//! sphere about the point. Each fragment loads the point that owns its pixel from a texture of positions and computes
//! the distance. The fragment is discarded or blended into the pixel, as a message to the point there. The depth mask
//! holds the depths of all points, and 1 in empty pixels. Splats are drawn at f(z + r) and pass where that is GREATER.
//! Pixels that are empty or hold points too far away thus fail early-Z and start no fragment. Depths are only read, so
//! discarded fragments do no harm.
//!
//! `begin` sets the numbers of vertices to draw, `mask` draws positions and depths, `ask` marks the queries of a
//! round. Then repeat (Figure 5 of the paper):
//!
//! 1. `distribute`: a query draws its search radius b. A point in the *delta region* between a and b keeps, by MAX
//!    blending in T_F, the distance to the furthest query that reaches it: its *feedback radius*.
//! 2. `gather`: every point draws its feedback radius. Four radii at regular steps from a to b have a counter each in
//!    T_R1. At each query whose delta region holds the point, the point adds 1 to the counters of radii that reach it.
//!    MAX blending in the alpha of T_R2 finds the furthest neighbour.
//! 3. `count` and `decide`: if 99.9 % have converged (t_conv), the arguments of the indirect draws become 0. The rest
//!    of the [`ITERATIONS`](gpu::ITERATIONS) recorded iterations then cost next to nothing. Nothing is read back.
//!
//! The next distribution reads the gathered counts and moves a and b (`imports/radius_search.wgsl`). With fewer than k
//! neighbours b expands by α = √(k/σ). Otherwise the two counters around k are the new bracket, until one equals k.
//! Each point's own fragment hands the bounds on between T_F and T_R2, in the colours, which are added where alpha
//! takes the maximum. A converged point draws only that one pixel. A point that is no query draws only its answers.
//!
//! Finally every query draws the radius found, and two more gathering passes sum the moments, `mean` and `covariance`.
//! The k-radius is the distance to the furthest neighbour summed.
//!
//! # How the compute form differs
//! It visits the same pixels of the same boxes with the same tests, so k-radii and convergence have the same bits.
//!
//! - A workgroup shares out the rows of 256 boxes. Bits tell which pixels have points, so that empty ones cost next to
//!   nothing. The rest of the mask test is made with the point's depth.
//! - Textures are lists with an entry for each screen point. MAX is an atomic maximum of the bits of distances, which
//!   are not negative. ADD is an atomic sum. An answer is counted once, at the least radius that reaches it; sums of
//!   these counts are the four counters.
//! - Bounds stay where they are, so no pass hands them on. A point clears its own counters once it has read them.
//! - Sums of floats would depend on the order of atomics. So in the end every query visits the pixels of its own box
//!   and sums its neighbours itself, row by row (`sum`); nothing is distributed any more.
//!
//! # Where both forms differ from the paper
//!
//! - Converged points are counted by a compute pass over the queries, not by an occlusion query: WebGPU's queries only
//!   tell whether there are any.
//! - Projection is not a raster pass but the compute passes of `project/`, as in all engines; `mask` draws the result.
//! - In the raster form T_F and T_R are cleared by a triangle that the depth mask limits to the pixels of points. The
//!   triangle has no instances once iterations end, so that results stay. A point is a box of two triangles, or of one
//!   pixel where that suffices: WebGPU has no geometry shader.
//! - f(z) is the highest 24 bits of the number, not of the projection matrix, so that no far plane has to be found.
//! - α is √((k+1)/σ), at least 1.15, instead of √(k/σ). Any radius up to the next neighbour will do, and aiming at the
//!   k-th itself misses every second time.
//! - An expansion goes no further than λ allows; the paper checks λ after an expansion. Larger steps would skip gaps,
//!   and the result would depend on the steps.
//! - e0 stands for a radius, reached in as many expansions as λ allows, as in all engines; the paper counts
//!   expansions.
//! - d_max is the lower bound while a radius expands, and a is recomputed from b, because four channels hold no more.
//! - Brackets between equal distances end when narrower than four steps of their floats: all points at the k-th
//!   distance belong. Only lattices need these iterations.
//! - Mean and covariance are both taken about the point itself, which is not counted, as in all engines.
//! - The point itself is told by its pixel, not by its position: points whose distance rounds to 0 remain neighbours.
//! - t_conv applies to each round, active and recovered, not to all points: grid culling makes two searches of one.
//! - Iterations end at t_conv or after 16, because a frame is recorded in advance. With λ near 1 or a large e0,
//!   sixteen steps of √λ or √k may not reach the end of a gap or the outlier radius. Such points count as bounded.
//!
//! See docs/decisions/0015-search-engines.md and 0060-communication-in-compute.md for the costs.
//!
//! # Where the result differs from the other engines
//!
//! Up to 0.1 % of each round's points are unfinished when the iterations end. A point between two counters keeps the
//! wider bound, with one or two neighbours too many. A point still expanding keeps the neighbours met, if any, and
//! counts as *bounded*. The bound on search work of [`search`](super) does not apply: a search without the outlier
//! rule draws splats as wide as the picture. A nearest neighbour beyond the outlier radius makes an outlier with
//! lenient rules too, however many follow ([`OUTLIER_RADIUS_SLACK`](super::OUTLIER_RADIUS_SLACK)): channels hold the
//! furthest point of a radius, not the nearest. Distances between different points that round to 0, in clouds some
//! 1e-19 units wide, count as 0.

pub(crate) mod compute;
pub(crate) mod gpu;
pub(crate) mod raster;
#[cfg(test)]
mod tests;
