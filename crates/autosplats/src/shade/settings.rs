//! Settings of shading.

use std::str::FromStr;

use super::Background;

/// How splats become an image.
///
/// # Examples
///
/// ```
/// use autosplats::{Background, ColorMode, Renderer, Settings, Shading};
/// # use autosplats::{Camera, Projection, cloud::{PointCloud, glam::DVec3}};
/// # let floor = (0..10_000).map(|i| [(i % 100) as f32, (i / 100) as f32, 0.0]).collect();
/// # let cloud = PointCloud::new(DVec3::ZERO, floor);
/// # let (eye, look_at) = (DVec3::new(50.0, 50.0, 300.0), DVec3::new(50.0, 50.0, 0.0));
/// # let projection = Projection::PerspectiveFovDeg(40.0);
/// # let camera = Camera { eye, look_at, up: DVec3::Y, projection };
///
/// let shading = Shading {
///     color: ColorMode::KRadius,
///     range: Some([0.5, 2.0]),
///     background: Background::Transparent,
///     ..Shading::default()
/// };
/// let settings = Settings { shading, ..Settings::default() };
/// let mut renderer = Renderer::new();
/// let frame = renderer.render(&cloud, &camera, [64, 48], &settings)?;
/// assert_eq!(frame.counts.value_range, Some([0.5, 2.0]));
/// assert_eq!(frame.image.pixels[0], [0; 4]);
/// # Ok::<(), autosplats::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct Shading {
    /// Source of the surface's colour.
    pub color: ColorMode,
    /// World values at the two ends of the colour map; `None` takes the 1st and 99th percentile of the picture.
    pub range: Option<[f64; 2]>,
    /// Colour map for values; `None` takes the usual one of the colour mode.
    pub color_map: Option<ColorMap>,
    /// Draw the colour map with its range into the picture, if the colour mode has one.
    pub legend: bool,
    /// Light the surface by its normals; otherwise colours are shown unlit.
    pub lighting: bool,
    /// Factor on the brightness of the points' own colours, 0.01 to 100; only with [lighting](Self::lighting). `None`
    /// takes [`usual_exposure`](crate::usual_exposure) of the cloud, which is above 1 where all colours are dark. For
    /// points that move, give the exposure of the first ones, or brightness changes with the points.
    pub exposure: Option<f32>,
    /// Strength of occlusion, the darkening of creases and behind things; 0 (off) to 10.
    pub occlusion: f32,
    /// How to show the side of a surface that its sensor did not see.
    pub backs: Backs,
    /// What to show where no surface is.
    pub background: Background,
}

impl Shading {
    /// Whether backs are toned where they are known; only with lighting.
    pub(crate) fn tones_backs(&self) -> bool {
        self.lighting && self.backs == Backs::Toned
    }
}

/// How to show the back of a surface, the side that its sensor did not see. Backs are known if the cloud states from
/// where it was [scanned](autosplats_cloud::PointCloud::scans).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Backs {
    /// Darker and with less colour than the front; only with [lighting](Shading::lighting).
    #[default]
    Toned,
    /// Like the front.
    Same,
}

/// Source of the surface's colour.
///
/// # Examples
///
/// ```
/// use autosplats::{ColorMap, ColorMode};
///
/// let mode = ColorMode::Field("Intensity".into());
/// assert_eq!((mode.title().as_str(), mode.usual_map()), ("Intensity", Some(ColorMap::Gray)));
/// assert_eq!(ColorMode::Rgb.usual_map(), None);
/// ```
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
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
    /// A colour per class of the field `Classification`, by the ASPRS table.
    Classification,
    /// A scalar field by name, letter case ignored; `Intensity` is one.
    Field(String),
    /// World-space normal, each component mapped from -1..1 to 0..1.
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

/// Parses one of [`NAMES`](ColorMode::NAMES), the name of a field, or `field:NAME` for a field that has the name of a
/// mode.
///
/// # Examples
///
/// ```
/// use autosplats::ColorMode;
///
/// assert_eq!("k-radius".parse(), Ok(ColorMode::KRadius));
/// assert_eq!("GpsTime".parse(), Ok(ColorMode::Field("GpsTime".into())));
/// assert_eq!("field:height".parse(), Ok(ColorMode::Field("height".into())));
/// ```
impl FromStr for ColorMode {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Ok(match text {
            "auto" => Self::Auto,
            "rgb" => Self::Rgb,
            "plain" => Self::Plain,
            "height" => Self::Height,
            "classification" => Self::Classification,
            "normal" => Self::Normal,
            "curvature" => Self::Curvature,
            "radius" => Self::Radius,
            "k-radius" => Self::KRadius,
            "depth" => Self::Depth,
            "" => return Err("must be a colour mode or the name of a field".into()),
            "intensity" => Self::Field("Intensity".into()),
            name => Self::Field(name.strip_prefix("field:").unwrap_or(name).into()),
        })
    }
}

impl ColorMode {
    /// Names of the modes, as text is parsed. Any other name is a field's.
    pub const NAMES: [&str; 11] = [
        "auto",
        "rgb",
        "plain",
        "height",
        "intensity",
        "classification",
        "normal",
        "curvature",
        "radius",
        "k-radius",
        "depth",
    ];

    /// The usual colour map of the mode, if it shows a value.
    pub fn usual_map(&self) -> Option<ColorMap> {
        match self {
            Self::Height | Self::Depth => Some(ColorMap::Viridis),
            Self::Field(name) if name.eq_ignore_ascii_case("intensity") => Some(ColorMap::Gray),
            Self::Field(_) | Self::Curvature => Some(ColorMap::Viridis),
            Self::Radius | Self::KRadius => Some(ColorMap::Reds),
            Self::Auto | Self::Rgb | Self::Plain | Self::Classification | Self::Normal => None,
        }
    }

    /// Title in a legend.
    pub fn title(&self) -> String {
        match self {
            Self::Field(name) => name.clone(),
            Self::KRadius => "k-radius".into(),
            other => format!("{other:?}").to_lowercase(),
        }
    }
}

/// Colour map for values.
///
/// # Examples
///
/// ```
/// use autosplats::ColorMap;
///
/// assert_eq!([0.0, 0.5, 1.0].map(|t| ColorMap::Gray.at(t)), [[0; 3], [128; 3], [255; 3]]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
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
    /// Pale grey over orange to dark red: the high end is a warning. The usual one for radii.
    Reds,
}

impl Default for Shading {
    fn default() -> Self {
        Self {
            color: ColorMode::Auto,
            range: None,
            color_map: None,
            legend: false,
            lighting: true,
            exposure: None,
            occlusion: 1.0,
            backs: Backs::default(),
            background: Background::Gradient([0x4a, 0x53, 0x5f], [0x1e, 0x22, 0x28]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_a_mode() {
        for name in ColorMode::NAMES {
            let mode: Result<ColorMode, _> = name.parse();
            let is_field = matches!(&mode, Ok(ColorMode::Field(field)) if field != "Intensity");
            assert!(mode.is_ok() && !is_field, "{name} is a mode");
        }
        assert!("".parse::<ColorMode>().is_err());
    }
}
