//! Settings of a picture, and their ranges.

use crate::Error;
use crate::points::Points;
use crate::search::SearchEngine;
use crate::shade::{ColorMode, Shading};

/// Settings of a picture: everything except the cloud, the camera and the size.
///
/// # Examples
///
/// ```
/// use autosplats::{ColorMode, Settings};
///
/// let mut settings = Settings::default();
/// settings.reconstruction.k = 16;
/// settings.shading.color = ColorMode::Height;
/// settings.check()?;
/// # Ok::<(), autosplats::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct Settings {
    /// How points become splats.
    pub reconstruction: Reconstruction,
    /// How splats become an image.
    pub shading: Shading,
    /// Fill all layers, including those that the shading does not need, for writing them out. Default: off.
    pub all_layers: bool,
}

/// How points become splats. Beyond [the paper's settings](Self::paper), the default turns on
/// [`points_per_pixel`](Self::points_per_pixel), [`adaptive`](Self::adaptive), [`trim`](Self::trim) and
/// [`coherent`](Self::coherent).
///
/// # Examples
///
/// ```
/// use autosplats::{Reconstruction, Settings};
///
/// let reconstruction = Reconstruction { ellipses: true, ..Reconstruction::paper() };
/// assert_eq!((reconstruction.k, reconstruction.points_per_pixel), (10, 1));
/// let settings = Settings { reconstruction, ..Settings::default() };
/// # settings.check()?;
/// # Ok::<(), autosplats::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct Reconstruction {
    /// Neighbours per point, 1 to 64. Default: 10.
    pub k: u32,
    /// Most points that a pixel keeps, 1 or 2. Default: 2.
    ///
    /// 1 keeps the nearest point, as in the paper. 2 keeps the nearest point of each half of the pixel. Two points
    /// preserve silhouettes and thin parts where points are denser than pixels; search and fit take up to twice as
    /// long. [`SearchEngine::SplatCommunication`], in both forms, and devices with too little memory always use 1. See
    /// docs/decisions/0001-two-points-a-pixel.md.
    pub points_per_pixel: u32,
    /// Adapt the reconstruction to noise, scan lines, outliers and tiny clouds. Default: on.
    ///
    /// * Noise: where k neighbours are too noisy, up to thousands of points are fitted, and splats move onto the fit as
    ///   circles.
    /// * Scan lines, as of a spinning lidar, get ellipses that reach the next line, where the lines form a surface.
    /// * Points that are far from their neighbours and lie on no surface become dots, or are discarded unless
    ///   [`outlier_expansions`](Self::outlier_expansions) is `None`.
    /// * A neighbourhood of a single neighbour ends only at a wider [gap](Self::gap_factor).
    /// * Points in a margin around the picture count as neighbours. The margin is a twelfth of the picture's shorter
    ///   side. [`SearchEngine::SplatCommunication`], in both forms, and devices with too little memory have no margin.
    /// * A cloud of fewer than 64 finite points is drawn as dots, without trimming or temporal smoothing.
    ///
    /// Surfaces without noise and scan lines stay as they are.
    pub adaptive: bool,
    /// Implementation of the k-radius search. Default: [`SearchEngine::ScreenGrid`].
    pub engine: SearchEngine,
    /// e0: number of expansions of the first search radius, 0 to 8. Default: 1. A point without a neighbour after them
    /// is discarded as an outlier. Each expansion multiplies the radius by √k, at least by √10. `None` keeps every
    /// point [Paper, §5.3].
    pub outlier_expansions: Option<u32>,
    /// λ: growth of a search circle's area that counts as a gap, above 1. Default: 4. A search with at least one
    /// neighbour ends when its circle grows by this factor without meeting another. With [`adaptive`](Self::adaptive)
    /// the circle of a single neighbour has to grow by λ². `None` bridges any gap [Paper, §5.3].
    pub gap_factor: Option<f32>,
    /// Factor on every splat radius, 0.01 to 10. Default: 1.
    pub splat_scale: f32,
    /// Draw ellipses along the principal axes of each neighbourhood instead of circles [Paper, §6]. Default: off.
    /// Splats that [`adaptive`](Self::adaptive) fits stay circles.
    pub ellipses: bool,
    /// Reconstruct points behind the nearest point of their screen cell only where they turn out to be visible
    /// [Paper, §7]. Default: on.
    pub grid_culling: bool,
    /// Redraw the depth map twice without the splats of hidden points [Paper, §7]. Default: on.
    pub depth_refinement: bool,
    /// Trim silhouettes to where the points end. Default: on. With [`adaptive`](Self::adaptive), a silhouette that is
    /// blurred by noise ends where points become sparse. Without trimming, silhouettes are too wide by the width of the
    /// splats.
    pub trim: bool,
    /// Temporal coherence: start the search of each point from the k-radius that the last frame of the same
    /// [`Renderer`] found at that place. Default: on. Coherence saves time and does not change pictures. Only
    /// [`SearchEngine::ScreenGrid`] uses it.
    ///
    /// [`Renderer`]: crate::Renderer
    pub coherent: bool,
    /// Temporal smoothing while only the camera moves. Default: off. Noise and detail finer than pixels shimmer less,
    /// and normals become more accurate.
    ///
    /// The fit of each point is averaged over about eight successive frames of the same [`Renderer`], cloud and
    /// settings, with fading weights. Where the last image showed the same surface, the image becomes the mean of both;
    /// the layers stay as they are. A frame thus depends on earlier ones. Smoothing restarts after a cancelled frame
    /// and, on a GPU, after a change of size. See docs/decisions/0014-frame-to-frame.md.
    ///
    /// [`Renderer`]: crate::Renderer
    pub steady: bool,
    /// Number of successive frames, 1 to 32, over which surfaces are averaged when each frame has new points, as from a
    /// live sensor. Default: 1, each frame by itself.
    ///
    /// The frames must be of the same [`Renderer`] and settings. A frame then depends on earlier ones. Moving things
    /// lag behind, unless they move by more than half their k-radius per frame. Frames of the same points are smoothed
    /// as with [`steady`](Self::steady).
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
    /// The paper's settings: one point per pixel, k = 10 everywhere, untrimmed splats, and each frame by itself.
    pub fn paper() -> Self {
        Self { points_per_pixel: 1, adaptive: false, trim: false, coherent: false, ..Self::default() }
    }
}

impl Settings {
    /// The settings for any number of points, also none: no point has more neighbours than there are others, and no
    /// points show the background.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats::{Settings, cloud::PointCloud};
    ///
    /// let three = PointCloud::new(Default::default(), vec![[0.0; 3]; 3]);
    /// assert_eq!(Settings::default().for_points(&three).reconstruction.k, 2);
    /// ```
    #[must_use]
    pub fn for_points<'a>(&self, points: impl Into<Points<'a>>) -> Self {
        let points = points.into();
        let mut settings = self.clone();
        if points.is_empty() {
            // An empty cloud has no colours.
            settings.shading.color = ColorMode::Plain;
        }
        settings.reconstruction.k = settings.reconstruction.k.min(points.len().saturating_sub(1).max(1) as u32);
        settings
    }

    /// Checks every value against its range.
    ///
    /// # Errors
    /// [`Error::Setting`] names the first value outside its range.
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
