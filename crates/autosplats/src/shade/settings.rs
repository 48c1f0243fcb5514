//! What shading can be asked for.

/// How splats become an image.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
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
    /// How many times as bright the points' own colours are shown, 0.01 to 100; `None` takes what
    /// [`usual_exposure`](crate::usual_exposure) says of the cloud, which is more than 1 where its colours are all dark. Only with
    /// [lighting](Self::lighting). Of points that move it would change with them: give what the first need.
    pub exposure: Option<f32>,
    /// Strength of occlusion, the darkening of creases and of what lies behind something; 0 (off) to 10.
    pub occlusion: f32,
    /// How the side of a surface is shown that its sensor did not see.
    pub backs: Backs,
    /// What is seen where no surface is.
    pub background: Background,
}

impl Shading {
    /// Whether backs are told apart where they are known: light does it, as it does all shading.
    pub(crate) fn tones_backs(&self) -> bool {
        self.lighting && self.backs == Backs::Toned
    }
}

/// How the back of a surface is shown: the side that its sensor did not see. It is known where the cloud says from where it
/// was [scanned](autosplats_cloud::PointCloud::scans).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Backs {
    /// Darker and with less colour than the front; only with [lighting](Shading::lighting).
    #[default]
    Toned,
    /// Like the front.
    Same,
}

/// What the surface is coloured by.
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

impl ColorMode {
    /// The colour map that suits it, if it shows a value.
    pub fn usual_map(&self) -> Option<ColorMap> {
        match self {
            Self::Height | Self::Depth => Some(ColorMap::Viridis),
            Self::Field(name) if name.eq_ignore_ascii_case("intensity") => Some(ColorMap::Gray),
            Self::Field(_) | Self::Curvature => Some(ColorMap::Viridis),
            Self::Radius | Self::KRadius => Some(ColorMap::Reds),
            Self::Auto | Self::Rgb | Self::Plain | Self::Classification | Self::Normal => None,
        }
    }

    /// What a legend calls it.
    pub fn title(&self) -> String {
        match self {
            Self::Field(name) => name.clone(),
            Self::KRadius => "k-radius".into(),
            other => format!("{other:?}").to_lowercase(),
        }
    }
}

/// Colours for scalar values.
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
    /// Pale grey over orange to dark red: the high end is a warning. The one for radii.
    Reds,
}

/// What is seen where no surface is. Colours are sRGB, 8 bits a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Background {
    /// One colour.
    Color([u8; 3]),
    /// From the first colour at the top to the second at the bottom.
    Gradient([u8; 3], [u8; 3]),
    /// Nothing: alpha is 0.
    Transparent,
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
