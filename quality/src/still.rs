//! Pictures against a truth of 16 rays per pixel.
//!
//! One ray through a pixel's middle gives the normal and outline there. A picture should show the mean of all details
//! in the pixel. So lit pictures are compared with this finer truth too. Among them are stills, as `autosplats render`
//! and a window at rest make them: rendered twice as wide and high, and averaged.

use anyhow::Result;
use autosplats::{Camera, Reconstruction};

use crate::case::Case;
use crate::exact::Exact;
use crate::light::Lit;
use crate::measure::Truth;
use crate::method::{Method, Painter};
use crate::picture::Picture;
use crate::rays::Rays;
use crate::subject::Subject;

/// Number of rays per pixel along each side.
pub const RAYS_PER_SIDE: u32 = 4;
/// Factor of a still's width and height before averaging.
pub const SUPERSAMPLE: u32 = 2;

/// PSNR in decibels against the truth of 16 rays, over the pixels that the picture or the truth of one ray covers.
#[derive(Clone, Debug)]
pub struct Still {
    /// PSNR of the truth of one ray per pixel.
    pub one_ray: f64,
    /// PSNR of our still.
    pub still: f64,
    /// PSNR of each method's picture.
    pub methods: Vec<(Method, f64)>,
}

/// The lit truth of 16 rays per pixel, averaged to `size` pixels.
///
/// # Errors
/// An invalid camera.
pub fn smooth(subject: &Subject, camera: &Camera, size: [u32; 2]) -> Result<Lit> {
    let fine = Exact::trace_surface(subject, camera, size.map(|side| side * RAYS_PER_SIDE))?;
    Ok(Lit::new(&Picture::truth(&fine), &fine.rays).averaged(RAYS_PER_SIDE as usize))
}

/// Measures each method's lit picture of a case, and our still.
///
/// # Errors
/// An invalid camera, or an error of the renderer.
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
