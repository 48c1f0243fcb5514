//! What the header of a file says.

use glam::DVec3;

use crate::{Crs, Scan};

/// What is known of a file without reading its points, as far as its header says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Description {
    /// Format, version and encoding, for people: `LAS 1.2, point format 3, compressed`.
    pub format: String,
    /// Number of points.
    pub points: Option<u64>,
    /// Number of faces, of a mesh.
    pub faces: Option<u64>,
    /// Least and greatest world coordinates, as the header has them; points without a return may be counted in.
    pub bounds: Option<[DVec3; 2]>,
    /// The values of a point, coordinates included, in the file's order.
    pub attributes: Vec<Attribute>,
    /// Coordinate system and units.
    pub crs: Crs,
    /// Where the sensors stood, as far as the header says; the ranges are those of the points in the file. Reading the points
    /// may show that some cannot have stood there, or that others have.
    pub scans: Vec<Scan>,
    /// The step of which coordinates are multiples.
    pub resolution: Option<DVec3>,
    /// Further facts as name and value: the program that wrote the file, the date, comments.
    pub details: Vec<(String, String)>,
    /// What the user should know: contradictions, faults that do not keep the points from being read.
    pub notes: Vec<String>,
}

/// One value of each point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attribute {
    /// Name as in the file.
    pub name: String,
    /// How it is stored, for people: `float32`, `uint16`, `int32 × 0.001`, `text`.
    pub stored: String,
}

impl Attribute {
    pub(super) fn new(name: impl Into<String>, stored: impl Into<String>) -> Self {
        Self { name: name.into(), stored: stored.into() }
    }
}
