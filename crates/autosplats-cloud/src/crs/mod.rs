//! Coordinate systems: what the numbers of a file mean.

pub(crate) mod geotiff;
mod wkt;

/// What a file says of its coordinate system. Nothing is converted by it; it tells people and other programs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Crs {
    /// Name for people.
    pub name: Option<String>,
    /// Code in the EPSG registry, of the horizontal or compound system.
    pub epsg: Option<u32>,
    /// The whole definition as OGC well-known text.
    pub wkt: Option<String>,
    /// Unit of x and y.
    pub unit: Option<Unit>,
    /// Unit of z, where it is not that of x and y.
    pub vertical_unit: Option<Unit>,
    /// The keys of a GeoTIFF header, where the file has the definition as such; they are written again.
    pub geotiff: Option<GeoKeys>,
}

pub use self::geotiff::GeoKeys;

/// What is found out about a coordinate system.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Found {
    pub(crate) crs: Crs,
    /// Whether coordinates are from the middle of the earth.
    pub(crate) geocentric: bool,
    /// Unit of z where it is said, even if it is that of x and y.
    pub(crate) heights: Option<Unit>,
}

impl Crs {
    /// What well-known text, of version 1 or 2, says. Text that cannot be understood is kept as it is.
    pub fn from_wkt(text: &str) -> Self {
        Found::from_wkt(text).crs
    }
}

impl Found {
    /// What well-known text says.
    pub(crate) fn from_wkt(text: &str) -> Self {
        wkt::read(text)
    }
}

/// What a coordinate of 1 is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    /// The unit of so many metres, if it is one of these.
    pub(crate) fn of_metres(metres: f64) -> Option<Self> {
        // The two feet differ in the sixth digit.
        let same = |unit: &Self| unit.metres().is_some_and(|own| (own / metres - 1.0).abs() < 1e-7);
        [Self::Metre, Self::Millimetre, Self::Foot, Self::UsSurveyFoot].into_iter().find(same)
    }

    /// The unit with a code in the EPSG registry.
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

    /// Its code in the EPSG registry.
    pub(crate) fn epsg(self) -> u16 {
        match self {
            Self::Metre => 9001,
            Self::Millimetre => 1025,
            Self::Foot => 9002,
            Self::UsSurveyFoot => 9003,
            Self::Degree => 9102,
        }
    }

    /// Length in metres; nothing for degrees.
    pub fn metres(self) -> Option<f64> {
        match self {
            Self::Metre => Some(1.0),
            Self::Millimetre => Some(1e-3),
            Self::Foot => Some(0.3048),
            Self::UsSurveyFoot => Some(1200.0 / 3937.0),
            Self::Degree => None,
        }
    }

    /// The name for people.
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
