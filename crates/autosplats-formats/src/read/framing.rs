//! Consecutive files in a stream of bytes: where each begins and ends.
//!
//! # How it works
//!
//! Only formats whose header states their length can follow each other: PLY and PCD. Bytes arrive in pieces of any size
//! and are inspected once. Bytes that cannot begin a file are skipped up to the next beginning, and reported once.

use autosplats_cloud::{Error, excerpt, one_line};

use super::{Job, MAX_HEADER_LINE, ReadOptions, body::Body, pcd, ply, text};

/// Longest header, in bytes; a longer one means a broken file.
const MAX_HEADER: usize = 16 * MAX_HEADER_LINE;

/// Beginnings of files that are searched for among other bytes.
const MARKS: &[&[u8]] = &[
    b"ply\nformat ",
    b"ply\r\nformat ",
    b"ply\rformat ",
    b"ply\ncomment",
    b"ply\r\ncomment",
    b"ply\nobj_info",
    b"# .PCD",
    b"VERSION ",
];

/// Beginnings of files that are accepted directly after a file.
const BEGINNINGS: &[&[u8]] = &[b"ply\n", b"ply\r", b"ply ", b"#", b"VERSION ", b"FIELDS ", b"COLUMNS "];

/// Skipped before a file; programs write it before text.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

enum State {
    /// A file may begin here.
    Between,
    /// Inside bytes that were reported as no file.
    Lost,
    /// Inside a header, in the line that begins at `line`. The line does not end before byte `looked`.
    Header { line: usize, looked: usize },
    /// After the header. `at` is the first byte not yet counted as a line or a record.
    Body { body: Body, at: usize, looked: usize },
}

/// Finds files in a stream of bytes.
pub struct Framing {
    bytes: Vec<u8>,
    /// Number of bytes of the stream before `bytes`.
    before: u64,
    limit: usize,
    state: State,
}

/// A finding in the stream.
pub enum Found {
    /// A file: the byte of the stream at which it begins, and its bytes.
    File(u64, Vec<u8>),
    /// Bytes that are no file: the byte of the stream at which they begin, and the reason.
    Refused(u64, String),
}

impl Framing {
    /// Accepts files of at most `limit` bytes.
    pub fn new(limit: usize) -> Self {
        Self { bytes: Vec::new(), before: 0, limit, state: State::Between }
    }

    /// Whether the stream so far ends inside a file.
    pub fn is_within(&self) -> bool {
        matches!(self.state, State::Header { .. } | State::Body { .. })
    }

    /// Appends bytes of the stream.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// The next finding, or `None` if more bytes are needed.
    pub fn find(&mut self) -> Option<Found> {
        loop {
            match &mut self.state {
                State::Between => {
                    // Some programs pad files with zeros; zeros at the start of the stream are no padding.
                    let filled = self.before > 0;
                    let blank = |byte: &u8| byte.is_ascii_whitespace() || (filled && *byte == 0);
                    let start = self.bytes.iter().position(|byte| !blank(byte)).unwrap_or(self.bytes.len());
                    self.skip(start);
                    if begins(&self.bytes, &[BYTE_ORDER_MARK])? {
                        self.skip(BYTE_ORDER_MARK.len());
                        continue;
                    }
                    match begins(&self.bytes, BEGINNINGS)? {
                        true => self.state = State::Header { line: 0, looked: 0 },
                        false => {
                            let what = format!(
                                "'{}' is neither PLY nor PCD",
                                excerpt(&self.bytes[..self.bytes.len().min(16)])
                            );
                            return Some(self.refuse(what, 1));
                        }
                    }
                }
                State::Lost => {
                    let places = 0..self.bytes.len();
                    let found = places.into_iter().find(|&at| begins(&self.bytes[at..], MARKS) != Some(false));
                    self.skip(found.unwrap_or(self.bytes.len()));
                    // Wait for the rest of a mark that is incomplete.
                    if !begins(&self.bytes, MARKS)? {
                        return None;
                    }
                    self.state = State::Header { line: 0, looked: 0 };
                }
                State::Header { line, looked } => {
                    let end = header_end(&self.bytes, line, looked);
                    let so_far = end.unwrap_or(self.bytes.len());
                    if so_far > MAX_HEADER {
                        return Some(self.refuse(format!("a header of more than {MAX_HEADER} bytes"), so_far));
                    }
                    match self.measure(end?) {
                        Ok((body, at)) => self.state = State::Body { body, at, looked: at },
                        Err(what) => return Some(self.refuse(what, so_far)),
                    }
                }
                State::Body { body, at, looked } => {
                    let found = body_end(&self.bytes, body, at, looked);
                    let counted = *at;
                    return match found {
                        Ok(Some(end)) if end <= self.limit => Some(self.take(end)),
                        Ok(None) if self.bytes.len() <= self.limit => None,
                        Ok(_) => Some(self.refuse(too_long("more", self.limit), counted)),
                        Err(what) => Some(self.refuse(what, counted)),
                    };
                }
            }
        }
    }

    /// The finding in the remaining bytes at the end of the stream.
    pub fn end(&mut self) -> Option<Found> {
        match &self.state {
            State::Lost => return None,
            State::Between if self.bytes.is_empty() => return None,
            State::Body { body: Body::Lines(1), at, .. } if !text::is_blank(self.bytes[*at..].trim_ascii()) => {
                return Some(self.take(self.bytes.len()));
            }
            _ => {}
        }
        let what = format!("the stream ends after {} bytes of a frame; it is cut off", self.bytes.len());
        Some(self.refuse(what, self.bytes.len()))
    }

    /// The body that follows the header ending at `end`, and its first byte.
    fn measure(&self, end: usize) -> Result<(Body, usize), String> {
        let options = ReadOptions::default();
        // Only the reason of the error is used.
        let job =
            Job { path: "".as_ref(), progress: &(), bytes: &self.bytes[..end], options: &options, triangles: false };
        let measured = if self.bytes.starts_with(b"ply") { ply::body(&job) } else { pcd::body(&job) };
        let (body, start, least) = measured.map_err(|error| match error {
            Error::Malformed { place, what, .. } => format!("{place} of a header: {what}"),
            other => other.to_string(),
        })?;
        match least.and_then(|least| least.checked_add(start)) {
            Some(least) if least <= self.limit => Ok((body, start)),
            Some(least) => Err(too_long(&least.to_string(), self.limit)),
            None => Err(too_long("more", self.limit)),
        }
    }

    /// Discards the first bytes.
    fn skip(&mut self, bytes: usize) {
        self.bytes.drain(..bytes);
        self.before += bytes as u64;
    }

    fn take(&mut self, end: usize) -> Found {
        let (rest, start) = (self.bytes.split_off(end), self.before);
        self.before += end as u64;
        self.state = State::Between;
        Found::File(start, std::mem::replace(&mut self.bytes, rest))
    }

    /// Discards these bytes and searches for the next mark.
    fn refuse(&mut self, what: String, bytes: usize) -> Found {
        let start = self.before;
        self.skip(bytes);
        self.state = State::Lost;
        Found::Refused(start, one_line(&what))
    }
}

fn too_long(bytes: &str, limit: usize) -> String {
    format!("its header announces {bytes} bytes where {limit} are allowed; send fewer points or raise the limit")
}

/// Whether bytes begin with one of the marks; `None` if more bytes are needed to decide.
fn begins(bytes: &[u8], marks: &[&[u8]]) -> Option<bool> {
    let whole = marks.iter().any(|mark| bytes.starts_with(mark));
    let may = || marks.iter().any(|mark| mark.starts_with(bytes));
    if whole { Some(true) } else { (!may()).then_some(false) }
}

/// The first byte after the last line of a header, once that byte has arrived.
fn header_end(bytes: &[u8], line: &mut usize, looked: &mut usize) -> Option<usize> {
    let is_ply = bytes.starts_with(b"ply");
    // Lines of old PLY files end in a carriage return.
    let ends = |byte: &u8| *byte == b'\n' || is_ply && *byte == b'\r';
    loop {
        let Some(end) = bytes[*looked..].iter().position(ends).map(|len| *looked + len) else {
            *looked = bytes.len();
            return None;
        };
        let word = bytes[*line..end].split(u8::is_ascii_whitespace).find(|word| !word.is_empty()).unwrap_or_default();
        let last = if is_ply { word == b"end_header" } else { word.eq_ignore_ascii_case(b"DATA") };
        if last && bytes[end] == b'\r' {
            // The next byte shows whether a line feed belongs to the line end. Without one there is no body.
            *looked = end;
            let next = bytes.get(end + 1)?;
            return Some(if *next == b'\n' { end + 2 } else { end + 1 });
        }
        (*line, *looked) = (end + 1, end + 1);
        if last {
            return Some(end + 1);
        }
    }
}

/// The first byte after a body, once the body has arrived.
fn body_end(bytes: &[u8], body: &mut Body, at: &mut usize, looked: &mut usize) -> Result<Option<usize>, String> {
    match body {
        Body::Bytes(len) => Ok(Some(at.saturating_add(*len)).filter(|&end| end <= bytes.len())),
        Body::Sized => {
            let Some(raw) = bytes.get(*at..*at + 8) else { return Ok(None) };
            let len = u32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]) as usize;
            *body = Body::Bytes(len.saturating_add(8));
            body_end(bytes, body, at, looked)
        }
        Body::Records(records) => records.end(bytes, at),
        Body::Lines(left) => {
            while *left > 0 {
                let Some(len) = bytes[*looked..].iter().position(|&byte| byte == b'\n') else {
                    *looked = bytes.len();
                    return Ok(None);
                };
                let end = *looked + len;
                let line = bytes[*at..end].trim_ascii();
                if line == b"ply" || [&b"# .PCD"[..], b"VERSION "].iter().any(|mark| line.starts_with(mark)) {
                    return Err(format!("{left} lines of points are missing before the next header"));
                }
                *left -= usize::from(!text::is_blank(line));
                (*at, *looked) = (end + 1, end + 1);
            }
            Ok(Some(*at))
        }
    }
}

#[cfg(test)]
mod tests;
