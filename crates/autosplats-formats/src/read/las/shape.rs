//! What is taken of the points of a scan that is read in parts.

use std::path::Path;

use autosplats_cloud::{Error, PointCloud, Wanted};
use glam::DVec3;
use laz::DecompressionSelection;

use super::{
    Job,
    columns::Colors,
    dimension::{Dimension, Source},
    header::Header,
    points,
};
use crate::{
    color_scale::Levels,
    las::{self, Place},
    read::ReadOptions,
};

/// Points that were decoded, with the colours found.
pub(crate) struct Decoded {
    pub(crate) cloud: PointCloud,
    /// How many colour values lie where.
    pub(crate) levels: Levels,
    /// Number of further points that are stated but cannot be decoded.
    pub(crate) lost: u64,
}

/// What is taken of the points, and how, where other parts of the same scan tell. The default takes everything.
#[derive(Default)]
pub(crate) struct Shape<'a> {
    /// Origin of the positions; `None` chooses one.
    pub(crate) origin: Option<DVec3>,
    pub(crate) colors: Colors,
    /// What else is wanted; `None` takes all fields.
    pub(crate) wanted: Option<&'a Wanted>,
}

impl Shape<'_> {
    /// Removes the fields that nobody needs.
    pub(super) fn choose(&self, dimensions: &mut Vec<Dimension>) {
        if let Some(wanted) = self.wanted {
            dimensions.retain(|dimension| wanted.needs(&dimension.name));
        }
    }

    /// The layers that hold these values.
    pub(super) fn selection(&self, dimensions: &[Dimension]) -> DecompressionSelection {
        let colors = if self.colors == Colors::Unwanted { 0 } else { DecompressionSelection::RGB };
        let kinds = dimensions.iter().map(|dimension| match dimension.source {
            Source::Color(_) => DecompressionSelection::RGB,
            Source::Extra(_) => DecompressionSelection::ALL_EXTRA_BYTES,
            Source::Own(place) => layer(place),
        });
        DecompressionSelection(kinds.fold(DecompressionSelection::Z | colors, |all, kind| all | kind))
    }

    /// Most bytes that the colours of a point take in memory.
    pub(super) fn color_bytes(&self, header: &Header, exact: bool) -> usize {
        let colors = las::colors(header.format).filter(|_| self.colors != Colors::Unwanted);
        colors.map_or(0, |_| if exact { 9 } else { 3 })
    }
}

/// The layer of a value of point formats 6 and up. Return numbers and channels are decompressed in any case.
fn layer(place: Place) -> u32 {
    let (Place::Bits { at, .. } | Place::I8(at) | Place::U16(at) | Place::Angle(at) | Place::F64(at)) = place;
    match at {
        12 => DecompressionSelection::INTENSITY,
        14 => DecompressionSelection::XY_RETURNS_CHANNEL,
        15 => DecompressionSelection::FLAGS,
        16 => DecompressionSelection::CLASSIFICATION,
        17 => DecompressionSelection::USER_DATA,
        18 => DecompressionSelection::SCAN_ANGLE,
        20 => DecompressionSelection::POINT_SOURCE_ID,
        22 => DecompressionSelection::GPS_TIME,
        36 => DecompressionSelection::NIR,
        _ => DecompressionSelection::ALL,
    }
}

/// Reads a whole LAS or LAZ file that is a part of a scan, in the units that the file has.
pub(crate) fn read_shaped(name: &Path, bytes: &[u8], exact: bool, shape: &Shape<'_>) -> Result<Decoded, Error> {
    let options = ReadOptions { exact, keep_no_returns: true, ..ReadOptions::default() };
    points(&Job { path: name, progress: &(), bytes, options: &options, triangles: false }, shape)
}
