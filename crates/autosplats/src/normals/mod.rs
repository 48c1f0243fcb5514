//! Normals: normal, curvature and density radius of every point of a cloud, from its k nearest in all the cloud.
//!
//! This is the computation that a picture previews [Paper, §8.3], by the definitions of the `fit` stage but without a
//! camera: the neighbourhood of a point is the point itself and its k nearest neighbours in space.
//!
//! # How it works
//! The points are sorted into leaves of sixteen by a balanced kd-tree (`tree`). Sixteen points of a leaf lie close
//! together, so they share one list of candidates (`neighbors`): all points within some radius of the leaf's box. From
//! there it is the screen-grid search over again: distances, counting selection and moments, sixteen points at a time.
//! A point whose k-th distance is no greater than the radius has its exact neighbours; the others get a wider list, and
//! those few whose list would be too long are searched for alone, nearest nodes first (`nearest`). The covariances are
//! diagonalised where they are, so that nothing but the result is stored.
//!
//! # Ties
//! All points at the k-th distance belong to the neighbourhood, as in the search stage. So nothing depends on an order among
//! equals, and the result has the same bits for any number of threads and any width of vectors. The order of the points
//! in the cloud matters to no more than the rounding of sums.

mod boxes;
mod nearest;
mod neighbors;
mod orient;
mod output;
#[cfg(test)]
mod tests;
mod ticker;
mod tree;

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use autosplats_cloud::glam::DVec3;
use autosplats_cloud::{PointCloud, Progress};
use pulp::Simd;
use rayon::prelude::*;

use self::neighbors::{Scratch, search_leaf};
use self::orient::Sides;
use self::output::Output;
use self::ticker::Ticker;
use self::tree::{Point, Tree};
use crate::Error;
use crate::fit::Fitted;
use crate::search::LANES;

/// Leaves per task: enough to hide its start, few enough to share out evenly.
const TASK_LEAVES: usize = 64;
/// Tasks from one report of progress to the next, some ten milliseconds of one thread.
const REPORT_TASKS: usize = 32;
/// Coordinates beyond this count as not finite: their squared distances would overflow.
const FARTHEST: f32 = 1e18;
/// What is done, 0 to 1, when the points are listed and when the tree is built.
const LISTED: f32 = 0.02;
const BUILT: f32 = 0.25;

/// What [`estimate_normals`] may be asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalSettings {
    /// Neighbours that a plane is fitted to, beside the point itself; 3 to 1024. Default 10, the paper's.
    pub k: u32,
    /// Which of its two sides a normal is to point to. Default [`Orientation::Outward`].
    pub orientation: Orientation,
}

impl Default for NormalSettings {
    fn default() -> Self {
        Self { k: 10, orientation: Orientation::Outward }
    }
}

/// Which of its two sides a normal points to. Each point is judged alone; a normal square to the direction asked for may
/// point either way.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Orientation {
    /// To where the point was seen from. Points in no viewpoint's range are turned [outward](Self::Outward).
    Viewpoints(Vec<Viewpoint>),
    /// To the side of this direction, of any length but zero: up, for what an aeroplane has seen.
    Direction(DVec3),
    /// Away from the middle of the cloud, the median of each coordinate to within sixteen points: for a single body seen
    /// from all around.
    Outward,
}

/// Where a run of points was seen from.
#[derive(Clone, Debug, PartialEq)]
pub struct Viewpoint {
    /// World coordinates; finite, within 1e18 of the cloud's origin.
    pub position: DVec3,
    /// Indices of the points seen from there. Ranges of different viewpoints must not overlap.
    pub points: Range<usize>,
}

/// One value per point, in the cloud's order. All are NaN for points whose position is not finite or has a coordinate
/// beyond ±1e18.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Normals {
    /// Unit normals. Where the neighbourhood is a line, as much to the side asked for as the line allows; where it is one
    /// place, right to that side.
    pub normals: Vec<[f32; 3]>,
    /// Surface variation λ0/(λ0+λ1+λ2), 0 (flat, or a line, or one place) to 1/3 (no direction is special).
    pub curvature: Vec<f32>,
    /// Density radius 2·√(r²/k) in the cloud's unit, where r is the distance to the k-th neighbour: twice the radius of the
    /// circle that each neighbour covers on average [Paper, §6]. 0 where k neighbours coincide with the point, and for a point
    /// alone.
    pub radius: Vec<f32>,
}

/// Estimates the normal, curvature and density radius of every point from its k nearest neighbours.
///
/// Points without a finite position are nobody's neighbours. Where there are not k others, all of them are the
/// neighbourhood, and k is their number. Points nearer to each other than about 1e-18 may count as one place.
///
/// Beside the cloud this takes 38 bytes per point, the 20 of the result among them, and some megabytes per thread.
///
/// # Errors
/// [`Error::Setting`] for a k or an orientation outside its range, [`Error::TooManyPoints`], and [`Error::Cancelled`] if
/// `progress` says so.
pub fn estimate_normals(
    cloud: &PointCloud,
    settings: &NormalSettings,
    progress: &dyn Progress,
) -> Result<Normals, Error> {
    if !(3..=1024).contains(&settings.k) {
        return Err(Error::Setting { name: "k", value: settings.k.to_string(), range: "3 to 1024" });
    }
    estimate(cloud, settings, progress)
}

/// The distance from each point to its k-th nearest in the whole cloud, the last there is if it has fewer; NaN for points
/// that [`Normals`] has none for. Good for any k.
///
/// # Errors
/// [`Error::TooManyPoints`].
pub(crate) fn exact_k_radii(cloud: &PointCloud, k: u32) -> Result<Vec<f32>, Error> {
    let finite = finite_points(cloud).len() as u32;
    let Normals { radius, .. } = estimate(cloud, &NormalSettings { k, ..NormalSettings::default() }, &())?;
    let of_density = 0.5 * (k.min(finite.saturating_sub(1)).max(1) as f32).sqrt();
    Ok(radius.into_iter().map(|radius| radius * of_density).collect())
}

fn estimate(cloud: &PointCloud, settings: &NormalSettings, progress: &dyn Progress) -> Result<Normals, Error> {
    if u32::try_from(cloud.len()).is_err() {
        return Err(Error::TooManyPoints(cloud.len()));
    }
    let sides = Sides::new(cloud, &settings.orientation)?;
    let ticker = Ticker::new(progress);
    ticker.tick(0.0)?;
    let points = finite_points(cloud);
    ticker.tick(LISTED)?;
    let tree = Tree::build(points, &|part| ticker.tick(LISTED + (BUILT - LISTED) * part))?;
    let sides = sides.about(tree.middle());
    let output = Output::new(cloud.len());
    let k = settings.k.min((tree.len as u32).saturating_sub(1));
    let job = Job { tree: &tree, sides: &sides, k, output: &output };
    let tasks = tree.leaves.len().div_ceil(TASK_LEAVES);
    let done = AtomicUsize::new(0);
    (0..tasks).into_par_iter().try_for_each_init(Scratch::default, |scratch, task| {
        let first = task * TASK_LEAVES;
        estimate_leaves(&job, first..tree.leaves.len().min(first + TASK_LEAVES), scratch);
        match done.fetch_add(1, Relaxed) + 1 {
            done if done % REPORT_TASKS == 0 => ticker.tick(BUILT + (1.0 - BUILT) * done as f32 / tasks as f32),
            _ => Ok(()),
        }
    })?;
    ticker.tick(1.0)?;
    Ok(output.finish())
}

fn finite_points(cloud: &PointCloud) -> Vec<Point> {
    let mut points = Vec::with_capacity(cloud.len());
    let all = (0u32..).zip(cloud.positions());
    points.extend(
        all.filter(|(_, position)| position.iter().all(|c| c.abs() <= FARTHEST))
            .map(|(index, &position)| Point::new(position, index)),
    );
    points
}

/// What all tasks share.
struct Job<'a> {
    tree: &'a Tree,
    sides: &'a Sides,
    /// Less than the number of points.
    k: u32,
    output: &'a Output,
}

#[pulp::with_simd(estimate_leaves = pulp::Arch::new())]
#[inline(always)]
fn estimate_leaves_with<'a, S: Simd>(simd: S, job: &'a Job<'a>, leaves: Range<usize>, scratch: &'a mut Scratch) {
    scratch.start_task();
    for number in leaves {
        let block = search_leaf(simd, job.tree, number, job.k, scratch);
        let mut fitted = Fitted::default();
        for vector in 0..LANES / S::F32_LANES {
            fitted.fit(simd, &block, vector);
        }
        let leaf = &job.tree.leaves[number];
        for lane in 0..job.tree.lanes(number) {
            let index = leaf.index[lane];
            let plane = fitted.plane(lane, job.sides.toward(leaf.point(lane), index));
            // Not by the count, as the fit has it: with ties that would jump where two distances become equal.
            let radius = 2.0 * block.k_radius.0[lane] / (job.k.max(1) as f32).sqrt();
            job.output.set(index, plane.normal, plane.curvature, radius);
        }
    }
}
