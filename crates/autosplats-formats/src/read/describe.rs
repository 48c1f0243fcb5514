//! The description of a file by its header.

use glam::DVec3;

use autosplats_cloud::{Crs, Scan};

/// Facts about a file that are known without reading its points, as far as its header states them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Description {
    /// Format, version and encoding, for people: `LAS 1.2, point format 3, compressed`.
    pub format: String,
    /// Number of points.
    pub points: Option<u64>,
    /// Number of faces, if the file is a mesh.
    pub faces: Option<u64>,
    /// Least and greatest world coordinates, as the header states them. They may include points without a return.
    pub bounds: Option<[DVec3; 2]>,
    /// Values of a point, coordinates included, in the file's order.
    pub attributes: Vec<Attribute>,
    /// Coordinate system and units.
    pub crs: Crs,
    /// Poses of the sensors, as far as the header states them; ranges count the points in the file. Reading the points
    /// may drop scans or add some.
    pub scans: Vec<Scan>,
    /// The step of which coordinates are multiples, per axis.
    pub resolution: Option<DVec3>,
    /// Further facts as name and value, such as the program that wrote the file, the date, comments.
    pub details: Vec<(String, String)>,
    /// Notes for the user: contradictions, and faults that do not prevent reading.
    pub notes: Vec<String>,
}

/// One value of a point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attribute {
    /// Name as in the file.
    pub name: String,
    /// Storage type, for people: `float32`, `uint16`, `int32 × 0.001`, `text`.
    pub stored: String,
}

impl Attribute {
    pub(super) fn new(name: impl Into<String>, stored: impl Into<String>) -> Self {
        Self { name: name.into(), stored: stored.into() }
    }
}
