//! The splat-communication engine: the paper's own k-radius search, on the raster pipeline [Paper, §4, §5, §6].
//!
//! # How it works
//! Points tell each other things by drawing. A point draws a *box splat*, two triangles that tightly cover the projection
//! of a sphere about it; each fragment loads the one point that owns its pixel from a texture of positions, finds the
//! distance, and is discarded or blended into the pixel: a message to the point there. The depth mask holds the depths of all
//! points, and 1 where there is none. Splats are drawn at f(z + r) and pass where that is GREATER, so that pixels that are
//! empty or hold points too far away fail early-Z and start no fragment; depths are only read, so it does not matter that
//! fragments are discarded.
//!
//! `begin` says how much there is to draw, `mask` draws positions and depths, `ask` marks the queries of a round. Then,
//! again and again (Figure 5 of the paper):
//!
//! 1. `distribute`: a query draws its search radius b. A point within it, if it lies in the *delta region* between a and b,
//!    keeps by MAX blending the distance to the furthest that asks, its *feedback radius*, in T_F.
//! 2. `gather`: every point draws its feedback radius. At each query whose delta region it lies in it adds 1 to those of four
//!    counters, in T_R1, whose radius reaches it: the radii are at regular steps from a to b. MAX blending in the alpha
//!    of T_R2 finds the furthest neighbour.
//! 3. `count` and `decide`: if 99.9 % have converged (t_conv), the arguments of the indirect draws become 0, and the
//!    iterations left, of [`ITERATIONS`](gpu::ITERATIONS) recorded, cost next to nothing. Nothing is read back.
//!
//! The next distribution reads what was gathered and moves a and b (`shared/radius_search.wgsl`): with fewer than k neighbours
//! b expands by α = √(k/σ), else the two counters about k are the new bracket, until one is k. Bounds are handed on between T_F
//! and T_R2 by each point's own fragment, in colours, which are added where alpha takes the greatest; a converged point
//! draws that one pixel only. What is no query has nothing to hand on, and draws nothing but its answers.
//!
//! At last every query draws the radius found, and two more gathering passes sum up the moments, `mean` and `covariance`;
//! the k-radius is the distance to the furthest neighbour that was summed.
//!
//! # Where it differs from the paper
//!
//! | | the paper | here | why, and what it costs |
//! |---|---|---|---|
//! | counting converged points | an occlusion query | a compute pass over the queries | WebGPU's queries tell only whether there were any; about 1 % of the search |
//! | projection | a raster pass | the compute passes of `project/`; `mask` draws what they found | shared by the engines; one more pass of one-pixel splats |
//! | where T_F and T_R are empty | cleared | cleared by a triangle that the depth mask holds to the pixels of points | has no instances once iterations end, so that results stay; nothing |
//! | points | one primitive each | a box of two triangles, of one pixel where that is all | WebGPU has no geometry shader; six vertices for each point |
//! | f(z) | of the projection matrix | the highest 24 bits of the number | no far plane has to be found; as many fragments but for 1/65536 of z |
//! | α | √(k/σ) | √((k+1)/σ), and 1.15 at least | any radius up to the next neighbour will do, aiming at the k-th misses it every second time; saves an iteration, splats 5 % wider at k = 10 |
//! | λ | looked at after an expansion | an expansion goes no further than the gap allows | an expansion would step over gaps, and the answer depend on the steps; some expansions by 2 instead of √k |
//! | e0 | 3 to 4 expansions | a radius, reached in as many expansions as λ allows | the same for all engines; one expansion more at e0 = 1 |
//! | d_max | tracked | is the lower bound while a radius expands, and a is found from b | four channels hold no more; a few instructions |
//! | brackets between equal distances | – | end when narrower than four steps of their numbers | all points at the k-th distance belong; about 14 iterations, which only lattices need |
//! | mean, then covariance about it | | both about the point itself, which is not counted | what all engines hand on; nothing |
//! | the point itself | told from others by its position | by its pixel, which holds one point | points so near that their distance rounds to 0 are neighbours still; nothing |
//! | t_conv | of all points | of each round's, active and recovered | grid culling makes two searches of one; at most as many are left in all |
//! | end of iterations | at t_conv | at t_conv or after 16 | a frame is recorded before it is known; sixteen steps of √λ or √k may not reach the end of a gap or the outlier radius, with λ near 1 or a large e0: such points are counted as bounded |
//!
//! # What differs from the other engines' answer
//!
//! Up to 0.1 % of each round's points are left when the iterations end. Those between two counters keep the wider bound: one or
//! two neighbours too many. Those still expanding keep the neighbours met, if any, and are counted as *bounded*. The bound on
//! search work of [`search`](super) is not kept: a search without the outlier rule draws splats as wide as the picture.
//! A nearest neighbour beyond the outlier radius makes an outlier with adaptive rules as well, however many follow
//! ([`STEEP`](super::STEEP)): channels hold the furthest of a radius, not the nearest.
//! Distances that round to 0 although the points differ, in clouds some 1e-19 units wide, count as such.

pub(crate) mod gpu;
