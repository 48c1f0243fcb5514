//! Extra bytes: values beyond those of the point format, described in a variable length record.

use autosplats_cloud::shown_number;

use super::super::{columns::MAX_COLUMNS, table::Scalar};
use super::{
    header::{Header, bytes_at, text},
    records::Records,
};
use crate::las;

/// A value in the extra bytes of each point.
#[derive(Clone, Debug)]
pub(super) struct Extra {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    /// Byte offset in a record.
    pub(super) at: usize,
    /// Scale and offset, unless they change nothing; scaled values become `f64`.
    pub(super) scaled: Option<(f64, f64)>,
    /// Marker of a missing value, in 8 bytes for all types.
    pub(super) no_data: Option<[u8; 8]>,
}

impl Extra {
    /// The value in a record, unless it is the marker of a missing value.
    #[inline]
    pub(super) fn number(&self, record: &[u8]) -> Option<f64> {
        macro_rules! read {
            ($type:ty, $wide:ty) => {{
                let number = <$type>::from_le_bytes(bytes_at(record, self.at));
                let none = self.no_data.is_some_and(|none| <$wide>::from_le_bytes(none) == number as $wide);
                (!none).then_some(number as f64)
            }};
        }
        #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the types is f64 itself")]
        match self.scalar {
            Scalar::I8 => read!(i8, i64),
            Scalar::U8 => read!(u8, u64),
            Scalar::I16 => read!(i16, i64),
            Scalar::U16 => read!(u16, u64),
            Scalar::I32 => read!(i32, i64),
            Scalar::U32 => read!(u32, u64),
            Scalar::I64 => read!(i64, i64),
            Scalar::U64 => read!(u64, u64),
            Scalar::F32 => read!(f32, f64),
            Scalar::F64 => read!(f64, f64),
        }
    }

    /// Description of the storage type for people.
    pub(super) fn stored(&self) -> String {
        match self.scaled {
            None => self.scalar.name().into(),
            Some((scale, 0.0)) => format!("{} × {}", self.scalar.name(), shown_number(scale)),
            Some((scale, offset)) => {
                format!("{} × {} + {}", self.scalar.name(), shown_number(scale), shown_number(offset))
            }
        }
    }
}

/// Reads the descriptions, which may be in several records. Faults are returned as notes.
pub(super) fn extras(header: &Header, records: &Records<'_>) -> (Vec<Extra>, Vec<String>) {
    let base = las::RECORD_LEN[header.format];
    let mut at = base;
    let mut extras: Vec<Extra> = Vec::new();
    // Names that do not become fields.
    let mut names: Vec<String> = ["X", "Y", "Z", "Red", "Green", "Blue"].map(String::from).into();
    let mut notes = Vec::new();
    let described = records.all.iter().filter(|record| record.id == las::EXTRA_BYTES && record.user == las::SPEC);
    let descriptors = described.flat_map(|record| record.data.as_chunks::<{ las::EXTRA_DESCRIPTOR }>().0);
    let mut undescribed = 0;
    for raw in descriptors {
        let (kind, options) = (raw[2], raw[3]);
        if kind == 0 {
            // Bytes without a meaning; `options` is their number.
            at += usize::from(options);
            undescribed += usize::from(options);
            continue;
        }
        let Some((scalar, parts)) = data_type(kind) else {
            notes.push(format!("extra bytes of unknown type {kind}; they and those that follow are left out"));
            break;
        };
        let own = text(&raw[4..36]);
        if at + scalar.size() * parts > header.record_len {
            notes.push(format!("records have no room for the extra value '{own}'; it is left out"));
            break;
        }
        if extras.len() + parts > MAX_COLUMNS - 32 {
            notes.push(format!("more than {} extra values a point; the others are left out", extras.len()));
            break;
        }
        for part in 0..parts {
            let mut name = if own.is_empty() { format!("Extra{}", extras.len()) } else { own.clone() };
            if parts > 1 {
                name += &format!("_{part}");
            }
            while names.iter().any(|other| other.eq_ignore_ascii_case(&name)) {
                name.push('_');
            }
            names.push(name.clone());
            let eight = |at: usize| {
                let mut bytes = [0; 8];
                bytes.copy_from_slice(&raw[at + 8 * part..at + 8 * part + 8]);
                bytes
            };
            let (scale, offset) = (f64::from_le_bytes(eight(112)), f64::from_le_bytes(eight(136)));
            let scale = if options & 8 != 0 && scale != 0.0 && scale.is_finite() { scale } else { 1.0 };
            let offset = if options & 16 != 0 && offset.is_finite() { offset } else { 0.0 };
            extras.push(Extra {
                name,
                scalar,
                at,
                scaled: ((scale, offset) != (1.0, 0.0)).then_some((scale, offset)),
                no_data: (options & 1 != 0).then(|| eight(40)),
            });
            at += scalar.size();
        }
    }
    undescribed += header.record_len.saturating_sub(at);
    if undescribed > 0 {
        notes.push(format!("{undescribed} bytes of each record are not described; they are left out"));
    }
    (extras, notes)
}

/// Type and count of the values with a type number of the specification.
fn data_type(kind: u8) -> Option<(Scalar, usize)> {
    use Scalar::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    let scalars = [U8, I8, U16, I16, U32, I32, U64, I64, F32, F64];
    let index = usize::from(kind.checked_sub(1)?);
    // 11 to 30 are the deprecated pairs and triples.
    Some((*scalars.get(index % 10)?, index / 10 + 1)).filter(|&(_, parts)| parts <= 3)
}
