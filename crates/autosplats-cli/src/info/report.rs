//! What `info` knows of one input, in the shape of its JSON.

use autosplats_cloud::{Axes, Crs, Scan, glam::DVec3};
use serde::Serialize;

use super::spacing::{Density, Spacing};
use super::statistics::Statistics;

/// The JSON of one input, as `info --help` and docs/FORMATS.md explain it.
pub(crate) const SCHEMA: &str = "\
Fields of the JSON object. What is not known is null, and lists are then empty; NaN and infinity do
not occur. Later versions may add fields.
  input             the name as typed
  error             what kept it from being read, in one line
  format            format, version and encoding, for people
  file_bytes        size of the file
  scanned           whether all points were read; if not, everything is from the header
  points            points there are; if scanned without those at (0, 0, 0), where nothing was
                    measured
  points_in_header  points that the header promises
  faces             faces of a mesh
  bounds            least and greatest coordinates: {min: [x, y, z], max: [...], size: [...]}
  axes              {name: z-up, y-up or camera, guessed: whether from the shape of the cloud}
  crs               {name, epsg, wkt, unit, vertical_unit, metres_per_unit}, as the file says
  resolution        step of which coordinates are multiples: [x, y, z]
  spacing           distance to the nearest of all other points, at up to 10,000 points spread
                    over the file: {median, p5, p95, mean, samples}; p5 and p95 are percentiles
  density           points per square unit of surface: {median, neighbors, samples}; at each of
                    the same points it is n / (pi r^2), r the distance to the n-th nearest
  duplicates        points at exactly the place of an earlier one
  not_finite        points with a coordinate that is infinite or not a number
  attributes        values of a point, coordinates included: {name, stored, min, max, mean,
                    not_finite, distinct, values, histogram}
    stored          type in the file
    distinct        how many different values there are, if all are whole and near each other
    values          [{value, count, name}] if those are at most 32, or classes; name is that of
                    the ASPRS class
    histogram       {edges, counts}: up to 32 equal bins, of whole numbers if all values are
  scans             where sensors stood: {name, position, world_from_sensor, points}; a matrix
                    row by row, and [first, end] of the points it saw
  details           further facts from the header: [{name, value}]
  warnings          what was lost, guessed, dropped, scaled, or contradicts itself";

/// Everything known of one input.
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

/// Least and greatest coordinates, and how far they are apart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Bounds {
    pub(super) min: [f64; 3],
    pub(super) max: [f64; 3],
    pub(super) size: [f64; 3],
}

impl Bounds {
    /// Nothing if they are not finite or turned inside out.
    pub(super) fn new([min, max]: [DVec3; 2]) -> Option<Self> {
        let valid = min.is_finite() && max.is_finite() && min.cmple(max).all() && (max - min).is_finite();
        valid.then(|| Self { min: min.into(), max: max.into(), size: (max - min).into() })
    }
}

/// Which way is up.
#[derive(Debug, Serialize)]
pub(super) struct AxesFound {
    pub(super) name: &'static str,
    pub(super) guessed: bool,
}

impl AxesFound {
    pub(super) fn new(axes: Axes, guessed: bool) -> Self {
        let name = match axes {
            Axes::ZUp => "z-up",
            Axes::YUp => "y-up",
            Axes::Camera => "camera",
        };
        Self { name, guessed }
    }
}

/// What the file says of its coordinate system.
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

/// One value of each point.
#[derive(Debug, Default, Serialize)]
pub(super) struct AttributeFound {
    pub(super) name: String,
    pub(super) stored: String,
    #[serde(flatten)]
    pub(super) statistics: Statistics,
}

/// Where a sensor stood.
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

/// A fact from the header.
#[derive(Debug, Serialize)]
pub(super) struct Detail {
    pub(super) name: String,
    pub(super) value: String,
}
