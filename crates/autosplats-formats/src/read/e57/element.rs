//! The bit-packed values of a point in an E57 file.

use autosplats_cloud::{FieldValues, shown_number};

/// One value of each point.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Element {
    /// Name without the prefix of a namespace.
    pub(super) name: String,
    /// Prefix of the namespace, if an extension defines the element.
    pub(super) prefix: Option<String>,
    pub(super) stored: Stored,
}

impl Element {
    /// Whether this is the standard's element of that name.
    pub(super) fn is(&self, name: &str) -> bool {
        self.prefix.is_none() && self.name == name
    }

    pub(super) fn full_name(&self) -> String {
        self.prefix.as_ref().map_or_else(|| self.name.clone(), |prefix| format!("{prefix}:{}", self.name))
    }
}

/// Storage type of a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stored {
    Single,
    Double,
    /// An integer in as many bits as its bounds need.
    Integer {
        min: i64,
        max: i64,
    },
    /// An integer with a scale and an offset.
    Scaled {
        min: i64,
        max: i64,
        scale: f64,
        offset: f64,
    },
    /// Text of any length, so that one value cannot be found without reading those before it.
    Text,
}

impl Stored {
    /// Bits of a value; 0 for constants, which take no space, and for text.
    pub(super) fn bits(self) -> u32 {
        match self {
            Self::Single => 32,
            Self::Double => 64,
            Self::Integer { min, max } | Self::Scaled { min, max, .. } => {
                64 - (max.wrapping_sub(min) as u64).leading_zeros()
            }
            Self::Text => 0,
        }
    }

    /// Description of the storage type for people.
    pub(super) fn describe(self) -> String {
        match self {
            Self::Single => "float32".into(),
            Self::Double => "float64".into(),
            Self::Integer { min, .. } if self.bits() == 0 => format!("constant {min}"),
            Self::Integer { .. } => format!("int {} bit", self.bits()),
            Self::Scaled { min, scale, offset, .. } if self.bits() == 0 => {
                format!("constant {}", shown_number(min as f64 * scale + offset))
            }
            Self::Scaled { scale, offset: 0.0, .. } => format!("int {} bit × {}", self.bits(), shown_number(scale)),
            Self::Scaled { scale, offset, .. } => {
                format!("int {} bit × {} + {}", self.bits(), shown_number(scale), shown_number(offset))
            }
            Self::Text => "text".into(),
        }
    }
}

/// Type of the values of a field, joined over all scans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Integer { min: i64, max: i64 },
    Single,
    Double,
}

impl Kind {
    /// The type for stored values. `f32` tells scaled integers of up to 24 bits apart; only `f64` keeps their digits.
    pub(super) fn of(stored: Stored, exact: bool) -> Self {
        match stored {
            Stored::Single => Self::Single,
            Stored::Integer { min, max } => Self::Integer { min, max },
            Stored::Scaled { .. } if !exact && stored.bits() <= 24 => Self::Single,
            Stored::Scaled { .. } | Stored::Double | Stored::Text => Self::Double,
        }
    }

    /// A type that holds the values of both.
    pub(super) fn join(self, other: Self) -> Self {
        let narrow = |kind| match kind {
            Self::Single => true,
            Self::Double => false,
            Self::Integer { min, max } => min >= -(1 << 24) && max <= 1 << 24,
        };
        match (self, other) {
            (Self::Integer { min, max }, Self::Integer { min: low, max: high }) => {
                Self::Integer { min: min.min(low), max: max.max(high) }
            }
            (a, b) if narrow(a) && narrow(b) => Self::Single,
            _ => Self::Double,
        }
    }

    /// An empty list of the narrowest type that holds the values.
    pub(super) fn values(self) -> FieldValues {
        match self {
            Self::Single => FieldValues::F32(Vec::new()),
            Self::Double => FieldValues::F64(Vec::new()),
            Self::Integer { min: 0.., max } => match max {
                ..=0xff => FieldValues::U8(Vec::new()),
                0x100..=0xffff => FieldValues::U16(Vec::new()),
                0x1_0000..=0xffff_ffff => FieldValues::U32(Vec::new()),
                _ => FieldValues::I64(Vec::new()),
            },
            Self::Integer { min, max } => {
                let within = |low: i64, high: i64| min >= low && max <= high;
                if within(i8::MIN.into(), i8::MAX.into()) {
                    FieldValues::I8(Vec::new())
                } else if within(i16::MIN.into(), i16::MAX.into()) {
                    FieldValues::I16(Vec::new())
                } else if within(i32::MIN.into(), i32::MAX.into()) {
                    FieldValues::I32(Vec::new())
                } else {
                    FieldValues::I64(Vec::new())
                }
            }
        }
    }

    /// Bytes of a value.
    pub(super) fn size(self) -> usize {
        match self.values() {
            FieldValues::U8(_) | FieldValues::I8(_) => 1,
            FieldValues::U16(_) | FieldValues::I16(_) => 2,
            FieldValues::U32(_) | FieldValues::I32(_) | FieldValues::F32(_) => 4,
            FieldValues::U64(_) | FieldValues::I64(_) | FieldValues::F64(_) => 8,
        }
    }
}

/// The values of one element for all points of a scan, contiguous and bit-packed.
pub(super) struct Stream {
    /// The packed values, followed by [`PADDING`](Self::PADDING) bytes.
    pub(super) bytes: Vec<u8>,
    stored: Stored,
    /// Bits before the first value.
    skipped: usize,
    bits: u32,
    mask: u64,
}

impl Stream {
    /// Bytes needed after the last value: a value is read as the eight bytes from its first one on, and one more.
    pub(super) const PADDING: usize = 9;

    pub(super) fn new(bytes: Vec<u8>, stored: Stored) -> Self {
        let bits = stored.bits();
        Self { bytes, stored, skipped: 0, bits, mask: u64::MAX.checked_shr(64 - bits).unwrap_or(0) }
    }

    /// The same bytes without their first bits.
    pub(super) fn skipping(self, bits: usize) -> Self {
        Self { skipped: bits, ..self }
    }

    /// The raw bits of a value.
    #[inline]
    fn raw(&self, index: usize) -> u64 {
        let bit = self.skipped + index * self.bits as usize;
        let (at, shift) = (bit / 8, bit as u32 % 8);
        let mut raw = [0; 8];
        raw.copy_from_slice(&self.bytes[at..at + 8]);
        let mut value = u64::from_le_bytes(raw) >> shift;
        if shift + self.bits > 64 {
            value |= u64::from(self.bytes[at + 8]) << (64 - shift);
        }
        value & self.mask
    }

    /// The value as an integer; floats are cut.
    #[inline]
    pub(super) fn integer(&self, index: usize) -> i64 {
        match self.stored {
            Stored::Integer { min, .. } => min.wrapping_add(self.raw(index) as i64),
            _ => self.value(index) as i64,
        }
    }

    /// The value as a float; integers beyond 2⁵³ are rounded.
    #[inline]
    pub(super) fn value(&self, index: usize) -> f64 {
        let raw = self.raw(index);
        match self.stored {
            Stored::Single => f32::from_bits(raw as u32).into(),
            Stored::Double => f64::from_bits(raw),
            Stored::Integer { min, .. } => min.wrapping_add(raw as i64) as f64,
            Stored::Scaled { min, scale, offset, .. } => min.wrapping_add(raw as i64) as f64 * scale + offset,
            Stored::Text => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_every_width_at_every_bit() {
        for bits in 1..=64 {
            let max = if bits == 64 { i64::MAX } else { (i64::MIN as u64 >> (64 - bits)) as i64 - 1 };
            let (min, max) = if bits == 64 { (i64::MIN, max) } else { (-3, max.wrapping_mul(2).wrapping_add(1 - 3)) };
            let stored = Stored::Integer { min, max };
            assert_eq!(stored.bits(), bits, "bounds {min} to {max}");
            let values: Vec<u64> =
                (1..=20_u64).map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15) & (u64::MAX >> (64 - bits))).collect();
            let mut bytes = vec![0; 20 * bits as usize / 8 + 1 + Stream::PADDING];
            for (i, value) in values.iter().enumerate() {
                for bit in 0..bits as usize {
                    let at = i * bits as usize + bit;
                    bytes[at / 8] |= ((value >> bit & 1) as u8) << (at % 8);
                }
            }
            let stream = Stream::new(bytes.clone(), stored);
            let later = Stream::new(bytes, stored).skipping(3 * bits as usize);
            for (i, value) in values.iter().enumerate() {
                assert_eq!(stream.integer(i), min.wrapping_add(*value as i64), "{bits} bits, value {i}");
                assert!(i < 3 || later.integer(i - 3) == stream.integer(i), "{bits} bits, value {i} after three");
            }
        }
    }

    #[test]
    fn constants_take_no_bits() {
        let stored = Stored::Scaled { min: 7, max: 7, scale: 0.5, offset: 1.0 };
        let stream = Stream::new(vec![0xff; Stream::PADDING], stored);
        assert_eq!((stored.bits(), stream.value(1 << 40)), (0, 4.5), "the constant");
    }
}
