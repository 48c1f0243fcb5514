//! What a coordinate system is.

/// The coordinate system that a file states. Readers do not convert coordinates.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Crs, Unit};
///
/// let text = r#"PROJCS["WGS 84 / UTM zone 32N",UNIT["metre",1],AUTHORITY["EPSG","32632"]]"#;
/// let crs = Crs::from_wkt(text);
/// assert_eq!(crs.name.as_deref(), Some("WGS 84 / UTM zone 32N"));
/// assert_eq!((crs.epsg, crs.unit), (Some(32_632), Some(Unit::Metre)));
/// ```
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Crs {
    /// Name for people.
    pub name: Option<String>,
    /// EPSG code of the horizontal or compound system.
    pub epsg: Option<u32>,
    /// Complete definition as OGC well-known text (WKT).
    pub wkt: Option<String>,
    /// Unit of x and y.
    pub unit: Option<Unit>,
    /// Unit of z, if it differs from the unit of x and y. Clouds from files have one unit of length for all axes.
    pub vertical_unit: Option<Unit>,
    /// Keys of a GeoTIFF header, if the file has one; they are written again.
    pub geotiff: Option<GeoKeys>,
}

impl Crs {
    /// Factor from heights to the unit of x and y, if both are lengths and differ.
    pub fn height_scale(&self) -> Option<f64> {
        let (across, upward) = (self.unit?.metres()?, self.vertical_unit?.metres()?);
        (across != upward).then(|| upward / across)
    }
}

/// Keys of a GeoTIFF header with their parameters, as stored in its three tags.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct GeoKeys {
    /// The key directory: version, revision, minor revision, number of keys; then four numbers per key. These are its
    /// number, the tag of its value (0: in the directory), the count of values, and the value or the first one's index.
    pub directory: Vec<u16>,
    /// The floating-point values that keys refer to.
    pub doubles: Vec<f64>,
    /// The texts that keys refer to, each ending with `|`.
    pub ascii: String,
}

/// What a definition of a coordinate system states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CrsDefinition {
    /// The coordinate system.
    pub crs: Crs,
    /// Whether coordinates are geocentric: measured from the centre of the earth.
    pub geocentric: bool,
    /// Unit of z, if stated, even if it is the unit of x and y.
    pub heights: Option<Unit>,
}

/// Unit of a coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Unit {
    /// Metre.
    Metre,
    /// Millimetre.
    Millimetre,
    /// International foot, 0.3048 m.
    Foot,
    /// US survey foot, 1200/3937 m.
    UsSurveyFoot,
    /// Degree of longitude (x) and latitude (y).
    Degree,
}

impl Unit {
    /// The unit of this length, if it is known.
    pub(crate) fn of_metres(metres: f64) -> Option<Self> {
        // The two feet differ in the sixth digit.
        let same = |unit: &Self| unit.metres().is_some_and(|own| (own / metres - 1.0).abs() < 1e-7);
        [Self::Metre, Self::Millimetre, Self::Foot, Self::UsSurveyFoot].into_iter().find(same)
    }

    /// The unit with this EPSG code.
    pub(crate) fn of_epsg(code: u32) -> Option<Self> {
        match code {
            9001 => Some(Self::Metre),
            1025 => Some(Self::Millimetre),
            9002 => Some(Self::Foot),
            9003 => Some(Self::UsSurveyFoot),
            9102 | 9122 => Some(Self::Degree),
            _ => None,
        }
    }

    /// EPSG code.
    pub fn epsg(self) -> u16 {
        match self {
            Self::Metre => 9001,
            Self::Millimetre => 1025,
            Self::Foot => 9002,
            Self::UsSurveyFoot => 9003,
            Self::Degree => 9102,
        }
    }

    /// Length in metres; `None` for degrees.
    pub fn metres(self) -> Option<f64> {
        match self {
            Self::Metre => Some(1.0),
            Self::Millimetre => Some(1e-3),
            Self::Foot => Some(0.3048),
            Self::UsSurveyFoot => Some(1200.0 / 3937.0),
            Self::Degree => None,
        }
    }

    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Metre => "metre",
            Self::Millimetre => "millimetre",
            Self::Foot => "foot",
            Self::UsSurveyFoot => "US survey foot",
            Self::Degree => "degree",
        }
    }
}
