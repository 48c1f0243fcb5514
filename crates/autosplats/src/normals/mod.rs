//! Normals: normal, curvature and density radius of every point of a cloud, from its k nearest neighbours in the cloud.
//!
//! A picture previews this computation [Paper, §8.3]. The definitions are those of the `fit` stage, but without a
//! camera. The neighbourhood of a point is the point itself and its k nearest neighbours in space. See
//! docs/decisions/0016-normals.md.
//!
//! # How it works
//! A balanced kd-tree (`tree`) sorts the points into leaves of sixteen. The points of a leaf lie close together, so
//! they share one list of candidates (`neighbors`): all points within some radius of the leaf's box. From there the
//! search is that of the screen grid: distances, counting selection and moments, sixteen points at a time. A point with
//! a k-th distance within that radius has its exact neighbours; the others get a wider list. The few points whose list
//! would be too long are searched for one by one, nearest nodes first (`nearest`). The covariances are diagonalised at
//! once, so that only the result is stored.
//!
//! # Ties
//! All points at the k-th distance belong to the neighbourhood, as in the search stage. So the result has the same bits
//! for any number of threads and any vector width. The order of points in the cloud changes only the rounding of sums.

mod boxes;
mod nearest;
mod neighbors;
mod orient;
mod output;
mod parts;
#[cfg(test)]
mod tests;
mod ticker;
mod tree;

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use autosplats_cloud::glam::DVec3;
use autosplats_cloud::{PointCloud, Progress, sampled_median};
use pulp::Simd;
use rayon::prelude::*;

use self::boxes::Point;
use self::neighbors::{Scratch, search_leaf};
use self::orient::Sides;
use self::output::Output;
pub use self::parts::{NormalsInParts, PartsOptions, estimate_normals_in_parts};
use self::ticker::Ticker;
use self::tree::Tree;
use crate::Error;
use crate::fit::Fitted;
use crate::search::LANES;

/// Leaves per task: enough to hide the task's start, few enough for an even share.
const TASK_LEAVES: usize = 64;
/// Tasks between two reports of progress, some ten milliseconds of one thread.
const REPORT_TASKS: usize = 32;
/// Largest absolute coordinate that counts as finite. Squared distances of larger ones would overflow.
const MAX_COORDINATE: f32 = 1e18;
/// Progress, 0 to 1, when the points are listed.
const LISTED_PROGRESS: f32 = 0.02;
/// Progress, 0 to 1, when the tree is built.
const BUILT_PROGRESS: f32 = 0.25;

/// Settings of [`estimate_normals`].
#[derive(Clone, Debug, PartialEq)]
pub struct NormalSettings {
    /// Neighbours that a plane is fitted to, besides the point itself; 3 to 1024. Default 10, as in the paper.
    pub k: u32,
    /// The side that normals point to. Default [`Orientation::Outward`].
    pub orientation: Orientation,
}

impl Default for NormalSettings {
    fn default() -> Self {
        Self { k: 10, orientation: Orientation::Outward }
    }
}

/// The side that normals point to. Each point is decided alone; a normal perpendicular to that side may point either
/// way.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Orientation {
    /// Towards the position that the point was seen from. Points in no viewpoint's range point
    /// [outward](Self::Outward).
    Viewpoints(Vec<Viewpoint>),
    /// Towards this direction, of any length but zero. Up is right for aerial scans.
    Direction(DVec3),
    /// Away from the middle of the cloud: the median of each coordinate of a sample. Right for a single
    /// body seen from all around.
    Outward,
}

/// The position that a range of points was seen from.
///
/// # Examples
///
/// ```
/// use autosplats::{NormalSettings, Orientation, Viewpoint, estimate_normals};
/// # use autosplats::cloud::{PointCloud, Scan, glam::{DMat4, DVec3}};
/// # let floor = (0..100).map(|i| [(i % 10) as f32, (i / 10) as f32, 0.0]).collect();
/// # let world_from_sensor = DMat4::from_translation(DVec3::new(5.0, 5.0, 2.0));
/// # let scan = Scan { name: None, world_from_sensor, points: 0..100 };
/// # let cloud = PointCloud::new(DVec3::ZERO, floor).with_scans(vec![scan]);
///
/// // The sensor stands above the floor that it scanned.
/// let viewpoints = cloud.scans().iter().map(|scan| Viewpoint {
///     position: scan.position(),
///     points: scan.points.clone(),
/// });
/// let orientation = Orientation::Viewpoints(viewpoints.collect());
/// let settings = NormalSettings { orientation, ..NormalSettings::default() };
/// let normals = estimate_normals(&cloud, &settings, &())?;
/// assert!(normals.normals.iter().all(|[_, _, z]| *z > 0.99));
/// # Ok::<(), autosplats::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Viewpoint {
    /// World coordinates; finite, within 1e18 of the cloud's origin, if the cloud is of ordinary size.
    pub position: DVec3,
    /// Indices of the points. Ranges of different viewpoints must not overlap.
    pub points: Range<usize>,
}

/// One value per point, in the cloud's order. All are NaN for points with a coordinate that is not finite, or beyond
/// ±1e18 in a cloud of ordinary size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Normals {
    /// Unit normals. For neighbours on a line, the perpendicular nearest to the wanted side; at one place, that
    /// direction.
    pub normals: Vec<[f32; 3]>,
    /// Surface variation λ0/(λ0+λ1+λ2), from 0 (flat, a line or one place) to 1/3 (no direction is special).
    pub curvature: Vec<f32>,
    /// Density radius 2·√(r²/k) in the cloud's unit, where r is the distance to the k-th neighbour. This is twice the
    /// radius of the circle that each neighbour covers on average [Paper, §6]. 0 if k neighbours coincide with the
    /// point, or there are none.
    pub radius: Vec<f32>,
}

/// Estimates the normal, curvature and density radius of every point from its k nearest neighbours.
///
/// Points without a finite position are no neighbours. With fewer than k other points, all of them are the
/// neighbourhood and k is their number. Points nearer to each other than about 1e-18 may count as one place.
///
/// Takes 38 bytes per point besides the cloud, including 20 for the result, and some megabytes per thread.
///
/// # Errors
/// [`Error::Setting`] for a k or an orientation out of range, [`Error::TooManyPoints`], and [`Error::Cancelled`] if
/// `progress` cancels.
///
/// # Examples
///
/// ```
/// use autosplats::{
///     NormalSettings, Orientation, cloud::{PointCloud, glam::DVec3}, estimate_normals,
/// };
///
/// let floor = (0..100).map(|i| [(i % 10) as f32, (i / 10) as f32, 0.0]).collect();
/// let cloud = PointCloud::new(DVec3::ZERO, floor);
/// let settings = NormalSettings { k: 8, orientation: Orientation::Direction(DVec3::Z) };
/// let estimated = estimate_normals(&cloud, &settings, &())?;
/// assert!(estimated.normals.iter().all(|[_, _, z]| *z > 0.99));
/// assert!(estimated.curvature.iter().all(|curvature| *curvature < 1e-3));
/// # Ok::<(), autosplats::Error>(())
/// ```
pub fn estimate_normals(
    cloud: &PointCloud,
    settings: &NormalSettings,
    progress: &dyn Progress,
) -> Result<Normals, Error> {
    check(settings)?;
    estimate(cloud, settings, &Scope::default(), progress)
}

fn check(settings: &NormalSettings) -> Result<(), Error> {
    if !(3..=1024).contains(&settings.k) {
        return Err(Error::Setting { name: "k", value: settings.k.to_string(), range: "3 to 1024" });
    }
    Ok(())
}

/// The distance from each point to its k-th nearest in the cloud, or to the furthest point if there are fewer. NaN
/// where [`Normals`] are NaN. Any k is allowed.
///
/// # Errors
/// [`Error::TooManyPoints`], and [`Error::Cancelled`] if `progress` says so.
pub(crate) fn exact_k_radii(cloud: &PointCloud, k: u32, progress: &dyn Progress) -> Result<Vec<f32>, Error> {
    let Normals { radius, .. } =
        estimate(cloud, &NormalSettings { k, ..NormalSettings::default() }, &Scope::default(), progress)?;
    // The radius of points that are not finite is not either.
    let finite = radius.iter().filter(|radius| radius.is_finite()).count() as u32;
    let of_density = k_radius_of(k.min(finite.saturating_sub(1)));
    Ok(radius.into_iter().map(|radius| radius * of_density).collect())
}

/// What a density radius is multiplied by for the distance to the k-th neighbour.
fn k_radius_of(k: u32) -> f32 {
    0.5 * (k.max(1) as f32).sqrt()
}

/// Tells by the indices of points that lie close together whether any of them is estimated.
type Wanted<'a> = &'a (dyn Fn(&[u32]) -> bool + Sync);

/// What is estimated of a cloud that may be a part of another.
#[derive(Clone, Copy, Default)]
struct Scope<'a> {
    /// Outward is away from this place, about the cloud's origin; `None` takes the middle of the cloud.
    middle: Option<[f32; 3]>,
    /// Results of points that are not wanted stay NaN. `None` estimates all.
    wanted: Option<Wanted<'a>>,
}

/// Estimates at a scale at which powers of lengths are exact enough.
fn estimate(
    cloud: &PointCloud,
    settings: &NormalSettings,
    scope: &Scope<'_>,
    progress: &dyn Progress,
) -> Result<Normals, Error> {
    let factor = cloud.computing_scale();
    if factor == 1.0 {
        return estimate_at_scale(cloud, settings, scope, progress);
    }
    let middle = scope.middle.map(|middle| middle.map(|value| (f64::from(value) * factor) as f32));
    let mut settings = settings.clone();
    if let Orientation::Viewpoints(viewpoints) = &mut settings.orientation {
        viewpoints.iter_mut().for_each(|viewpoint| viewpoint.position *= factor);
    }
    let mut normals = estimate_at_scale(&cloud.scaled(factor), &settings, &Scope { middle, ..*scope }, progress)?;
    normals.radius.iter_mut().for_each(|radius| *radius = (f64::from(*radius) / factor) as f32);
    Ok(normals)
}

fn estimate_at_scale(
    cloud: &PointCloud,
    settings: &NormalSettings,
    scope: &Scope<'_>,
    progress: &dyn Progress,
) -> Result<Normals, Error> {
    if u32::try_from(cloud.len()).is_err() {
        return Err(Error::TooManyPoints(cloud.len()));
    }
    let sides = Sides::new(cloud, &settings.orientation)?;
    let ticker = Ticker::new(progress);
    ticker.tick(0.0)?;
    let points = finite_points(cloud);
    let middle = scope.middle.unwrap_or_else(|| {
        sampled_median(points.len(), |i| {
            let [x, y, z, _] = points[i].0;
            [x, y, z]
        })
    });
    ticker.tick(LISTED_PROGRESS)?;
    let tree = Tree::build(points, &|part| ticker.tick(LISTED_PROGRESS + (BUILT_PROGRESS - LISTED_PROGRESS) * part))?;
    let sides = sides.about(middle);
    let output = Output::new(cloud.len());
    let k = settings.k.min((tree.len as u32).saturating_sub(1));
    let job = Job { tree: &tree, sides: &sides, k, wanted: scope.wanted, output: &output };
    let tasks = tree.leaves.len().div_ceil(TASK_LEAVES);
    let done = AtomicUsize::new(0);
    (0..tasks).into_par_iter().try_for_each_init(Scratch::default, |scratch, task| {
        let first = task * TASK_LEAVES;
        estimate_leaves(&job, first..tree.leaves.len().min(first + TASK_LEAVES), scratch);
        match done.fetch_add(1, Relaxed) + 1 {
            done if done % REPORT_TASKS == 0 => {
                ticker.tick(BUILT_PROGRESS + (1.0 - BUILT_PROGRESS) * done as f32 / tasks as f32)
            }
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
        all.filter(|(_, position)| position.iter().all(|c| c.abs() <= MAX_COORDINATE))
            .map(|(index, &position)| Point::new(position, index)),
    );
    points
}

/// Input that all tasks share.
struct Job<'a> {
    tree: &'a Tree,
    sides: &'a Sides,
    /// Less than the number of points.
    k: u32,
    wanted: Option<Wanted<'a>>,
    output: &'a Output,
}

#[pulp::with_simd(estimate_leaves = pulp::Arch::new())]
#[inline(always)]
fn estimate_leaves_with<'a, S: Simd>(simd: S, job: &'a Job<'a>, leaves: Range<usize>, scratch: &'a mut Scratch) {
    scratch.start_task();
    for number in leaves {
        let leaf = &job.tree.leaves[number];
        if job.wanted.is_some_and(|wanted| !wanted(&leaf.index[..job.tree.lanes(number)])) {
            continue;
        }
        let block = search_leaf(simd, job.tree, number, job.k, scratch);
        let mut fitted = Fitted::default();
        for vector in 0..LANES / S::F32_LANES {
            fitted.fit(simd, &block, vector);
        }
        for lane in 0..job.tree.lanes(number) {
            let index = leaf.index[lane];
            let plane = fitted.plane(lane, job.sides.toward(leaf.point(lane), index));
            // By k and not by the count, unlike the fit: with ties the count would jump.
            let radius = 2.0 * block.k_radius.0[lane] / (job.k.max(1) as f32).sqrt();
            job.output.set(index, plane.normal, plane.curvature, radius);
        }
    }
}
