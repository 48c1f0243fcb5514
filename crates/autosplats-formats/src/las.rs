//! Layout of LAS files, shared by reading and writing.

/// Bytes of a point record, by point format.
pub(crate) const RECORD_LEN: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// Byte offset of the GPS time in point formats 6 and up.
pub(crate) const WIDE_TIME: usize = 22;

/// Bytes before the data of a variable length record (VLR).
pub(crate) const VLR_HEADER: usize = 54;
/// Bytes before the data of an extended variable length record (EVLR).
pub(crate) const EVLR_HEADER: usize = 60;

/// Bytes that describe one extra value of a point record.
pub(crate) const EXTRA_DESCRIPTOR: usize = 192;

/// Degrees of one step of the scan angle in point formats 6 and above.
pub(crate) const ANGLE_STEP: f32 = 0.006;

/// Bytes of an extra value of this type, of which some are pairs and triples. `None` if there is no such type, or it
/// has no size of its own.
pub(crate) fn extra_size(kind: u8) -> Option<usize> {
    const SIZES: [usize; 10] = [1, 1, 2, 2, 4, 4, 8, 8, 4, 8];
    let index = usize::from(kind.checked_sub(1)?);
    (index < 30).then(|| SIZES[index % 10] * (index / 10 + 1))
}

/// User ids and record ids of the variable length records that are read or written.
pub(crate) const SPEC: &str = "LASF_Spec";
pub(crate) const EXTRA_BYTES: u16 = 4;
pub(crate) const PROJECTION: &str = "LASF_Projection";
pub(crate) const WKT: u16 = 2112;
pub(crate) const GEO_KEYS: u16 = 34735;
pub(crate) const GEO_DOUBLES: u16 = 34736;
pub(crate) const GEO_ASCII: u16 = 34737;

/// Byte offset and storage type of one value in a point record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// Bits of the byte at `at`.
    Bits { at: usize, shift: u8, mask: u8 },
    /// A signed byte.
    I8(usize),
    /// An unsigned 16-bit integer.
    U16(usize),
    /// A signed 16-bit angle in steps of [`ANGLE_STEP`].
    Angle(usize),
    /// A 64-bit float.
    F64(usize),
}

impl Place {
    /// Description of the storage type for people.
    pub(crate) fn stored(self) -> String {
        match self {
            Self::Bits { mask: 255, .. } => "uint8".into(),
            Self::Bits { mask: 1, .. } => "1 bit".into(),
            Self::Bits { mask, .. } => format!("{} bits", mask.count_ones()),
            Self::I8(_) => "int8".into(),
            Self::U16(_) => "uint16".into(),
            Self::Angle(_) => format!("int16 × {ANGLE_STEP}"),
            Self::F64(_) => "float64".into(),
        }
    }
}

/// Whether a point format is one of those added by LAS 1.4, which have wider bit fields.
pub(crate) fn is_wide(format: usize) -> bool {
    format >= 6
}

/// Byte offset of the GPS time.
pub(crate) fn time(format: usize) -> Option<usize> {
    match format {
        0 | 2 => None,
        1..=5 => Some(20),
        _ => Some(WIDE_TIME),
    }
}

/// Byte offset of red, followed by green and blue, 16 bits each.
pub(crate) fn colors(format: usize) -> Option<usize> {
    match format {
        2 => Some(20),
        3 | 5 => Some(28),
        7 | 8 | 10 => Some(30),
        _ => None,
    }
}

/// Whether point records refer to waveforms.
pub(crate) fn has_waveforms(format: usize) -> bool {
    matches!(format, 4 | 5 | 9 | 10)
}

/// Names and places of the values of a point format, except coordinates, colours and waveforms.
pub(crate) fn places(format: usize) -> Vec<(&'static str, Place)> {
    let bits = |at, shift, mask| Place::Bits { at, shift, mask };
    let mut places = vec![("Intensity", Place::U16(12))];
    if is_wide(format) {
        places.extend([
            ("ReturnNumber", bits(14, 0, 15)),
            ("NumberOfReturns", bits(14, 4, 15)),
            ("Synthetic", bits(15, 0, 1)),
            ("KeyPoint", bits(15, 1, 1)),
            ("Withheld", bits(15, 2, 1)),
            ("Overlap", bits(15, 3, 1)),
            ("ScanChannel", bits(15, 4, 3)),
            ("ScanDirectionFlag", bits(15, 6, 1)),
            ("EdgeOfFlightLine", bits(15, 7, 1)),
            ("Classification", bits(16, 0, 255)),
            ("UserData", bits(17, 0, 255)),
            ("ScanAngleRank", Place::Angle(18)),
            ("PointSourceId", Place::U16(20)),
        ]);
    } else {
        places.extend([
            ("ReturnNumber", bits(14, 0, 7)),
            ("NumberOfReturns", bits(14, 3, 7)),
            ("ScanDirectionFlag", bits(14, 6, 1)),
            ("EdgeOfFlightLine", bits(14, 7, 1)),
            ("Classification", bits(15, 0, 31)),
            ("Synthetic", bits(15, 5, 1)),
            ("KeyPoint", bits(15, 6, 1)),
            ("Withheld", bits(15, 7, 1)),
            ("ScanAngleRank", Place::I8(16)),
            ("UserData", bits(17, 0, 255)),
            ("PointSourceId", Place::U16(18)),
        ]);
    }
    places.extend(time(format).map(|at| ("GpsTime", Place::F64(at))));
    if matches!(format, 8 | 10) {
        places.push(("Infrared", Place::U16(36)));
    }
    places
}
