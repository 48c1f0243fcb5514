//! Verdicts on pixels: what is right and wrong, and how often.

use autosplats::cloud::glam::DVec3;
use rayon::prelude::*;

use crate::exact::{Exact, TrueSurface};
use crate::picture::{DrawnSurface, Picture};
use crate::subject::Subject;

/// A pixel lies inside the silhouette if the true surface covers all pixels within this distance in x and in y.
const INSIDE_PX: usize = 2;
/// Fewest sampled pixels inside the silhouette from which shares are computed.
const MIN_INSIDE_PIXELS: usize = 300;

/// The verdict on a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Empty, like the true picture.
    Empty,
    /// Points are too sparse for a verdict: on the true surface, or on one drawn where none is.
    Unsampled,
    /// Covered at the true depth.
    Right,
    /// Empty, but inside the true silhouette.
    Hole,
    /// Empty, but at the edge of the true silhouette.
    Short,
    /// Covered, but outside the true silhouette.
    Over,
    /// Behind the true surfaces at the pixel and the eight around it by more than the tolerance. All nine must have
    /// one. The eight count because at a step in depth either side may be drawn.
    Leak,
    /// In front of the true surfaces at the pixel and the eight around it, by more than the tolerance.
    Before,
    /// Off the true depth by more than the tolerance, but neither [`Leak`](Self::Leak) nor [`Before`](Self::Before).
    Beside,
}

/// The verdicts on all pixels of a picture.
#[derive(Clone, Debug)]
pub struct Verdicts {
    /// Verdicts, in rows of pixels.
    pub verdicts: Vec<Verdict>,
    /// Number of sampled pixels inside the true silhouette.
    inside: usize,
    /// Number of sampled pixels at the edge of the true silhouette.
    edge: usize,
    /// Median spacing of points over the surface, pixels. Pixels without a finite spacing are left out.
    spacing_px: f64,
    /// Share of the true surface's pixels that is sampled.
    sampled: f64,
}

/// How well a picture covers the true surface. Shares are of pixels whose surface is sampled: its points are at most
/// 1.5 pixels apart. Values are NaN if too few pixels are.
#[derive(Clone, Copy, Debug)]
pub struct Cover {
    /// Median spacing of points on the visible surface, pixels. For a lidar only where the lidar sees the surface.
    pub spacing_px: f64,
    /// Share of the true surface that is sampled. The other values leave out the rest.
    pub sampled: f64,
    /// Intersection over union of the covered pixels with the true ones.
    pub iou: f64,
    /// Mean excess width of the silhouette, pixels. Negative if it is too narrow.
    pub wider_px: f64,
    /// Share of empty pixels inside the true silhouette, at least two pixels from its edge.
    pub holes: f64,
    /// Share of pixels behind the true surface, of those covered in both pictures.
    pub leaks: f64,
    /// Share of pixels in front of the true surface, of those covered in both pictures.
    pub before: f64,
}

impl Verdicts {
    /// Judges all pixels of `picture`.
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

    /// Counts the verdicts.
    pub fn cover(&self) -> Cover {
        let count = |what: &[Verdict]| self.verdicts.iter().filter(|verdict| what.contains(verdict)).count() as f64;
        let [right, leaks, before] = [Verdict::Right, Verdict::Leak, Verdict::Before].map(|what| count(&[what]));
        let covered = right + leaks + before + count(&[Verdict::Beside]);
        let missing = count(&[Verdict::Hole, Verdict::Short]);
        let enough = if self.inside < MIN_INSIDE_PIXELS { f64::NAN } else { 1.0 };
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

    /// Mean angles to the true normals in degrees, over all right pixels: of the drawn normals, and of plane fits at
    /// the drawn points. The sign of normals does not count.
    pub fn normals_and_fits(&self, exact: &Exact, picture: &Picture, subject: &Subject) -> [f64; 2] {
        let degrees = |normal: DVec3, truth: DVec3| {
            // The sine is precise at small angles, unlike the cosine.
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

/// The verdict where both pictures show a surface.
fn compare(exact: &Exact, pixel: usize, seen: &TrueSurface, shown: &DrawnSurface) -> Verdict {
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
