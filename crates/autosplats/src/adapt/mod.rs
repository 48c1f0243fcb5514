//! Adapt: neighbourhoods as large as the noise calls for.
//!
//! # How it works
//! Ten neighbours tell nothing of a plane that scatters further than they are apart. So larger balls around each point are
//! tried, [`SCALES`] of them, each [`STEP`] times as wide as the one before, and a quadric is fitted to what lies in them: a
//! height field with six coefficients, whose slope at the point is free of the bias that curved or one-sided surroundings give
//! to a plane. A ball of a thousand points costs what one of thirty does, because it is summed up in *cells* (`cells`):
//! squares of pixels cut into slabs of depth, each level twice as coarse as the one before, of which only the mean and the
//! count are kept. A ball reads cells of between an eighth and a quarter of its radius, where there are so fine ones.
//!
//! How far points scatter is one number for the whole frame (`noise`): it is what is left of the quadrics at the first scale
//! where many of a sample of points find a surface thinner than their ball is wide. With that number the error of each fit is
//! known beforehand. Balls grow until it is small enough; each counts as far as it agrees with what the smaller ones gave
//! within their errors, and one that does not, or scatters more, is the last: on smooth surfaces they agree, at edges not.
//! Where the first ten neighbours are good enough, the fit stays as it was; nearly everything does in a scan without noise.
//!
//! Where they are not, balls are not tried around each surfel, which would cost more than all else in a frame, but around
//! the clusters of cells about two points wide: that makes *sheets* (`sheets`), one for each surface in a cell. A surfel
//! blends those of the four cells around it at its own place: the nearer the centre of a sheet's ball, the nearer the sheet
//! itself and the smaller its error, the more it counts, and what is another surface does not. It turns to the blended
//! normal, and its centre moves onto the surface. A surfel without a sheet tries its own balls; one whose own normal is
//! reliable and unlike all sheets is not moved.
//!
//! Points of a spinning lidar are dense along its rings and sparse across: their first neighbours are a *row* (`rows`), no
//! surface. Balls around such a surfel grow until they hold more than the row.
//!
//! What is sparse before denser points, and no surface, hides no more than its share of them (`through`).
//!
//! Depth cameras have noise that no ball of these sizes shows, because neighbours err alike. It is known from the scan as a whole
//! (`depth`) and taken where it is the larger; surfels move along the sensor's ray then.

mod cells;
mod cpu;
mod depth;
pub(crate) mod gpu;
mod noise;
mod quadric;
mod rows;
mod sheets;
#[cfg(test)]
mod tests;
mod through;

#[cfg(test)]
pub(crate) use cells::SLABS;
pub(crate) use cpu::{AdaptRules, Adapter};
pub(crate) use depth::DepthNoise;
#[cfg(test)]
pub(crate) use depth::DepthRun;
pub(crate) use noise::Noise;
#[cfg(test)]
pub(crate) use sheets::SHEETS;

/// Balls tried around each point, beside the neighbourhood that the search found.
pub(crate) const SCALES: usize = 6;
/// Radius of a ball over that of the one before; of the first over the k-radius.
pub(crate) const STEP: f32 = 1.6;
/// The k-radius counts as at least this part of the first search radius: it is too small where a gap or the end of a
/// surface left few neighbours.
pub(crate) const LEAST_REACH: f32 = 0.8;
