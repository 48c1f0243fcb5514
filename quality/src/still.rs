//! Pictures against a truth with many rays for each pixel, which knows what is finer than one.
//!
//! One ray through the middle of a pixel tells normals and outlines there. A picture is to show all of the pixel: of what is finer,
//! the mean. So lit pictures are held against this truth as well, and among them stills, as `autosplats render` and a window at
//! rest make them: rendered twice as wide and high, and averaged.

use anyhow::Result;
use autosplats::{Camera, Reconstruction};

use crate::case::Case;
use crate::exact::Exact;
use crate::light::Lit;
use crate::measure::Truth;
use crate::method::{Method, Painter};
use crate::picture::Picture;
use crate::subject::Subject;
use crate::view::Rays;

/// Rays for each pixel along a side.
pub const RAYS: u32 = 4;
/// How many times as wide and high stills are rendered.
pub const SUPERSAMPLE: u32 = 2;

/// PSNR in decibels against the truth of many rays, over the pixels that either the picture or the truth of one ray covers.
#[derive(Clone, Debug)]
pub struct Still {
    /// Of the truth of one ray.
    pub one_ray: f64,
    /// Of ours as a still.
    pub still: f64,
    /// Of each method's picture.
    pub methods: Vec<(Method, f64)>,
}

/// The truth of many rays, lit, in a picture of `size` pixels.
///
/// # Errors
/// A camera that cannot see.
pub fn smooth(subject: &Subject, camera: &Camera, size: [u32; 2]) -> Result<Lit> {
    let fine = Exact::trace_alone(subject, camera, size.map(|side| side * RAYS))?;
    Ok(Lit::new(&Picture::truth(&fine), &fine.rays).averaged(RAYS as usize))
}

/// Measures what was drawn in a case, `lit` of each method, and ours as a still besides.
///
/// # Errors
/// What the renderer refuses.
pub fn measure<'a>(
    case: &Case,
    subject: &Subject,
    painter: &mut Painter<'_>,
    truth: &Truth,
    lit: impl Iterator<Item = (Method, &'a Lit)>,
) -> Result<Still> {
    let camera = &truth.exact.rays.camera;
    let smooth = smooth(subject, camera, case.size)?;
    let size = case.size.map(|side| side * SUPERSAMPLE);
    let large = painter.render(Reconstruction::default(), camera, size)?;
    let still = Lit::new(&large, &Rays::new(camera, size)?).averaged(SUPERSAMPLE as usize);
    let psnr = |lit: &Lit| truth.psnr_against(lit, &smooth);
    Ok(Still {
        one_ray: psnr(&truth.lit),
        still: psnr(&still),
        methods: lit.map(|(method, lit)| (method, psnr(lit))).collect(),
    })
}
