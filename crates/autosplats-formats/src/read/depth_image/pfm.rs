//! PFM, uncompressed grey images of 32-bit floats, rows from the bottom.

use autosplats_cloud::{Error, excerpt};

use super::{
    super::{Job, table::reserve},
    pgm::{number, word},
};

/// Header of a PFM.
pub(super) struct Header {
    pub(super) width: usize,
    pub(super) height: usize,
    big_endian: bool,
    /// First byte after the header.
    end: usize,
}

/// Whether the file begins like a PFM, grey or in colours.
pub(super) fn recognised(bytes: &[u8]) -> bool {
    (bytes.starts_with(b"Pf") || bytes.starts_with(b"PF")) && bytes.get(2).is_some_and(u8::is_ascii_whitespace)
}

impl Header {
    pub(super) fn parse(job: &Job<'_>) -> Result<Self, Error> {
        if job.bytes[1] == b'F' {
            return Err(super::no_depth(job, "PFM in colours"));
        }
        let mut at = 2;
        let mut next = || {
            let (word, end) = word(job.bytes, at);
            let place = format!("byte {at}");
            at = end;
            (word, place)
        };
        let mut side = |what: &str| {
            let (word, place) = next();
            let side = number(word).filter(|side| (1..1 << 24).contains(side));
            side.ok_or_else(|| job.malformed(place, format!("'{}' is not a valid {what} of an image", excerpt(word))))
        };
        let (width, height) = (side("width")?, side("height")?);
        let (scale, place) = next();
        let scale_sign = std::str::from_utf8(scale).ok().and_then(|word| word.parse::<f32>().ok());
        let Some(scale_sign) = scale_sign.filter(|scale| scale.is_finite() && *scale != 0.0) else {
            let what = format!("'{}' is not a valid scale, whose sign is the byte order", excerpt(scale));
            return Err(job.malformed(place, what));
        };
        let end = (at + 1).min(job.bytes.len());
        let there = (job.bytes.len() - end) / 4;
        if width * height > there {
            let what =
                format!("the file ends after {there} of {} pixels; it is cut off, copy it again", width * height);
            return Err(job.malformed(format!("byte {}", job.bytes.len()), what));
        }
        Ok(Self { width, height, big_endian: scale_sign > 0.0, end })
    }

    /// All values, row by row from the top.
    pub(super) fn values(&self, job: &Job<'_>) -> Result<Vec<f32>, Error> {
        let mut values = Vec::new();
        reserve(&mut values, self.width * self.height, "a depth image")?;
        let raw = &job.bytes[self.end..][..4 * self.width * self.height];
        for row in raw.chunks_exact(4 * self.width).rev() {
            let read = |bytes: &[u8; 4]| {
                if self.big_endian { f32::from_be_bytes(*bytes) } else { f32::from_le_bytes(*bytes) }
            };
            values.extend(row.as_chunks::<4>().0.iter().map(read));
        }
        Ok(values)
    }
}
