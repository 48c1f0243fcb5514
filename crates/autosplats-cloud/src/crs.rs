//! Coordinate systems: what the numbers of a file mean.

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
