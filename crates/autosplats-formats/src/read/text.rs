//! Rows of numbers in text to packed records, in parallel.
//!
//! The text is cut into pieces at line ends, and the pieces are parsed in parallel. Each row becomes one record of
//! little-endian numbers for a [`Table`](super::table::Table).

use std::sync::atomic::{AtomicUsize, Ordering};

use autosplats_cloud::{Error, excerpt};
use rayon::prelude::*;

pub(super) use super::cuts::{after_line_end, line_end};
use super::{
    Job,
    columns::{is_latitude, is_longitude},
    cuts::Text,
    table::{CHUNK, ProgressRange, Scalar, is_packed_color, reserve},
};

/// Storage type of coordinates in text. All digits are read, even if the declared type holds fewer.
pub(super) const TEXT: &str = "text";

/// Whether a value is a coordinate, which keeps all its digits.
pub(super) fn is_coordinate(name: &str) -> bool {
    ["x", "y", "z"].contains(&&*name.to_ascii_lowercase()) || is_longitude(name) || is_latitude(name)
}

/// What to do with the next value of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Token {
    /// Store the value in the record.
    Store(Scalar),
    /// Store a colour packed into 32 bits, written as an integer or as the float of the same bits.
    Packed,
    /// Skip the value.
    Skip,
    /// Read a count and skip that many values.
    SkipList,
}

impl Token {
    /// How to store a value of this name and declared type, and in which type: coordinates keep all their digits, and
    /// packed colours their bits.
    pub(super) fn of(name: &str, scalar: Scalar) -> (Scalar, Self) {
        if is_coordinate(name) {
            (Scalar::F64, Self::Store(Scalar::F64))
        } else if is_packed_color(name, scalar) {
            (Scalar::U32, Self::Packed)
        } else {
            (scalar, Self::Store(scalar))
        }
    }

    /// Bytes of the value in the record.
    pub(super) fn size(self) -> usize {
        match self {
            Self::Store(scalar) => scalar.size(),
            Self::Packed => 4,
            Self::Skip | Self::SkipList => 0,
        }
    }
}

/// Layout of the rows of a text.
pub(super) struct Rows<'a> {
    pub(super) tokens: &'a [Token],
    /// Number of rows to read; `None` reads to the end of the file.
    pub(super) count: Option<usize>,
    /// Whether the text may end before all rows, which is told.
    pub(super) may_be_cut: bool,
}

/// Rows that end early: after how many values, the byte that fills the rest of their records, and how many there are.
pub(super) struct Short {
    values: usize,
    fill: u8,
    rows: AtomicUsize,
}

impl Short {
    pub(super) fn new(values: usize, fill: u8) -> Self {
        Self { values, fill, rows: AtomicUsize::new(0) }
    }

    /// Number of such rows so far.
    pub(super) fn rows(&self) -> usize {
        self.rows.load(Ordering::Relaxed)
    }
}

/// Result of parsing one piece of text.
struct Piece {
    records: Vec<u8>,
    rows: usize,
    error: Option<(usize, String)>,
}

impl Rows<'_> {
    /// Parses rows from byte `start` on. Returns the records and their number.
    pub(super) fn parse(&self, job: &Job<'_>, start: usize, part: ProgressRange) -> Result<(Vec<u8>, usize), Error> {
        self.parse_and_show(job, start, part, |_, _| Ok(()))
    }

    /// Like [`parse`](Self::parse), of rows of which some end early.
    pub(super) fn parse_with_short(
        &self,
        job: &Job<'_>,
        start: usize,
        part: ProgressRange,
        short: &Short,
    ) -> Result<(Vec<u8>, usize), Error> {
        self.parse_all(job, start, part, Some(short), |_, _| Ok(()))
    }

    /// Like [`parse`](Self::parse), and passes the records and their number to `show`, about a million at a time,
    /// before the next ones are parsed.
    pub(super) fn parse_and_show(
        &self,
        job: &Job<'_>,
        start: usize,
        part: ProgressRange,
        show: impl Fn(&[u8], usize) -> Result<(), Error>,
    ) -> Result<(Vec<u8>, usize), Error> {
        self.parse_all(job, start, part, None, show)
    }

    fn parse_all(
        &self,
        job: &Job<'_>,
        start: usize,
        part: ProgressRange,
        short: Option<&Short>,
        show: impl Fn(&[u8], usize) -> Result<(), Error>,
    ) -> Result<(Vec<u8>, usize), Error> {
        let len = self.record_len();
        let mut records = Vec::new();
        let (mut rows, mut shown) = (0, 0);
        let count = self.each(job, Text::Held(job.bytes), start, part, short, |bytes, more| {
            reserve(&mut records, bytes.len(), "the points of a text file")?;
            records.extend_from_slice(bytes);
            rows += more;
            if rows - shown >= CHUNK {
                show(&records[shown * len..], rows - shown)?;
                shown = rows;
            }
            Ok(())
        })?;
        records.truncate(count * len);
        shown = shown.min(count);
        show(&records[shown * len..], count - shown)?;
        Ok((records, count))
    }

    /// Parses rows from byte `start` of a text on, and passes on the records of each piece, with their number, in
    /// order. Returns the number of rows. The last row that is passed on does not count if the text ends within it.
    pub(super) fn each(
        &self,
        job: &Job<'_>,
        text: Text<'_>,
        start: usize,
        part: ProgressRange,
        short: Option<&Short>,
        mut take: impl FnMut(&[u8], usize) -> Result<(), Error>,
    ) -> Result<usize, Error> {
        let len = self.record_len();
        let wanted = self.count.unwrap_or(usize::MAX);
        let mut rows = 0;
        let mut complete_last = true;
        let mut at = start;
        let mut space = Vec::new();
        while at < text.len() && rows < wanted {
            job.tick(part.start + part.len * (at - start) as f32 / (text.len() - start) as f32)?;
            let batch = text.batch(job, at, 4 * rayon::current_num_threads(), &mut space)?;
            let parse = |cut: &[usize]| {
                let (piece, start) = batch.piece(cut);
                self.parse_piece(piece, start, short)
            };
            let pieces: Vec<Piece> = batch.cuts.par_windows(2).map(parse).collect();
            at = batch.end();
            for piece in pieces {
                let more = piece.rows.min(wanted - rows);
                take(&piece.records[..more * len], more)?;
                rows += more;
                if rows == wanted {
                    break;
                }
                if let Some((offset, what)) = piece.error {
                    // An unfinished last line.
                    if self.may_be_cut && rows > 0 && text.is_in_last_line(offset)? {
                        complete_last = false;
                        break;
                    }
                    return Err(job.malformed(text.line(offset)?, what));
                }
            }
        }
        if self.count.is_some() && rows < wanted {
            if self.may_be_cut {
                let ends = text.bytes(text.len().saturating_sub(1), 1)? == b"\n";
                if !ends && complete_last {
                    // Digits of the last value may be missing.
                    rows = rows.saturating_sub(1);
                }
                job.tell_cut_off(rows, wanted, "points")?;
            } else {
                return Err(job.malformed(
                    text.line(text.len())?,
                    format!("the file ends after {rows} of {wanted} points; it is cut off, copy it again"),
                ));
            }
        }
        Ok(rows)
    }

    fn record_len(&self) -> usize {
        self.tokens.iter().map(|token| token.size()).sum()
    }

    fn parse_piece(&self, text: &[u8], start: usize, short: Option<&Short>) -> Piece {
        let mut piece = Piece { records: Vec::new(), rows: 0, error: None };
        let mut at = 0;
        while at < text.len() {
            let end = line_end(text, at);
            let line = trim(&text[at..end]);
            if !is_blank(line) {
                let len = piece.records.len();
                if let Err(what) = self.parse_row(line, short, &mut piece.records) {
                    piece.records.truncate(len);
                    piece.error = Some((start + at, what));
                    break;
                }
                piece.rows += 1;
            }
            at = end + 1;
        }
        piece
    }

    fn parse_row(&self, line: &[u8], short: Option<&Short>, record: &mut Vec<u8>) -> Result<(), String> {
        let mut values = values(line);
        for (index, token) in self.tokens.iter().enumerate() {
            let Some(value) = values.next() else {
                let rest = self.tokens[index..].iter().map(|token| token.size()).sum::<usize>();
                return match short.filter(|short| short.values == index) {
                    Some(short) => {
                        record.resize(record.len() + rest, short.fill);
                        short.rows.fetch_add(1, Ordering::Relaxed);
                        Ok(())
                    }
                    None => Err(format!(
                        "{index} values where a point has {}; complete or remove the line",
                        self.tokens.len()
                    )),
                };
            };
            match token {
                Token::Skip => {}
                Token::SkipList => {
                    let len = number(value)?;
                    for index in 0..len as usize {
                        values.next().ok_or_else(|| format!("a list of {len} values has only {index}"))?;
                    }
                }
                Token::Packed => record.extend(packed(value)?.to_le_bytes()),
                Token::Store(scalar) => store(*scalar, value, record)?,
            }
        }
        match values.next() {
            None => Ok(()),
            Some(value) => {
                Err(format!("more values than the {} a point has, from '{}' on", self.tokens.len(), excerpt(value)))
            }
        }
    }
}

#[allow(clippy::cast_lossless, reason = "64-bit integers among the types have no lossless way")]
fn store(scalar: Scalar, value: &[u8], record: &mut Vec<u8>) -> Result<(), String> {
    macro_rules! integer {
        ($type:ty) => {{
            let number = number(value)?;
            if number < <$type>::MIN as f64 || number > <$type>::MAX as f64 || number.is_nan() {
                return Err(format!("{number} does not fit {}", stringify!($type)));
            }
            record.extend((number as $type).to_le_bytes());
        }};
    }
    match scalar {
        Scalar::I8 => integer!(i8),
        Scalar::U8 => integer!(u8),
        Scalar::I16 => integer!(i16),
        Scalar::U16 => integer!(u16),
        Scalar::I32 => integer!(i32),
        Scalar::U32 => integer!(u32),
        Scalar::I64 => integer!(i64),
        Scalar::U64 => integer!(u64),
        Scalar::F32 => record.extend((number(value)? as f32).to_le_bytes()),
        Scalar::F64 => record.extend(number(value)?.to_le_bytes()),
    }
    Ok(())
}

/// Decodes a packed colour: an integer, or, with a point or an exponent, a float whose bits are the colour.
fn packed(value: &[u8]) -> Result<u32, String> {
    match std::str::from_utf8(value).ok().and_then(|text| text.parse::<i64>().ok()) {
        Some(integer) => Ok(integer as u32),
        None => Ok((number(value)? as f32).to_bits()),
    }
}

/// A number, including `nan` and `inf` in any letter case.
pub(super) fn number(value: &[u8]) -> Result<f64, String> {
    fast_float2::parse(value).or_else(|_| {
        // Windows writes -nan(ind) and 1.#QNAN.
        let lower = value.to_ascii_lowercase();
        if lower.starts_with(b"-nan") || lower.starts_with(b"nan(") || lower.windows(2).any(|pair| pair == b"#q") {
            return Ok(f64::NAN);
        }
        Err(format!("'{}' is not a number", excerpt(value)))
    })
}

/// The values of a line, separated by blanks, commas or semicolons.
pub(super) fn values(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|byte| matches!(byte, b' ' | b'\t' | b',' | b';' | b'\r')).filter(|value| !value.is_empty())
}

/// A line without the blanks around it, and without a byte order mark.
pub(super) fn trim(line: &[u8]) -> &[u8] {
    without_mark(line.trim_ascii()).trim_ascii_start()
}

/// A line without the byte order mark that the parts of joined files begin with.
#[inline]
pub(super) fn without_mark(line: &[u8]) -> &[u8] {
    line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line)
}

/// Whether a trimmed line is empty or a comment.
pub(super) fn is_blank(line: &[u8]) -> bool {
    line.is_empty() || line.starts_with(b"#") || line.starts_with(b"//")
}

/// Whether a trimmed line is a single integer, such as the count before the points of a PTS file.
pub(super) fn is_count(line: &[u8]) -> bool {
    !line.is_empty() && line.iter().all(u8::is_ascii_digit)
}
