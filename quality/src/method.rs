//! The compared methods of drawing points.

use std::collections::HashMap;
use std::num::NonZero;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use anyhow::Result;
use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::{DVec3, Vec3};
use autosplats::{
    Background, Camera, ColorMode, Normals, PointSurfel, Reconstruction, Renderer, SearchEngine, Settings, Shading,
};
use rayon::prelude::*;

use crate::light::{BACKGROUND, Lit};
use crate::neighbors::Neighbors;
use crate::picture::{DrawnSurface, Picture};
use crate::rays::Rays;
use crate::subject::Subject;

/// Numbers of neighbours of the plane fits.
pub const FIT_KS: [usize; 4] = [10, 40, 160, 640];
/// Side of a dot, pixels.
const DOT_PX: isize = 3;

/// A method of drawing points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// This project's default settings.
    Ours,
    /// The paper's settings, [`paper`].
    Paper,
    /// Squares of 3x3 pixels without normals, the nearest in front.
    Dots,
    /// The paper's splats, but trimmed, with normals of plane fits to this number of exact nearest neighbours in the
    /// whole cloud. Outliers are neighbours too, but are not drawn.
    Fit(usize),
    /// Our splats as discs, of points without noise, misregistration and outliers, with the surface's own normals.
    /// Points just beyond borders are left out. The pictures have no errors of normals and places.
    Known,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 8] = [
        Self::Ours,
        Self::Paper,
        Self::Dots,
        Self::Fit(10),
        Self::Fit(40),
        Self::Fit(160),
        Self::Fit(640),
        Self::Known,
    ];

    /// The name in tables and records.
    pub fn name(self) -> String {
        match self {
            Self::Ours => "ours".into(),
            Self::Paper => "paper".into(),
            Self::Dots => "dots".into(),
            Self::Fit(k) => format!("fit {k}"),
            Self::Known => "known".into(),
        }
    }
}

/// The paper's settings. Every field is written out, so that new defaults change nothing.
pub fn paper() -> Reconstruction {
    Reconstruction {
        k: 10,
        points_per_pixel: 1,
        adaptive: false,
        engine: SearchEngine::default(),
        outlier_expansions: Some(1),
        gap_factor: Some(4.0),
        splat_scale: 1.0,
        ellipses: false,
        grid_culling: true,
        depth_refinement: true,
        trim: false,
        coherent: false,
        steady: false,
        frames_averaged: 1,
    }
}

/// Settings that show the shape alone: one colour on a plain background, with all layers.
pub fn plain(reconstruction: Reconstruction) -> Settings {
    let background = Background::Color(BACKGROUND);
    let shading = Shading { color: ColorMode::Plain, background, ..Shading::default() };
    Settings { reconstruction, shading, all_layers: true }
}

/// Draws one subject. Keeps the renderer and the plane fits for further pictures.
#[derive(Debug)]
pub struct Painter<'a> {
    subject: &'a Subject,
    renderer: Renderer,
    fits: Fits,
}

impl<'a> Painter<'a> {
    /// A painter of `subject`.
    pub fn new(subject: &'a Subject) -> Self {
        Self { subject, renderer: Renderer::new(), fits: Fits::default() }
    }

    /// Draws a picture of `size` pixels.
    ///
    /// # Errors
    /// An invalid camera, or an error of the renderer.
    pub fn paint(&mut self, method: Method, camera: &Camera, size: [u32; 2]) -> Result<Picture> {
        let subject = self.subject;
        match method {
            Method::Ours => self.render(Reconstruction::default(), camera, size),
            Method::Paper => self.render(paper(), camera, size),
            Method::Dots => Ok(dots(subject, &Rays::new(camera, size)?, size)),
            Method::Fit(k) => {
                // Fits are compared by their normals. Untrimmed splats would add errors at silhouettes.
                let trimmed = Reconstruction { trim: true, ..paper() };
                let mut surfels = self.surfels(&subject.cloud, &trimmed, camera, size)?;
                // This reference knows the outliers and draws none.
                surfels.retain(|surfel| !subject.is_outlier(surfel.point));
                let normals = self.fits.normals(&subject.cloud, &surfels, k);
                self.draw(&subject.cloud, trimmed, surfels.iter().zip(normals), camera, size)
            }
            Method::Known => {
                let (cloud, rays) = (&subject.clean_cloud, Rays::new(camera, size)?);
                let surfels = self.surfels(cloud, &Reconstruction::default(), camera, size)?;
                let seen = surfels.par_iter().filter(|surfel| !subject.is_beyond_border(surfel.point, &rays));
                let seen: Vec<_> = seen.map(|surfel| (surfel, subject.normal(surfel.point).as_vec3())).collect();
                self.draw(cloud, Reconstruction::default(), seen.into_iter(), camera, size)
            }
        }
    }

    /// Surfels of all points of `cloud` that may be visible, with their radii.
    fn surfels(
        &mut self,
        cloud: &PointCloud,
        reconstruction: &Reconstruction,
        camera: &Camera,
        size: [u32; 2],
    ) -> Result<Vec<PointSurfel>> {
        // Culling would leave visible points without surfels.
        let all = plain(Reconstruction { grid_culling: false, ..reconstruction.clone() });
        self.renderer.render(cloud, camera, size, &all)?;
        let mut surfels = self.renderer.surfels()?;
        surfels.retain(|surfel| surfel.radius > 0.0);
        Ok(surfels)
    }

    /// Draws these surfels of `cloud` alone, as discs with these normals.
    fn draw<'s>(
        &mut self,
        cloud: &PointCloud,
        reconstruction: Reconstruction,
        surfels: impl Iterator<Item = (&'s PointSurfel, Vec3)>,
        camera: &Camera,
        size: [u32; 2],
    ) -> Result<Picture> {
        let mut normals = Normals {
            normals: vec![[f32::NAN; 3]; cloud.len()],
            curvature: vec![0.0; cloud.len()],
            radius: vec![f32::NAN; cloud.len()],
        };
        for (surfel, normal) in surfels {
            normals.normals[surfel.point as usize] = normal.to_array();
            normals.radius[surfel.point as usize] = surfel.radius;
        }
        let frame = self.renderer.render_with_normals(cloud, &normals, camera, size, &plain(reconstruction))?;
        Ok(Picture::new(frame.layers, &Rays::new(camera, size)?))
    }

    /// Draws a picture with the renderer's own normals.
    ///
    /// # Errors
    /// An invalid camera, or an error of the renderer.
    pub fn render(&mut self, reconstruction: Reconstruction, camera: &Camera, size: [u32; 2]) -> Result<Picture> {
        Ok(self.render_lit(reconstruction, camera, size)?.0)
    }

    /// Draws a picture and returns the renderer's own light too, in which pictures of a sequence are averaged.
    ///
    /// # Errors
    /// An invalid camera, or an error of the renderer.
    pub fn render_lit(
        &mut self,
        reconstruction: Reconstruction,
        camera: &Camera,
        size: [u32; 2],
    ) -> Result<(Picture, Lit)> {
        let frame = self.renderer.render(&self.subject.cloud, camera, size, &plain(reconstruction))?;
        let picture = Picture::new(frame.layers, &Rays::new(camera, size)?);
        let lit = Lit::of(frame.image, &picture);
        Ok((picture, lit))
    }
}

/// Plane fits of all points drawn so far.
#[derive(Debug, Default)]
struct Fits {
    neighbors: Option<Neighbors>,
    /// Normals of each point, for each of [`FIT_KS`].
    found: HashMap<u32, [Vec3; FIT_KS.len()]>,
}

impl Fits {
    /// Normals of planes fitted to the k nearest neighbours of the surfels' points. `cloud` must be the same in all
    /// calls.
    fn normals(&mut self, cloud: &PointCloud, surfels: &[PointSurfel], k: usize) -> Vec<Vec3> {
        let first = NonZero::new(FIT_KS[0]).expect("above 0");
        let neighbors = self.neighbors.get_or_insert_with(|| Neighbors::new(cloud, first));
        let points = || surfels.iter().map(|surfel| surfel.point);
        let missing: Vec<u32> = points().filter(|point| !self.found.contains_key(point)).collect();
        let fit = |&point: &u32| {
            let normals = neighbors.normals(point, &FIT_KS);
            (point, std::array::from_fn(|i| normals[i].as_vec3()))
        };
        let found: Vec<_> = missing.par_iter().map(fit).collect();
        self.found.extend(found);
        let which = FIT_KS.iter().position(|&number| number == k).expect("one of the numbers");
        points().map(|point| self.found[&point][which]).collect()
    }
}

/// Draws each point as a square with sides of [`DOT_PX`] pixels.
fn dots(subject: &Subject, rays: &Rays, [width, height]: [u32; 2]) -> Picture {
    let [width, height] = [width, height].map(|side| side as isize);
    // The bits of positive floats are ordered like the floats.
    let pixels: Vec<AtomicU64> = (0..width * height).map(|_| AtomicU64::new(u64::MAX)).collect();
    let cloud = &subject.cloud;
    (0..cloud.len()).into_par_iter().for_each(|point| {
        let Some((at, depth)) = rays.project(cloud.world_position(point)) else { return };
        let key = u64::from((depth as f32).to_bits()) << 32 | point as u64;
        let [x, y] = at.map(|at| at.floor().clamp(-1e9, 1e9) as isize - DOT_PX / 2);
        for y in y.max(0)..(y + DOT_PX).min(height) {
            for x in x.max(0)..(x + DOT_PX).min(width) {
                pixels[(y * width + x) as usize].fetch_min(key, Relaxed);
            }
        }
    });
    let show = |pixel: &AtomicU64| {
        let key = pixel.load(Relaxed);
        let depth = f64::from(f32::from_bits((key >> 32) as u32));
        (key != u64::MAX).then_some(DrawnSurface { depth, normal: DVec3::ZERO, point: key as u32 })
    };
    Picture { width: width as usize, shown: pixels.iter().map(show).collect() }
}
