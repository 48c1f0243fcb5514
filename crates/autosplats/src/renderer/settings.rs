//! What a picture can be asked to be.

use crate::Error;

/// Everything about a picture but the cloud, the camera and the size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// How points become splats.
    pub reconstruction: Reconstruction,
    /// How splats become an image.
    pub shading: Shading,
    /// Layers to fill although the shading does not need them, for writing them out.
    pub all_layers: bool,
}

/// How points become splats. The defaults are the paper's.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruction {
    /// Neighbours per point, 1 to 64.
    pub k: u32,
    /// Implementation of the k-radius search.
    pub engine: SearchEngine,
    /// e0: points without a neighbour after this many expansions of their first search radius, each by √k, are
    /// discarded as outliers; 0 to 8. `None` keeps every point [Paper, §5.3].
    pub outlier_expansions: Option<u32>,
    /// λ: a search that has at least one neighbour ends with those it has when its circle's area grows by this factor
    /// without meeting another; above 1. `None` bridges any gap [Paper, §5.3].
    pub gap_factor: Option<f32>,
    /// Factor on every splat radius, 0.01 to 100.
    pub splat_scale: f32,
    /// Draw ellipses along the principal axes of each neighbourhood instead of circles [Paper, §6].
    pub ellipses: bool,
    /// Reconstruct points behind the nearest one of their screen cell only where they turn out visible [Paper, §7].
    pub grid_culling: bool,
    /// Redraw the depth map twice without the splats of hidden points [Paper, §7].
    pub depth_refinement: bool,
}

/// An implementation of the k-radius search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum SearchEngine {
    /// Buckets of screen points read outwards from each point; exact, in one pass.
    #[default]
    ScreenGrid,
}

/// How splats become an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Shading {
    /// What the surface is coloured by.
    pub color: ColorMode,
    /// Values at the two ends of the colour map; `None` takes the 1st and 99th percentile of the picture.
    pub range: Option<[f32; 2]>,
    /// Colours for scalar values; `None` takes the one that suits the colour mode.
    pub color_map: Option<ColorMap>,
    /// Draw the colour map with its range into the picture, where the colour mode has one.
    pub legend: bool,
    /// Light the surface by its normals; otherwise colours are shown as they are.
    pub lighting: bool,
    /// Strength of eye-dome lighting, the darkening at depth steps; 0 (off) to 10.
    pub eye_dome: f32,
    /// What is seen where no surface is.
    pub background: Background,
}

/// What the surface is coloured by.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum ColorMode {
    /// The points' own colours where they have any, else one light clay tone.
    #[default]
    Auto,
    /// The points' own colours.
    Rgb,
    /// One light clay tone.
    Plain,
    /// World coordinate along the cloud's up axis.
    Height,
    /// A colour for each class of field `Classification`, by the ASPRS table.
    Classification,
    /// A scalar field by name, letter case ignored; `Intensity` is one.
    Field(String),
    /// World-space normal, each component from -1..1 to 0..1.
    Normal,
    /// Surface variation λ0/(λ0+λ1+λ2), 0 (flat) to 1/3.
    Curvature,
    /// Splat radius in world units.
    Radius,
    /// Distance to the k-th neighbour in world units; red where sampling is sparse, as in the paper's Figure 12.
    KRadius,
    /// Depth along the viewing axis in world units.
    Depth,
}

/// Colours for scalar values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ColorMap {
    /// Dark violet over green to yellow: perceptually uniform, readable for the colour-blind. The usual one.
    Viridis,
    /// Black over violet and orange to white-yellow.
    Inferno,
    /// Dark to light blue, green, red: a smooth rainbow.
    Turbo,
    /// Black to white.
    Gray,
    /// Pale grey over orange to dark red: the high end is a warning. The one for radii.
    Reds,
}

/// What is seen where no surface is. Colours are sRGB, 8 bits a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Background {
    /// One colour.
    Color([u8; 3]),
    /// From the first colour at the top to the second at the bottom.
    Gradient([u8; 3], [u8; 3]),
    /// Nothing: alpha is 0.
    Transparent,
}

impl Default for Reconstruction {
    fn default() -> Self {
        Self {
            k: 10,
            engine: SearchEngine::default(),
            outlier_expansions: Some(3),
            gap_factor: Some(4.0),
            splat_scale: 1.0,
            ellipses: false,
            grid_culling: true,
            depth_refinement: true,
        }
    }
}

impl Default for Shading {
    fn default() -> Self {
        Self {
            color: ColorMode::Auto,
            range: None,
            color_map: None,
            legend: false,
            lighting: true,
            eye_dome: 0.0,
            background: Background::Gradient([0x3a, 0x41, 0x4b], [0x17, 0x1a, 0x1f]),
        }
    }
}

impl Settings {
    /// Checks every value against its range.
    ///
    /// # Errors
    /// [`Error::Setting`] names the first one outside.
    pub fn check(&self) -> Result<(), Error> {
        fn within(name: &'static str, ok: bool, value: impl ToString, range: &'static str) -> Result<(), Error> {
            if ok { Ok(()) } else { Err(Error::Setting { name, value: value.to_string(), range }) }
        }
        let Reconstruction { k, outlier_expansions, gap_factor, splat_scale, .. } = self.reconstruction;
        within("k", (1..=64).contains(&k), k, "within 1 to 64")?;
        let e0 = outlier_expansions.unwrap_or(0);
        within("outlier_expansions", e0 <= 8, e0, "within 0 to 8")?;
        let lambda = gap_factor.unwrap_or(4.0);
        within("gap_factor", lambda > 1.0 && lambda.is_finite(), lambda, "above 1")?;
        within("splat_scale", (0.01..=100.0).contains(&splat_scale), splat_scale, "within 0.01 to 100")?;
        within("eye_dome", (0.0..=10.0).contains(&self.shading.eye_dome), self.shading.eye_dome, "within 0 to 10")?;
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
