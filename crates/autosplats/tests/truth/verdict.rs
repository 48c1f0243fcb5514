//! What is right and wrong at each pixel, and how much of each there is.

use std::fmt;
use std::path::Path;

use autosplats::cloud::glam::DVec3;
use rayon::prelude::*;

use crate::exact::{Exact, Picture, Shown, Surface};
use crate::fit::Neighbors;

/// Pixels to all sides that a surface must truly cover around a pixel for it to lie inside the silhouette.
const INSIDE_PX: usize = 2;

/// What is to be said about a pixel.
#[derive(Clone, Copy, PartialEq)]
enum Verdict {
    /// Empty, and so it should be.
    Empty,
    /// A surface with too few points to ask anything about it, or covered beside such a surface alone.
    Unsampled,
    /// Shown where it is. Angles in degrees of our normal and of the reference to the true one.
    Right { ours: f64, reference: f64 },
    /// Empty inside the silhouette.
    Hole,
    /// Empty at the silhouette's edge.
    Short,
    /// Covered outside the silhouette.
    Over,
    /// Behind all that is truly seen at this pixel and the eight around it, each of which sees some surface, by more than
    /// the k-radius there. At a step in depth either side may be seen.
    Leak,
    /// Before all that is truly seen at this pixel and the eight around it, by more than the k-radius there.
    Before,
    /// At another depth than it should be by more than the k-radius, but at one that is seen beside it.
    Beside,
}

/// The verdict on each pixel.
pub(crate) struct Verdicts {
    width: usize,
    verdicts: Vec<Verdict>,
    /// Sampled pixels inside the silhouette.
    inside: usize,
    /// Median over the surface.
    spacing_px: f64,
    /// Share of the surface that is sampled.
    sampled: f64,
}

/// Shares of the pixels, and mean angles.
#[derive(Clone, Copy)]
pub(crate) struct Measures {
    /// Median distance of points on the surface seen.
    pub(crate) spacing_px: f64,
    /// Share of the true surface that is sampled; the rest is left out of all that follows.
    pub(crate) sampled: f64,
    /// Intersection over union of the covered pixels.
    pub(crate) iou: f64,
    /// Of the pixels inside the true silhouette, those that are empty.
    pub(crate) holes: f64,
    /// Of the pixels covered in both, those that show something behind the surface.
    pub(crate) leaks: f64,
    /// The same for something before it.
    pub(crate) before: f64,
    /// Mean angle to the true normal in degrees.
    pub(crate) ours: f64,
    /// The same for the reference.
    pub(crate) reference: f64,
}

impl Verdicts {
    pub(crate) fn new(exact: &Exact, picture: &Picture, neighbors: &Neighbors) -> Self {
        let judge = |pixel: usize| match (&exact.surface[pixel], &picture.shown[pixel]) {
            (None, None) => Verdict::Empty,
            (None, Some(_)) if beside_unsampled(exact, pixel) => Verdict::Unsampled,
            (None, Some(_)) => Verdict::Over,
            (Some(surface), _) if !surface.sampled() => Verdict::Unsampled,
            (Some(_), None) if inside(exact, pixel) => Verdict::Hole,
            (Some(_), None) => Verdict::Short,
            (Some(surface), Some(shown)) => compare(exact, pixel, surface, shown, neighbors),
        };
        let sampled = |pixel: usize| exact.surface[pixel].is_some_and(|surface| surface.sampled());
        let pixels = 0..exact.surface.len();
        let surfaces = exact.surface.iter().flatten();
        let mut spacings: Vec<_> = surfaces.clone().map(|surface| surface.spacing_px).collect();
        spacings.sort_unstable_by(f64::total_cmp);
        Self {
            width: exact.width,
            verdicts: pixels.clone().into_par_iter().map(judge).collect(),
            inside: pixels.filter(|&pixel| sampled(pixel) && inside(exact, pixel)).count(),
            sampled: surfaces.filter(|surface| surface.sampled()).count() as f64 / spacings.len() as f64,
            spacing_px: spacings.get(spacings.len() / 2).copied().unwrap_or(f64::INFINITY),
        }
    }

    pub(crate) fn measures(&self) -> Measures {
        let count = |what: &[Verdict]| self.verdicts.iter().filter(|verdict| what.contains(verdict)).count() as f64;
        let angles = || {
            self.verdicts.iter().filter_map(|verdict| match *verdict {
                Verdict::Right { ours, reference } => Some([ours, reference]),
                _ => None,
            })
        };
        let right = angles().count() as f64;
        let [leaks, before] = [Verdict::Leak, Verdict::Before].map(|what| count(&[what]));
        let covered = right + leaks + before + count(&[Verdict::Beside]);
        let missing = count(&[Verdict::Hole, Verdict::Short]);
        let surface = covered + missing;
        Measures {
            spacing_px: self.spacing_px,
            sampled: self.sampled,
            iou: covered / (surface + count(&[Verdict::Over])),
            holes: count(&[Verdict::Hole]) / self.inside as f64,
            leaks: leaks / covered,
            before: before / covered,
            ours: angles().map(|[ours, _]| ours).sum::<f64>() / right,
            reference: angles().map(|[_, reference]| reference).sum::<f64>() / right,
        }
    }

    /// Writes a picture of the verdicts: normals right in black to 30° wrong in white, holes red, other missing pixels
    /// orange, pixels too many blue, leaks magenta, surface before the true one cyan, beside it yellow, unsampled brown.
    pub(crate) fn write(&self, name: &str) {
        let color = |verdict: &Verdict| match *verdict {
            Verdict::Empty => [0, 60, 40],
            Verdict::Unsampled => [80, 50, 20],
            Verdict::Right { ours, .. } => [(ours / 30.0 * 255.0).min(255.0) as u8; 3],
            Verdict::Hole => [255, 0, 0],
            Verdict::Short => [255, 140, 0],
            Verdict::Over => [60, 60, 255],
            Verdict::Leak => [255, 0, 255],
            Verdict::Before => [0, 255, 255],
            Verdict::Beside => [200, 200, 0],
        };
        let [width, height] = [self.width, self.verdicts.len() / self.width].map(|side| side as u32);
        let pixels = self.verdicts.iter().flat_map(color).collect();
        let image = image::RgbImage::from_vec(width, height, pixels).expect("three bytes a pixel");
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("truth-{name}.png"));
        image.save(&path).expect("a place to write pictures to");
        println!("verdicts in {}", path.display());
    }
}

fn inside(exact: &Exact, pixel: usize) -> bool {
    exact.around(pixel, INSIDE_PX).all(|surface| surface.is_some())
}

/// Whether all surface near this pixel, and there is some, is not sampled.
fn beside_unsampled(exact: &Exact, pixel: usize) -> bool {
    let mut surface = exact.around(pixel, INSIDE_PX).flatten().peekable();
    surface.peek().is_some() && surface.all(|surface| !surface.sampled())
}

/// The verdict where there is a surface and one is shown.
fn compare(exact: &Exact, pixel: usize, surface: &Surface, shown: &Shown, neighbors: &Neighbors) -> Verdict {
    let tolerance = surface.k_radius;
    if (shown.depth - surface.depth).abs() <= tolerance {
        let degrees = |normal: DVec3| {
            // The angle's sine is exact where its cosine is not.
            normal.cross(surface.normal).length().atan2(normal.dot(surface.normal).abs()).to_degrees()
        };
        return Verdict::Right { ours: degrees(shown.normal), reference: degrees(neighbors.normal(shown.point)) };
    }
    let around = || exact.around(pixel, 1);
    let depths = || around().flatten().map(|surface| surface.depth);
    if shown.depth < depths().fold(f64::INFINITY, f64::min) - tolerance {
        Verdict::Before
    } else if around().all(|surface| surface.is_some())
        && shown.depth > depths().fold(f64::NEG_INFINITY, f64::max) + tolerance
    {
        Verdict::Leak
    } else {
        Verdict::Beside
    }
}

impl Measures {
    pub(crate) const HEADER: &str =
        "spacing px  sampled %     IoU  holes %  leaks %  before %  normals °  reference °  ratio";

    /// Mean error of our normals over that of the reference.
    pub(crate) fn ratio(&self) -> f64 {
        self.ours / self.reference
    }
}

impl fmt::Display for Measures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { spacing_px, sampled, iou, holes, leaks, before, ours, reference } = *self;
        let [sampled, holes, leaks, before] = [sampled, holes, leaks, before].map(|share| 100.0 * share);
        write!(f, "{spacing_px:10.2}{sampled:11.2}{iou:8.4}{holes:9.3}{leaks:9.3}{before:10.3}")?;
        write!(f, "{ours:11.2}{reference:13.2}{:7.3}", self.ratio())
    }
}
