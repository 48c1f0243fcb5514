//! Coordinate systems.

mod definition;
mod geotiff;
mod wkt;

pub use self::definition::{Crs, CrsDefinition, GeoKeys, Unit};
