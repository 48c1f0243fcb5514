//! What a picture can be asked to be.

use std::borrow::Cow;

use autosplats_cloud::PointCloud;

use crate::Error;
use crate::fit::{HANDFUL, LONGEST};
use crate::search::SearchEngine;
use crate::shade::Shading;
use crate::splat::STEADY_FRAMES;

/// A margin is one part in so many of the picture's shorter side.
const MARGIN_PART: u32 = 12;
/// Radius of the splats that a handful of points is, as a part of the picture's shorter side; what is drawn of them is 1.4 times as
/// wide.
const HANDFUL_DOT: f32 = 0.0045;

/// Everything about a picture but the cloud, the camera and the size.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct Settings {
    /// How points become splats.
    pub reconstruction: Reconstruction,
    /// How splats become an image.
    pub shading: Shading,
    /// Layers to fill although the shading does not need them, for writing them out.
    pub all_layers: bool,
}

/// How points become splats. The default goes beyond [the paper's](Self::paper) in
/// [`points_per_pixel`](Self::points_per_pixel), [`adaptive`](Self::adaptive) and [`trim`](Self::trim).
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct Reconstruction {
    /// Neighbours per point, 1 to 64.
    pub k: u32,
    /// Most points that a pixel keeps, 1 or 2: the nearest, as in the paper, or the nearest of each half. Two show silhouettes,
    /// thin parts and whatever has points denser than pixels more truly, and take up to twice as long to search and to fit.
    /// The engine [`SearchEngine::SplatCommunication`] and devices too small for two have one.
    pub points_per_pixel: u32,
    /// Fit larger neighbourhoods, of up to thousands of points, where points scatter too much for k neighbours to tell the
    /// surface, and move splats onto what is fitted, as circles. Points in rows, as a spinning lidar leaves them, get ellipses
    /// that reach the next row, where rows make a surface. Points far from their neighbours and on no surface become dots or,
    /// unless outliers are kept, are discarded. A neighbourhood of one ends at wider gaps ([`gap_factor`](Self::gap_factor)). Points in
    /// a margin around the picture count as neighbours, a twelfth of its shorter side wide, where a device has room for it and
    /// the engine is not [`SearchEngine::SplatCommunication`]. Else a surface without noise or rows is left as it is. A cloud of
    /// fewer than 64 finite points is drawn as dots, whole and each frame by itself.
    pub adaptive: bool,
    /// Implementation of the k-radius search.
    pub engine: SearchEngine,
    /// e0: points without a neighbour after this many expansions of their first search radius, each by √k (√10 at least),
    /// are discarded as outliers; 0 to 8. `None` keeps every point [Paper, §5.3].
    pub outlier_expansions: Option<u32>,
    /// λ: a search that has at least one neighbour ends with those it has when its circle's area grows by this factor
    /// without meeting another; above 1. `None` bridges any gap [Paper, §5.3]. With [`adaptive`](Self::adaptive) it has to
    /// grow by λ² after a single neighbour.
    pub gap_factor: Option<f32>,
    /// Factor on every splat radius, 0.01 to 10.
    pub splat_scale: f32,
    /// Draw ellipses along the principal axes of each neighbourhood instead of circles [Paper, §6], but for splats that
    /// [`adaptive`](Self::adaptive) fitted.
    pub ellipses: bool,
    /// Reconstruct points behind the nearest one of their screen cell only where they turn out visible [Paper, §7].
    pub grid_culling: bool,
    /// Redraw the depth map twice without the splats of hidden points [Paper, §7].
    pub depth_refinement: bool,
    /// End silhouettes where points do, or, if noise has blurred them and the setting is [`adaptive`](Self::adaptive), where points
    /// become few. Without, silhouettes are too wide by as much as splats are.
    pub trim: bool,
    /// Temporal coherence: start the search of each point from the k-radius that the last frame of the same [`Renderer`] found
    /// where the point was then. It saves time and changes no picture. Of [`SearchEngine::ScreenGrid`]; the paper's and its rival
    /// take each frame by itself.
    ///
    /// [`Renderer`]: crate::Renderer
    pub coherent: bool,
    /// Temporal smoothing while nothing but the camera moves: what is fitted to a point is averaged over about eight frames of
    /// the same [`Renderer`], cloud and settings that follow each other, with weights that fade. Noise shimmers less, and
    /// normals are nearer to the truth. The image, but not the layers, is then averaged with the last one where the same
    /// surface was seen, each by half: so detail finer than pixels shimmers less. A frame then depends on those before; one after
    /// another that was given up, or had another size on a device, begins anew.
    ///
    /// [`Renderer`]: crate::Renderer
    pub steady: bool,
    /// Temporal smoothing of points that are others in each frame, as live ones are, noisy anew each time: surfaces are averaged
    /// over about so many frames of the same [`Renderer`], 1 to 32, that follow each other with such a setting. 1, the default,
    /// takes each frame by itself. What moves lags behind, unless it moves by more than half its k-radius a frame; a frame then
    /// depends on those before. Frames of the same points are averaged as if they were to be
    /// [`steady`](Self::steady).
    ///
    /// [`Renderer`]: crate::Renderer
    pub frames_averaged: u32,
}

impl Default for Reconstruction {
    fn default() -> Self {
        Self {
            k: 10,
            points_per_pixel: 2,
            adaptive: true,
            engine: SearchEngine::default(),
            outlier_expansions: Some(1),
            gap_factor: Some(4.0),
            splat_scale: 1.0,
            ellipses: false,
            grid_culling: true,
            depth_refinement: true,
            trim: true,
            coherent: true,
            steady: false,
            frames_averaged: 1,
        }
    }
}

impl Reconstruction {
    /// What the paper does: one point a pixel, k = 10 for all, whole splats, and each frame by itself.
    pub fn paper() -> Self {
        Self { points_per_pixel: 1, adaptive: false, trim: false, coherent: false, ..Self::default() }
    }

    /// Over how many frames surfels are averaged: of the same points, and of others.
    pub(super) fn averaged(&self) -> [u32; 2] {
        [self.frames_averaged.max(if self.steady { STEADY_FRAMES } else { 1 }), self.frames_averaged]
    }

    /// Whether frames depend on those before.
    pub(super) fn smooths(&self) -> bool {
        self.averaged() != [1; 2]
    }

    /// Longest ellipse, semi-major over semi-minor axis.
    pub(super) fn longest(&self) -> f32 {
        if self.ellipses { LONGEST } else { 1.0 }
    }

    /// K-radius of k neighbours over their splat's radius.
    pub(super) fn k_radius_per_radius(&self) -> f32 {
        0.5 * (self.k as f32).sqrt() / self.splat_scale
    }

    /// Pixels around a picture of this size whose points are neighbours to those within. What fits large neighbourhoods would fit
    /// one-sided ones along its edges, and see borders of noisy surfaces there. The paper's search ends with the picture: of the
    /// thousandth of the points that it leaves unfinished few are seen, and more of those around a picture hide much of it.
    pub(super) fn margin(&self, size: [u32; 2]) -> u32 {
        let wants = self.adaptive && self.engine != SearchEngine::SplatCommunication;
        if wants { size[0].min(size[1]).div_ceil(MARGIN_PART) } else { 0 }
    }

    /// Whether the search of a frame starts from what the last one found.
    pub(super) fn remembers(&self) -> bool {
        self.coherent && self.engine == SearchEngine::ScreenGrid
    }

    /// Whether halves of pixels keep a point each.
    pub(super) fn halves(&self) -> bool {
        self.points_per_pixel == 2 && self.engine != SearchEngine::SplatCommunication
    }
}

impl Settings {
    /// What a cloud is drawn with in a picture of this size, and the splat radius in pixels of the dots that it is; 0 if it is
    /// surface. Dots are drawn as they are.
    // Differs from the paper: a handful tells of no surface, and discs as wide as its points are apart would hide each other and
    // how few they are.
    pub(super) fn of_cloud(&self, cloud: &PointCloud, size: [u32; 2]) -> (Cow<'_, Self>, f32) {
        let finite = cloud.positions().iter().filter(|position| position.iter().all(|along| along.is_finite()));
        let Reconstruction { adaptive, splat_scale, .. } = self.reconstruction;
        if !adaptive || finite.take(HANDFUL).count() == HANDFUL {
            return (Cow::Borrowed(self), 0.0);
        }
        let reconstruction =
            Reconstruction { adaptive: false, trim: false, steady: false, frames_averaged: 1, ..self.reconstruction };
        let dot_px = splat_scale * HANDFUL_DOT * size[0].min(size[1]) as f32;
        (Cow::Owned(Self { reconstruction, ..self.clone() }), dot_px)
    }

    /// Checks every value against its range.
    ///
    /// # Errors
    /// [`Error::Setting`] names the first one outside.
    pub fn check(&self) -> Result<(), Error> {
        fn within(name: &'static str, ok: bool, value: impl ToString, range: &'static str) -> Result<(), Error> {
            if ok { Ok(()) } else { Err(Error::Setting { name, value: value.to_string(), range }) }
        }
        let Reconstruction {
            k,
            points_per_pixel,
            engine,
            outlier_expansions,
            gap_factor,
            splat_scale,
            frames_averaged,
            ..
        } = self.reconstruction;
        within("k", (1..=64).contains(&k), k, "within 1 to 64")?;
        within("points_per_pixel", (1..=2).contains(&points_per_pixel), points_per_pixel, "1 or 2")?;
        if let SearchEngine::KdTree { first_radius: r } = engine {
            within("first_radius", r > 0.0 && r.is_finite(), r, "above 0")?;
        }
        let e0 = outlier_expansions.unwrap_or(0);
        within("outlier_expansions", e0 <= 8, e0, "within 0 to 8")?;
        let lambda = gap_factor.unwrap_or(4.0);
        within("gap_factor", lambda > 1.0 && lambda.is_finite(), lambda, "above 1")?;
        within("splat_scale", (0.01..=10.0).contains(&splat_scale), splat_scale, "within 0.01 to 10")?;
        within("frames_averaged", (1..=32).contains(&frames_averaged), frames_averaged, "within 1 to 32")?;
        let exposure = self.shading.exposure.unwrap_or(1.0);
        within("exposure", (0.01..=100.0).contains(&exposure), exposure, "within 0.01 to 100")?;
        within("occlusion", (0.0..=10.0).contains(&self.shading.occlusion), self.shading.occlusion, "within 0 to 10")?;
        if let Some([low, high]) = self.shading.range {
            within(
                "range",
                low < high && (high - low).is_finite(),
                format!("{low}..{high}"),
                "two numbers, the lower first",
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::PointCloud;
    use autosplats_cloud::glam::DVec3;

    use super::*;
    use crate::{Camera, Projection, Renderer, test_clouds};

    #[test]
    fn k_radii_come_back_from_splat_radii() {
        let cloud = PointCloud::new(DVec3::ZERO, test_clouds::plane(2000));
        let camera = Camera {
            eye: DVec3::new(0.0, 0.0, 3.0),
            look_at: DVec3::ZERO,
            up: DVec3::Y,
            projection: Projection::PerspectiveFovDeg(50.0),
        };
        for (k, splat_scale) in [(10, 1.0), (16, 0.7)] {
            let reconstruction = Reconstruction { k, splat_scale, ..Reconstruction::paper() };
            let per_radius = reconstruction.k_radius_per_radius();
            let mut renderer = Renderer::new();
            let settings = Settings { reconstruction, ..Settings::default() };
            renderer.render(&cloud, &camera, [300, 200], &settings).expect("a picture");
            let surfels = renderer.surfels().expect("surfels");
            let drawn: Vec<_> = surfels.iter().filter(|surfel| surfel.radius > 0.0).collect();
            let is_right =
                |surfel: &&&crate::PointSurfel| (per_radius * surfel.radius / surfel.k_radius - 1.0).abs() < 1e-4;
            let right = drawn.iter().filter(is_right).count();
            // All but those with fewer neighbours than k, or more at the same distance.
            assert!(10 * right > 9 * drawn.len() && right > 500, "k {k}: {right} of {}", drawn.len());
        }
    }
}
