//! The lines before the first point: comments, words, names of columns, and counts.

use std::collections::VecDeque;

use autosplats_cloud::{Error, excerpt};

use super::super::{Job, text};
use super::cells::{Dialect, Separator, is_comment, is_count, is_missing, trimmed};
use super::header::Header;
use super::numbers::Notation;

/// Lines of words that may precede the points.
const MAX_LINES_OF_WORDS: usize = 1000;

/// Comments before a line that are searched for names of columns.
const MAX_HEADERS: usize = 64;

/// Rows of numbers required to read a file of unknown name as points; a shorter file needs all its rows to be such.
const MIN_ROWS_OF_POINTS: usize = 2;

/// The lines before the first point.
#[derive(Default)]
pub(super) struct Preamble {
    /// Lines that can be names of columns, in order.
    pub(super) headers: Vec<Header>,
    /// Number of points that a count line states.
    pub(super) promised: Option<usize>,
    /// First bytes of lines of words that are neither comments nor units.
    pub(super) words: Vec<usize>,
    /// First byte of the first row.
    pub(super) start: usize,
}

impl Preamble {
    pub(super) fn parse(job: &Job<'_>) -> Result<Self, Error> {
        let bytes = job.bytes;
        let mut found = Self::default();
        let mut comments = VecDeque::new();
        let mut looks = 0;
        while found.start < bytes.len() {
            looks += 1;
            if looks % (1 << 14) == 0 {
                job.tick(0.0)?;
            }
            let at = found.start;
            let line = trimmed(text::without_mark(&bytes[at..text::line_end(bytes, at)]));
            found.start = text::after_line_end(bytes, at);
            if is_comment(line) {
                // Only the last comments can name the columns; there may be millions.
                if comments.len() == MAX_HEADERS {
                    comments.pop_front();
                }
                comments.push_back((at, line));
                continue;
            }
            let names = comments.drain(..).filter_map(|(at, line)| Header::parse(line.trim_ascii(), at));
            found.headers.extend(names.filter(|header| header.has_axes() || header.open));
            if is_count(line) {
                let line = text::trim(line);
                found.promised = std::str::from_utf8(line).ok().and_then(|line| line.parse().ok());
                if found.promised.is_none() {
                    return Err(job.malformed(job.line(at), "this count of points is too large"));
                }
            } else if found.is_first_row(bytes, line) {
                found.start = at;
                break;
            } else if found.words.len() == MAX_LINES_OF_WORDS {
                return Err(found.no_points(job));
            } else if let Some(header) = Header::parse(line, at) {
                let is_units = found.headers.last_mut().is_some_and(|last| last.take_units(&header));
                if !is_units {
                    found.words.push(at);
                    found.headers.push(header);
                }
            } else {
                found.words.push(at);
            }
        }
        let has_names = found.headers.iter().any(Header::has_axes);
        if found.start >= bytes.len() && !found.words.is_empty() && !has_names {
            return Err(found.no_points(job));
        }
        Ok(found)
    }

    /// Whether a line of values is the first row, though names, words and other numbers may precede the points.
    fn is_first_row(&self, bytes: &[u8], line: &[u8]) -> bool {
        let cells = Cells::of(line);
        if only_numbers(line) {
            return true;
        }
        let named = || self.headers.iter().any(|header| header.has_axes() && header.len() == cells.count);
        let values = cells.numbers + cells.missing;
        let is_row = |cells: &Cells| cells.numbers >= 3 || cells.numbers > 0 && cells.is_all_values();
        if named() && values > cells.count / 2 && (cells.numbers > 0 || cells.strict) {
            return true;
        }
        // Words such as `Offset: 500000 5400000 0` contain numbers too, but no row follows.
        is_row(&cells)
            && next_line(bytes, self.start).is_none_or(|next| {
                let next = Cells::of(next);
                next.count == cells.count && (is_row(&next) || next.is_all_values())
            })
    }

    /// The error of a text in which no row of points is found.
    fn no_points(&self, job: &Job<'_>) -> Error {
        if let Some((header, what)) = self.headers.iter().find_map(|header| Some((header, header.lacks_z()?))) {
            return job.malformed(job.line(header.at), what);
        }
        let at = self.words.first().copied().unwrap_or(0);
        let line = text::trim(&job.bytes[at..text::line_end(job.bytes, at)]);
        let word = text::values(line).find(|value| !Notation::any(value)).unwrap_or(line);
        let what = format!(
            "there are no points in this text: '{}' is not a number, and no later line has x, y and z",
            excerpt(word)
        );
        job.malformed(job.line(at), what)
    }
}

/// What the cells of a line are, whatever separates them.
struct Cells {
    count: usize,
    numbers: usize,
    missing: usize,
    /// Whether something other than blanks separates them.
    strict: bool,
}

impl Cells {
    /// Takes the separator that gives the most numbers.
    fn of(line: &[u8]) -> Self {
        let mut best = Self { count: 0, numbers: 0, missing: 0, strict: false };
        for separator in [Separator::Semicolon, Separator::Tab, Separator::Comma, Separator::Blank] {
            let strict = separator != Separator::Blank;
            if strict && !separator.byte().is_some_and(|byte| line.contains(&byte)) {
                continue;
            }
            let dialect = Dialect { separator, notation: Notation::default() };
            let (_, count) = dialect.count(line);
            let cells = || dialect.cells(line).take(count);
            let missing = cells().filter(|cell| is_missing(cell)).count();
            let numbers = cells().filter(|cell| Notation::any(cell)).count();
            if best.count == 0 || numbers > best.numbers {
                best = Self { count, numbers, missing, strict };
            }
        }
        best
    }

    fn is_all_values(&self) -> bool {
        self.count >= 3 && self.numbers + self.missing == self.count
    }
}

/// The next line that is neither empty nor a comment.
fn next_line(bytes: &[u8], mut at: usize) -> Option<&[u8]> {
    while at < bytes.len() {
        let line = trimmed(text::without_mark(&bytes[at..text::line_end(bytes, at)]));
        if !is_comment(line) && !is_count(line) {
            return Some(line);
        }
        at = text::after_line_end(bytes, at);
    }
    None
}

/// Whether a line has nothing but numbers, as rows without quotes and gaps do.
fn only_numbers(line: &[u8]) -> bool {
    text::values(line).take(super::super::columns::MAX_COLUMNS + 1).all(|value| text::number(value).is_ok())
}

/// Whether a line can be a row: three values are numbers, or all are numbers or missing.
pub(super) fn is_like_row(line: &[u8]) -> bool {
    if only_numbers(line) && text::values(line).nth(2).is_some() {
        return true;
    }
    let cells = Cells::of(line);
    cells.numbers >= 3 || cells.is_all_values()
}

/// Whether a line ends a text: at most a minority of its values are numbers.
pub(super) fn is_words(line: &[u8]) -> bool {
    let cells = Cells::of(line);
    2 * cells.numbers < cells.count
}

/// Whether a text of unknown name has rows of three or more numbers, perhaps after comments and a header.
pub(in super::super) fn looks_like_rows(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(1 << 13)];
    if start.contains(&0) || std::str::from_utf8(start).is_err_and(|error| error.error_len().is_some()) {
        return false;
    }
    // The sample may end inside a line.
    let end = if start.len() < bytes.len() { start.iter().rposition(|&byte| byte == b'\n') } else { Some(start.len()) };
    let lines = start[..end.unwrap_or(0)].split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii);
    let mut lines = lines.filter(|line| !text::is_blank(line) && !text::is_count(line)).peekable();
    lines.next_if(|line| Header::parse(line, 0).is_some_and(|header| header.has_axes()));
    let rows = |line: &&[u8]| only_numbers(line) && text::values(line).count() >= 3;
    let mut count = 0;
    for line in lines.take(MIN_ROWS_OF_POINTS) {
        if !rows(&line) {
            return false;
        }
        count += 1;
    }
    count > 0
}
