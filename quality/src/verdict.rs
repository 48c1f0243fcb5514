//! What is right and wrong at each pixel, and how much of each there is.

use autosplats::cloud::glam::DVec3;
use rayon::prelude::*;

use crate::exact::{Exact, Seen};
use crate::picture::{Picture, Shown};
use crate::subject::Subject;

/// Pixels to all sides that a surface must truly cover around a pixel for it to lie inside the silhouette.
const INSIDE_PX: usize = 2;
/// Fewest sampled pixels that say something about a picture.
const FEWEST: usize = 300;

/// What is to be said about a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Empty, and so it should be.
    Empty,
    /// A surface with too few points to ask anything about it, or something of such a surface shown where nothing is.
    Unsampled,
    /// Shown where it is.
    Right,
    /// Empty inside the silhouette.
    Hole,
    /// Empty at the silhouette's edge.
    Short,
    /// Covered outside the silhouette.
    Over,
    /// Behind all that is truly seen at this pixel and the eight around it, each of which sees some surface, by more than
    /// the tolerance there. At a step in depth either side may be seen.
    Leak,
    /// Before all that is truly seen at this pixel and the eight around it, by more than the tolerance there.
    Before,
    /// At another depth than it should be by more than the tolerance, but at one that is seen beside it.
    Beside,
}

/// The verdict on each pixel.
#[derive(Clone, Debug)]
pub struct Verdicts {
    /// Row by row.
    pub verdicts: Vec<Verdict>,
    /// Sampled pixels inside the silhouette.
    inside: usize,
    /// Sampled pixels at its edge.
    edge: usize,
    /// Median over the surface, where there are points.
    spacing_px: f64,
    /// Share of the surface that is sampled.
    sampled: f64,
}

/// How much of a picture is where it should be, as shares of the pixels whose surface is sampled. No numbers where there
/// are too few of those.
#[derive(Clone, Copy, Debug)]
pub struct Cover {
    /// Median distance of points on the surface seen; of swept ones where the sensor sees it.
    pub spacing_px: f64,
    /// Share of the true surface that is sampled; the rest is left out of all that follows.
    pub sampled: f64,
    /// Intersection over union of the covered pixels.
    pub iou: f64,
    /// Pixels by which the silhouette is too wide on average; below 0 if too narrow.
    pub wider_px: f64,
    /// Of the pixels inside the true silhouette, those that are empty.
    pub holes: f64,
    /// Of the pixels covered in both, those that show something behind the surface.
    pub leaks: f64,
    /// The same for something before it.
    pub before: f64,
}

impl Verdicts {
    /// Judges each pixel of `picture`.
    pub fn new(exact: &Exact, picture: &Picture, subject: &Subject) -> Self {
        let judge = |pixel: usize| match (&exact.seen[pixel], &picture.shown[pixel]) {
            (None, None) => Verdict::Empty,
            (None, Some(shown)) if !exact.is_sampled(shown, subject) => Verdict::Unsampled,
            (None, Some(_)) => Verdict::Over,
            (Some(seen), _) if !seen.sampled => Verdict::Unsampled,
            (Some(_), None) if inside(exact, pixel) => Verdict::Hole,
            (Some(_), None) => Verdict::Short,
            (Some(seen), Some(shown)) => compare(exact, pixel, seen, shown),
        };
        let sampled = |pixel: usize| exact.seen[pixel].is_some_and(|seen| seen.sampled);
        let pixels = 0..exact.seen.len();
        let surfaces = exact.seen.iter().flatten();
        let mut spacings: Vec<_> = surfaces.clone().map(|seen| seen.spacing_px).filter(|px| px.is_finite()).collect();
        spacings.sort_unstable_by(f64::total_cmp);
        Self {
            verdicts: pixels.clone().into_par_iter().map(judge).collect(),
            inside: pixels.clone().filter(|&pixel| sampled(pixel) && inside(exact, pixel)).count(),
            edge: pixels.filter(|&pixel| sampled(pixel) && exact.around(pixel, 1).any(|near| near.is_none())).count(),
            sampled: surfaces.clone().filter(|seen| seen.sampled).count() as f64 / surfaces.count() as f64,
            spacing_px: spacings.get(spacings.len() / 2).copied().unwrap_or(f64::INFINITY),
        }
    }

    /// How much of each there is.
    pub fn cover(&self) -> Cover {
        let count = |what: &[Verdict]| self.verdicts.iter().filter(|verdict| what.contains(verdict)).count() as f64;
        let [right, leaks, before] = [Verdict::Right, Verdict::Leak, Verdict::Before].map(|what| count(&[what]));
        let covered = right + leaks + before + count(&[Verdict::Beside]);
        let missing = count(&[Verdict::Hole, Verdict::Short]);
        let enough = if self.inside < FEWEST { f64::NAN } else { 1.0 };
        Cover {
            spacing_px: self.spacing_px,
            sampled: self.sampled,
            iou: enough * covered / (covered + missing + count(&[Verdict::Over])),
            wider_px: enough * (count(&[Verdict::Over]) - count(&[Verdict::Short])) / self.edge as f64,
            holes: enough * count(&[Verdict::Hole]) / self.inside as f64,
            leaks: enough * leaks / covered,
            before: enough * before / covered,
        }
    }

    /// Mean angles in degrees of the normals shown where they should be, and of plane fits at the points shown there, to
    /// the true ones; of either sign.
    pub fn normals_and_fits(&self, exact: &Exact, picture: &Picture, subject: &Subject) -> [f64; 2] {
        let degrees = |normal: DVec3, truth: DVec3| {
            // The angle's sine is exact where its cosine is not.
            normal.cross(truth).length().atan2(normal.dot(truth).abs()).to_degrees()
        };
        let right = (0..self.verdicts.len()).into_par_iter().filter(|&pixel| self.verdicts[pixel] == Verdict::Right);
        let angles = right.filter_map(|pixel| {
            let (seen, shown) = (exact.seen[pixel]?, picture.shown[pixel]?);
            Some([shown.normal, subject.clean.normal(shown.point)].map(|normal| degrees(normal, seen.normal)))
        });
        let angles: Vec<_> = angles.collect();
        [0, 1].map(|i| angles.iter().map(|pair| pair[i]).sum::<f64>() / angles.len() as f64)
    }
}

fn inside(exact: &Exact, pixel: usize) -> bool {
    exact.around(pixel, INSIDE_PX).all(|seen| seen.is_some())
}

/// The verdict where there is a surface and one is shown.
fn compare(exact: &Exact, pixel: usize, seen: &Seen, shown: &Shown) -> Verdict {
    let tolerance = seen.tolerance;
    if (shown.depth - seen.depth).abs() <= tolerance {
        return Verdict::Right;
    }
    let around = || exact.around(pixel, 1);
    let depths = || around().flatten().map(|seen| seen.depth);
    if shown.depth < depths().fold(f64::INFINITY, f64::min) - tolerance {
        Verdict::Before
    } else if around().all(|seen| seen.is_some())
        && shown.depth > depths().fold(f64::NEG_INFINITY, f64::max) + tolerance
    {
        Verdict::Leak
    } else {
        Verdict::Beside
    }
}
