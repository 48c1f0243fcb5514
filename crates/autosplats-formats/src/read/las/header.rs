//! The public header of LAS files.

use autosplats_cloud::{Error, shown_number};
use glam::DVec3;

use super::super::Job;
use crate::las;

/// Bytes of the header of LAS 1.0 to 1.2, and of LAS 1.4.
const LEGACY_HEADER_LEN: usize = 227;
const HEADER_LEN_LAS14: usize = 375;

/// Contents of the header, checked as far as reading needs.
pub(super) struct Header {
    /// Major and minor version.
    pub(super) version: (u8, u8),
    pub(super) global_encoding: u16,
    pub(super) system: String,
    pub(super) software: String,
    /// Day of the year, and year.
    pub(super) created: (u16, u16),
    pub(super) format: usize,
    pub(super) record_len: usize,
    pub(super) compressed: bool,
    /// Number of points in the header.
    pub(super) stated: u64,
    /// Number of points: the stated one, or that of all whole records if zero is stated.
    pub(super) points: u64,
    /// Number of whole records that there is room for, if they are not compressed.
    pub(super) held: usize,
    pub(super) points_by_return: Vec<u64>,
    pub(super) point_data: usize,
    /// First byte after the header, where the variable length records begin, and their number.
    pub(super) records: (usize, u32),
    /// First byte behind the points: of what the header places there, or the end of the file.
    pub(super) end: usize,
    /// First byte and number of the extended records after the points.
    pub(super) extended: (u64, u32),
    pub(super) scale: DVec3,
    pub(super) offset: DVec3,
    /// Least and greatest coordinates, as claimed.
    pub(super) bounds: [DVec3; 2],
}

impl Header {
    pub(super) fn read(job: &Job<'_>) -> Result<Self, Error> {
        let bytes = job.bytes;
        let fail = |at: usize, what: String| job.malformed(format!("byte {at}"), what);
        if !bytes.starts_with(b"LASF") && bytes.len() >= 4 {
            return Err(fail(0, "a LAS file begins with 'LASF'; this one does not".into()));
        }
        let long = bytes.len() > 25 && bytes[24] == 1 && bytes[25] >= 4;
        let needed = if long { HEADER_LEN_LAS14 } else { LEGACY_HEADER_LEN };
        if bytes.len() < needed || !bytes.starts_with(b"LASF") {
            let what = format!("the header of {needed} bytes is cut off; copy the file again");
            return Err(fail(bytes.len(), what));
        }
        let raw = Raw(bytes);
        let kind = bytes[104];
        let format = usize::from(kind & 0x3f);
        let record_len = usize::from(raw.u16(105));
        let Some(&least) = las::RECORD_LEN.get(format) else {
            return Err(fail(104, format!("point format {format} does not exist; formats 0 to 10 do")));
        };
        if record_len < least {
            return Err(fail(105, format!("records of {record_len} bytes are too short for format {format}")));
        }
        let (scale, offset) = (raw.vector(131, 8), raw.vector(155, 8));
        if !scale.is_finite() || !offset.is_finite() || scale.abs().min_element() == 0.0 {
            let [scale, offset] = [scale, offset].map(|vector| vector.to_array().map(shown_number).join(", "));
            return Err(fail(131, format!("invalid scale {scale} or offset {offset} of the coordinates")));
        }
        let point_data = raw.u32(96) as usize;
        if point_data > bytes.len() {
            return Err(fail(
                bytes.len(),
                format!("the points should begin at byte {point_data}; copy the file again"),
            ));
        }
        let legacy = u64::from(raw.u32(107));
        let large = if long { raw.u64(247) } else { 0 };
        let stated = if large == 0 { legacy } else { large };
        let extended = if long { (raw.u64(235), raw.u32(243)) } else { (0, 0) };
        let compressed = kind & 0xc0 != 0;
        let waveforms = if bytes[24..26] >= [1, 3][..] && bytes.len() >= 235 { raw.u64(227) } else { 0 };
        let behind = [waveforms, if extended.1 > 0 { extended.0 } else { 0 }].map(|at| usize::try_from(at).ok());
        let behind = behind.into_iter().flatten().filter(|at| (point_data + 1..bytes.len()).contains(at)).min();
        let end = behind.unwrap_or(bytes.len());
        let held = (end - point_data) / record_len;
        let short_returns = || (0..5).map(|i| u64::from(raw.u32(111 + 4 * i))).collect();
        Ok(Self {
            version: (bytes[24], bytes[25]),
            global_encoding: raw.u16(6),
            system: text(&bytes[26..58]),
            software: text(&bytes[58..90]),
            created: (raw.u16(90), raw.u16(92)),
            format,
            record_len,
            compressed,
            stated,
            held,
            points: if stated == 0 && !compressed { held as u64 } else { stated },
            points_by_return: if large == 0 {
                short_returns()
            } else {
                (0..15).map(|i| raw.u64(255 + 8 * i)).collect()
            },
            point_data,
            records: (raw.u16(94).into(), raw.u32(100)),
            end,
            extended,
            scale,
            offset,
            bounds: [raw.vector(187, 16), raw.vector(179, 16)],
        })
    }

    /// World coordinates of a record.
    #[inline]
    pub(super) fn world(&self, record: &[u8]) -> DVec3 {
        let axis =
            |at: usize| f64::from(i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]));
        DVec3::new(axis(0), axis(4), axis(8)) * self.scale + self.offset
    }

    /// The claimed bounds, if 32-bit integers can reach them.
    pub(super) fn sane_bounds(&self) -> Option<[DVec3; 2]> {
        let [low, high] = self.bounds;
        let reach = self.scale.abs() * 2_147_483_649.0;
        let inside = |point: DVec3| (point - self.offset).abs().cmple(reach).all();
        (low.cmple(high).all() && inside(low) && inside(high)).then_some(self.bounds)
    }

    /// Note on a number of points in the header that is less than `found`, the number of whole records.
    pub(super) fn more_than_stated(&self, found: usize) -> Option<String> {
        let stated = self.stated;
        let what = if stated == 0 { "all are read" } else { "the others are left out" };
        (found as u64 > stated).then(|| format!("the header states {stated} points, but {found} are there; {what}"))
    }

    /// Name and version of the format, without the encoding.
    pub(super) fn version_name(&self) -> String {
        format!("LAS {}.{}", self.version.0, self.version.1)
    }
}

/// Little-endian numbers at fixed offsets, which must be within the bytes.
struct Raw<'a>(&'a [u8]);

impl Raw<'_> {
    fn bytes<const LEN: usize>(&self, at: usize) -> [u8; LEN] {
        let mut raw = [0; LEN];
        raw.copy_from_slice(&self.0[at..at + LEN]);
        raw
    }

    fn u16(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.bytes(at))
    }

    fn u32(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.bytes(at))
    }

    fn u64(&self, at: usize) -> u64 {
        u64::from_le_bytes(self.bytes(at))
    }

    /// Three `f64`, `step` bytes apart.
    fn vector(&self, at: usize, step: usize) -> DVec3 {
        let axis = |index: usize| f64::from_le_bytes(self.bytes(at + step * index));
        DVec3::new(axis(0), axis(1), axis(2))
    }
}

/// The text before the first zero byte, without characters that act on a terminal.
pub(super) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let text = String::from_utf8_lossy(&bytes[..end]);
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect::<String>().trim().to_owned()
}

#[inline]
pub(super) fn bytes_at<const LEN: usize>(record: &[u8], at: usize) -> [u8; LEN] {
    let mut bytes = [0; LEN];
    bytes.copy_from_slice(&record[at..at + LEN]);
    bytes
}
