//! PGM, uncompressed grey images. Values are not rescaled by the stated maximum.

use autosplats_cloud::{Error, excerpt};

use super::super::{Job, table::reserve};

/// Header of a PGM.
pub(super) struct Header {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) largest: usize,
    pub(super) ascii: bool,
    /// First byte after the header.
    end: usize,
}

/// Whether the file begins like a PGM, binary or text.
pub(super) fn recognised(bytes: &[u8]) -> bool {
    (bytes.starts_with(b"P5") || bytes.starts_with(b"P2")) && bytes.get(2).is_some_and(u8::is_ascii_whitespace)
}

/// The next word between blanks and comments, and the byte after it.
pub(super) fn word(bytes: &[u8], mut at: usize) -> (&[u8], usize) {
    while let Some(&byte) = bytes.get(at) {
        match byte {
            b'#' => at += bytes[at..].iter().position(|&byte| byte == b'\n').unwrap_or(bytes.len() - at),
            _ if byte.is_ascii_whitespace() => at += 1,
            _ => break,
        }
    }
    let rest = &bytes[at..];
    let len = rest.iter().position(|byte| byte.is_ascii_whitespace() || *byte == b'#').unwrap_or(rest.len());
    (&rest[..len], at + len)
}

pub(super) fn number(word: &[u8]) -> Option<usize> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

impl Header {
    pub(super) fn parse(job: &Job<'_>) -> Result<Self, Error> {
        if !recognised(job.bytes) {
            return Err(job.malformed("byte 0", "this is neither PNG nor PGM (P5 or P2)"));
        }
        let mut at = 2;
        let mut next = |what: &str| {
            let (word, end) = word(job.bytes, at);
            let place = format!("byte {at}");
            at = end;
            let number = number(word).filter(|number| (1..1 << 24).contains(number));
            number.ok_or_else(|| job.malformed(place, format!("'{}' is not a valid {what} of an image", excerpt(word))))
        };
        let (width, height, largest) = (next("width")?, next("height")?, next("greatest value")?);
        if largest > 65535 {
            return Err(job.malformed(format!("byte {at}"), format!("{largest} is beyond 16 bits")));
        }
        let ascii = job.bytes[1] == b'2';
        // A single blank ends the header. A value of text takes at least two bytes, the last value perhaps one.
        let end = (at + 1).min(job.bytes.len());
        let fits = (job.bytes.len() - end + usize::from(ascii)) / 2;
        if largest > 255 && width * height > fits {
            return Err(job.malformed(
                format!("byte {}", job.bytes.len()),
                format!("the file ends after {fits} of {} pixels; it is cut off, copy it again", width * height),
            ));
        }
        Ok(Self { width, height, largest, ascii, end })
    }

    /// All values, row by row.
    pub(super) fn values(&self, job: &Job<'_>) -> Result<Vec<u16>, Error> {
        let count = self.width * self.height;
        let mut values = Vec::new();
        reserve(&mut values, count, "a depth image")?;
        if !self.ascii {
            let pairs = job.bytes[self.end..].as_chunks::<2>().0;
            values.extend(pairs[..count].iter().map(|&pair| u16::from_be_bytes(pair)));
            return Ok(values);
        }
        let mut at = self.end;
        for pixel in 0..count {
            if pixel % (1 << 20) == 0 {
                job.tick(0.5 * pixel as f32 / count as f32)?;
            }
            let (word, end) = word(job.bytes, at);
            at = end;
            let value = number(word).and_then(|value| u16::try_from(value).ok()).ok_or_else(|| {
                let what = format!("'{}' is not a value of pixel {} of {count}", excerpt(word), pixel + 1);
                job.malformed(job.line(at), what)
            })?;
            values.push(value);
        }
        Ok(values)
    }
}
