//! The report of one input, in the shape of its JSON.

use autosplats_cloud::{Axes, Crs, Scan, glam::DVec3};
use serde::Serialize;

use super::spacing::{Density, Spacing};
use super::statistics::Statistics;

/// All facts about one input.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Report {
    pub(super) input: String,
    pub(super) error: Option<String>,
    pub(super) format: Option<String>,
    pub(super) file_bytes: Option<u64>,
    pub(super) scanned: bool,
    pub(super) points: Option<u64>,
    pub(super) points_in_header: Option<u64>,
    pub(super) faces: Option<u64>,
    pub(super) bounds: Option<Bounds>,
    pub(super) axes: Option<AxesFound>,
    pub(super) crs: CrsFound,
    pub(super) resolution: Option<[f64; 3]>,
    pub(super) spacing: Option<Spacing>,
    pub(super) density: Option<Density>,
    pub(super) duplicates: Option<u64>,
    pub(super) not_finite: Option<u64>,
    pub(super) attributes: Vec<AttributeFound>,
    pub(super) scans: Vec<ScanFound>,
    pub(super) details: Vec<Detail>,
    pub(super) warnings: Vec<String>,
}

/// Bounding box, in the file's units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Bounds {
    pub(super) min: [f64; 3],
    pub(super) max: [f64; 3],
    pub(super) size: [f64; 3],
}

impl Bounds {
    /// `None` if the bounds are infinite or inverted.
    pub(super) fn new([min, max]: [DVec3; 2]) -> Option<Self> {
        let valid = min.is_finite() && max.is_finite() && min.cmple(max).all() && (max - min).is_finite();
        valid.then(|| Self { min: min.into(), max: max.into(), size: (max - min).into() })
    }
}

#[derive(Debug, Serialize)]
pub(super) struct AxesFound {
    pub(super) name: &'static str,
    pub(super) guessed: bool,
}

impl AxesFound {
    pub(super) fn new(axes: Axes, guessed: bool) -> Self {
        Self { name: axes.name(), guessed }
    }
}

/// The file's coordinate system.
#[derive(Debug, Default, Serialize)]
pub(super) struct CrsFound {
    pub(super) name: Option<String>,
    pub(super) epsg: Option<u32>,
    pub(super) wkt: Option<String>,
    pub(super) unit: Option<&'static str>,
    pub(super) vertical_unit: Option<&'static str>,
    pub(super) metres_per_unit: Option<f64>,
}

impl From<&Crs> for CrsFound {
    fn from(crs: &Crs) -> Self {
        Self {
            name: crs.name.clone(),
            epsg: crs.epsg,
            wkt: crs.wkt.clone(),
            unit: crs.unit.map(|unit| unit.name()),
            vertical_unit: crs.vertical_unit.map(|unit| unit.name()),
            metres_per_unit: crs.unit.and_then(|unit| unit.metres()),
        }
    }
}

/// An attribute: one value per point.
#[derive(Debug, Default, Serialize)]
pub(super) struct AttributeFound {
    pub(super) name: String,
    pub(super) stored: String,
    #[serde(flatten)]
    pub(super) statistics: Statistics,
}

/// Pose of a sensor.
#[derive(Debug, Serialize)]
pub(super) struct ScanFound {
    pub(super) name: Option<String>,
    pub(super) position: [f64; 3],
    pub(super) world_from_sensor: [[f64; 4]; 4],
    pub(super) points: [usize; 2],
}

impl From<&Scan> for ScanFound {
    fn from(scan: &Scan) -> Self {
        Self {
            name: scan.name.clone(),
            position: scan.position().into(),
            world_from_sensor: scan.world_from_sensor.transpose().to_cols_array_2d(),
            points: [scan.points.start, scan.points.end],
        }
    }
}

/// A further fact from the header.
#[derive(Debug, Serialize)]
pub(super) struct Detail {
    pub(super) name: String,
    pub(super) value: String,
}
