//! The fields that a cloud gets from the records of a file: names, places in a record, types.

use autosplats_cloud::{Error, FieldValues};
use bytemuck::{Zeroable, allocation::try_zeroed_vec};

use super::{
    super::table::Scalar,
    extra::{Extra, extras},
    header::Header,
    records::Records,
};
use crate::las::{self, Place};

/// Source of a field in a record.
#[derive(Clone, Debug)]
pub(super) enum Source {
    /// A value of the point format.
    Own(Place),
    /// Byte offset of a 16-bit red, green or blue.
    Color(usize),
    /// A value in the extra bytes.
    Extra(Extra),
}

/// A future field: its name and the place of its values.
#[derive(Clone, Debug)]
pub(super) struct Dimension {
    pub(super) name: String,
    pub(super) source: Source,
}

impl Dimension {
    /// The column of `count` points before any value is known.
    pub(super) fn zeros(&self, count: usize) -> Result<FieldValues, Error> {
        macro_rules! zeros {
            ($variant:ident) => {
                FieldValues::$variant(zeroed(count, &self.name)?)
            };
        }
        Ok(match &self.source {
            Source::Own(Place::Bits { .. }) => zeros!(U8),
            Source::Own(Place::I8(_)) => zeros!(I8),
            Source::Own(Place::U16(_)) | Source::Color(_) => zeros!(U16),
            Source::Own(Place::Angle(_)) => zeros!(F32),
            Source::Own(Place::F64(_)) => zeros!(F64),
            Source::Extra(extra) if extra.scaled.is_some() => zeros!(F64),
            Source::Extra(extra) => match extra.scalar {
                Scalar::I8 => zeros!(I8),
                Scalar::U8 => zeros!(U8),
                Scalar::I16 => zeros!(I16),
                Scalar::U16 => zeros!(U16),
                Scalar::I32 => zeros!(I32),
                Scalar::U32 => zeros!(U32),
                Scalar::I64 => zeros!(I64),
                Scalar::U64 => zeros!(U64),
                Scalar::F32 => zeros!(F32),
                Scalar::F64 => zeros!(F64),
            },
        })
    }

    /// Bytes of a value in the cloud.
    pub(super) fn size(&self) -> usize {
        match &self.source {
            Source::Own(Place::Bits { .. } | Place::I8(_)) => 1,
            Source::Own(Place::U16(_)) | Source::Color(_) => 2,
            Source::Own(Place::Angle(_)) => 4,
            Source::Own(Place::F64(_)) => 8,
            Source::Extra(extra) => {
                if extra.scaled.is_some() {
                    8
                } else {
                    extra.scalar.size()
                }
            }
        }
    }
}

/// Zeroed memory, which the system provides on first touch.
pub(super) fn zeroed<T: Zeroable>(count: usize, what: &str) -> Result<Vec<T>, Error> {
    try_zeroed_vec(count)
        .map_err(|()| Error::OutOfMemory { what: what.into(), bytes: count.saturating_mul(size_of::<T>()) })
}

/// All values of a point except coordinates and colours, and notes about them.
pub(super) fn dimensions(header: &Header, records: &Records<'_>) -> (Vec<Dimension>, Vec<String>) {
    let own = las::places(header.format).into_iter();
    let own = own.map(|(name, place)| Dimension { name: name.into(), source: Source::Own(place) });
    let mut dimensions: Vec<Dimension> = own.collect();
    let (found, mut notes) = extras(header, records);
    let found = found.into_iter().map(|extra| Dimension { name: extra.name.clone(), source: Source::Extra(extra) });
    dimensions.extend(found);
    if las::has_waveforms(header.format) {
        notes.push("waveforms are not read".into());
    }
    if header.version.0 != 1 || header.version.1 > 4 {
        notes.push(format!("{} is an unknown version; read as well as possible", header.version_name()));
    }
    (dimensions, notes)
}
