//! Adapt: neighbourhoods as large as the noise calls for.
//!
//! # How it works
//! The k neighbours (10 by default) do not determine a plane if their noise is larger than their distance. So the stage
//! tries larger balls around each point: [`SCALES`] of them, each [`STEP`] times as wide as the one before. To the
//! points of a ball a quadric is fitted: a height field with six coefficients. Its slope at the point is free of the
//! bias that a curved or one-sided neighbourhood gives to a plane. A ball of a thousand points costs what a ball of
//! thirty costs, because points are summed up in *cells* (`cells`). Cells are squares of pixels cut into slabs of
//! depth; each level is twice as coarse as the one before. A slab keeps the mean and the count of its points. A ball
//! reads cells of an eighth to a quarter of its radius, where cells are that fine.
//!
//! The noise level is one number for the whole frame (`noise`). It is the residual of quadrics at the first scale at
//! which many sampled points find a surface thinner than their ball. With that number the error of each fit is known in
//! advance. Balls grow until the error is small enough. Each ball counts by how far it agrees with the smaller ones
//! within their errors; a ball that disagrees or scatters more ends the growth. Balls agree on smooth surfaces and
//! disagree at edges. Where the first k neighbours are good enough, the fit stays, which is nearly everywhere in a
//! scan without noise.
//!
//! Balls around each noisy surfel would cost more than the rest of the frame. So quadrics are fitted around the
//! clusters of cells about two points wide, one *sheet* (`sheets`) for each surface in a cell. A surfel blends the
//! sheets of the four cells around it, evaluated at its own place. A sheet counts more the nearer its ball's centre,
//! the nearer its surface and the smaller its error; sheets of other surfaces do not count. The surfel turns to the
//! blended normal and its centre moves onto the surface. A surfel without sheets tries balls of its own. A surfel whose
//! own normal is reliable and unlike all sheets stays where it is.
//!
//! Points of a spinning lidar are dense along a ring and sparse across. The first neighbours of such a point form a
//! *scan line* (`rows`), not a surface. Balls around the surfel grow until they hold more than the scan line.
//!
//! Sparse points that form no surface, such as leaves, may stand before many more points. Their wide discs would hide
//! these, so the discs shrink in proportion (`through`).
//!
//! Neighbours in a depth camera err alike, so balls of these sizes do not show the camera's noise. That noise is
//! estimated from the scan as a whole (`depth`) and used where it is the larger one. Surfels then move along the
//! sensor's ray.
// Differs from the paper: the paper fits every surfel to k neighbours. See docs/decisions/0005-noise-level.md and
// docs/decisions/0006-scale-by-agreement.md.

mod cells;
mod choose;
mod cpu;
mod depth;
pub(crate) mod gpu;
mod noise;
mod quadric;
mod rows;
mod rules;
mod sheets;
#[cfg(test)]
mod tests;
mod through;

pub(crate) use cpu::Adapter;
pub(crate) use depth::DepthNoise;
#[cfg(test)]
pub(crate) use depth::DepthRun;
pub(crate) use noise::{FrameStatistics, Noise};
pub(crate) use rules::AdaptRules;

/// Number of balls tried around each point, besides the neighbourhood that the search found.
pub(crate) const SCALES: usize = 6;
/// Radius of a ball over that of the ball before; of the first ball over the base radius.
pub(crate) const STEP: f32 = 1.6;
/// Least base radius of a surfel's balls, in first search radii; k-radii are too small at gaps and borders.
pub(crate) const MIN_BASE_FIRST_RADII: f32 = 0.8;
