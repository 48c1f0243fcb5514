//! Typed parts of fields, filled from records.

use std::ops::Range;

use autosplats_cloud::FieldValues;

use super::{
    dimension::{Dimension, Source},
    extra::Extra,
    header::bytes_at,
};
use crate::las::{ANGLE_STEP, Place};

macro_rules! slices {
    ($($variant:ident($type:ty)),*) => {
        /// Values of a field that a piece fills.
        pub(super) enum Slice<'a> {
            $($variant(&'a mut [$type])),*
        }

        impl<'a> Slice<'a> {
            pub(super) fn from(values: &'a mut FieldValues, start: usize) -> Self {
                match values {
                    $(FieldValues::$variant(values) => Self::$variant(&mut values[start..])),*
                }
            }

            /// Splits off the first values.
            pub(super) fn split(&mut self, count: usize) -> Self {
                match self {
                    $(Self::$variant(values) => Self::$variant(split(values, count))),*
                }
            }

            /// Fills values from an unscaled value in the extra bytes; returns whether any is not zero.
            fn take_plain<'r>(
                &mut self,
                range: Range<usize>,
                extra: &Extra,
                records: impl Iterator<Item = &'r [u8]> + Clone,
            ) -> bool {
                match self {
                    $(Self::$variant(values) => {
                        put(&mut values[range], records, |record| <$type>::from_le_bytes(bytes_at(record, extra.at)))
                    }),*
                }
            }
        }
    };
}
slices!(U8(u8), I8(i8), U16(u16), I16(i16), U32(u32), I32(i32), U64(u64), I64(i64), F32(f32), F64(f64));

impl Slice<'_> {
    /// Fills values from some records; returns whether any is not zero.
    pub(super) fn take<'r>(
        &mut self,
        range: Range<usize>,
        dimension: &Dimension,
        records: impl Iterator<Item = &'r [u8]> + Clone,
    ) -> bool {
        match (self, &dimension.source) {
            (Self::U8(v), &Source::Own(Place::Bits { at, shift, mask })) => {
                put(&mut v[range], records, |record| record[at] >> shift & mask)
            }
            (Self::I8(v), &Source::Own(Place::I8(at))) => put(&mut v[range], records, |record| record[at] as i8),
            (Self::U16(v), &(Source::Own(Place::U16(at)) | Source::Color(at))) => {
                put(&mut v[range], records, |record| u16_at(record, at))
            }
            (Self::F32(v), &Source::Own(Place::Angle(at))) => {
                put(&mut v[range], records, |record| f32::from(u16_at(record, at) as i16) * ANGLE_STEP)
            }
            (Self::F64(v), &Source::Own(Place::F64(at))) => {
                put(&mut v[range], records, |record| f64::from_le_bytes(bytes_at(record, at)))
            }
            (Self::F64(v), Source::Extra(extra @ Extra { scaled: Some((scale, offset)), .. })) => {
                put(&mut v[range], records, |record| match extra.number(record) {
                    Some(number) => number * scale + offset,
                    None => f64::NAN,
                })
            }
            // Floats have NaN for a missing value; integers keep the file's marker.
            (Self::F32(v), Source::Extra(extra)) if extra.no_data.is_some() => {
                put(&mut v[range], records, |record| extra.number(record).map_or(f32::NAN, |number| number as f32))
            }
            (Self::F64(v), Source::Extra(extra)) if extra.no_data.is_some() => {
                put(&mut v[range], records, |record| extra.number(record).unwrap_or(f64::NAN))
            }
            (slice, Source::Extra(extra)) => slice.take_plain(range, extra, records),
            (_, Source::Own(_) | Source::Color(_)) => false,
        }
    }
}

/// Stores values unless all are zero; returns whether any is not zero.
fn put<'r, T: Copy + Default + PartialEq>(
    values: &mut [T],
    records: impl Iterator<Item = &'r [u8]> + Clone,
    value: impl Fn(&[u8]) -> T,
) -> bool {
    let zero = T::default();
    if records.clone().all(|record| value(record) == zero) {
        return false;
    }
    for (place, record) in values.iter_mut().zip(records) {
        *place = value(record);
    }
    true
}

/// Splits off the first elements.
pub(super) fn split<'a, T>(slice: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let whole = std::mem::take(slice);
    let (first, rest) = whole.split_at_mut(count.min(whole.len()));
    *slice = rest;
    first
}

#[inline]
pub(super) fn u16_at(record: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(bytes_at(record, at))
}
