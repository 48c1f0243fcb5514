//! The values of a line, and the separators between them.

use super::super::{columns::MAX_COLUMNS, text};
use super::numbers::{Notation, unquoted};

/// Separator between values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    /// Any number of blanks, tabs, commas and semicolons.
    Any,
    /// Any number of blanks and tabs.
    Blank,
    /// Exactly one comma; two in a row enclose an empty value.
    Comma,
    /// Exactly one semicolon; two in a row enclose an empty value.
    Semicolon,
    /// Exactly one tab; two in a row enclose an empty value.
    Tab,
}

impl Separator {
    /// The separating byte, if there is exactly one.
    pub(super) fn byte(self) -> Option<u8> {
        match self {
            Self::Any | Self::Blank => None,
            Self::Comma => Some(b','),
            Self::Semicolon => Some(b';'),
            Self::Tab => Some(b'\t'),
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Any | Self::Blank => "blanks",
            Self::Comma => "commas",
            Self::Semicolon => "semicolons",
            Self::Tab => "tabs",
        }
    }
}

/// How rows are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Dialect {
    pub(super) separator: Separator,
    pub(super) notation: Notation,
}

impl Dialect {
    pub(super) fn cells<'a>(&self, line: &'a [u8]) -> Cells<'a> {
        Cells { separator: self.separator, rest: Some(line) }
    }

    /// Parses the number in a cell.
    #[inline]
    pub(super) fn number(&self, cell: &[u8]) -> Result<f64, String> {
        self.notation.number(cell)
    }

    /// Number of values on a line, and the same without an empty value at the end. At most one more than allowed is
    /// counted.
    pub(super) fn count(&self, line: &[u8]) -> (usize, usize) {
        let mut last = &b" "[..];
        let count = self.cells(line).take(MAX_COLUMNS + 1).inspect(|cell| last = cell).count();
        (count, count - usize::from(last.is_empty()))
    }
}

/// Placeholders that databases, spreadsheets and people write for missing values, separated by semicolons.
const MISSING: &str = "na;n/a;n.a.;null;(null);<null>;\\n;none;nil;nodata;no data;no_data;no-data;empty;missing;undefined;\
    #n/a;#na;#nv;#null!;#value!;#wert!;#num!;#div/0!";

/// Whether a cell is empty or holds a placeholder for a missing value.
pub(super) fn is_missing(cell: &[u8]) -> bool {
    let cell = unquoted(cell);
    cell.iter().all(|byte| matches!(byte, b'-' | b'?' | b'*'))
        || MISSING.split(';').any(|word| cell.eq_ignore_ascii_case(word.as_bytes()))
}

/// Whether a line is a comment, or empty but for blanks.
pub(super) fn is_comment(line: &[u8]) -> bool {
    let start = text::trim(line);
    if !text::is_blank(start) {
        return false;
    }
    // Spreadsheets write #N/A for what is missing.
    let first = start.split(|byte| matches!(byte, b',' | b';' | b'\t' | b' ')).next().unwrap_or_default();
    first.is_empty() || !is_missing(first)
}

/// Whether a line is a count of points. Tabs separate an empty value.
pub(super) fn is_count(line: &[u8]) -> bool {
    !line.contains(&b'\t') && text::is_count(text::trim(line))
}

/// The cells of a line.
pub(super) struct Cells<'a> {
    separator: Separator,
    rest: Option<&'a [u8]>,
}

/// Whether a byte separates values in [`Separator::Any`].
const fn separates(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b',' | b';' | b'\r')
}

impl<'a> Iterator for Cells<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest?;
        let run = |is_separator: fn(&u8) -> bool| {
            let start = rest.iter().position(|byte| !is_separator(byte))?;
            let len = rest[start..].iter().position(is_separator);
            let end = len.map_or(rest.len(), |len| start + len);
            Some((&rest[start..end], &rest[end..]))
        };
        let run = match self.separator {
            Separator::Any => run(|&byte| separates(byte)),
            Separator::Blank => run(|&byte| matches!(byte, b' ' | b'\t' | b'\r')),
            Separator::Comma | Separator::Semicolon | Separator::Tab => {
                let byte = self.separator.byte()?;
                let start = if let Some(b'"' | b' ') = rest.first() { quoted_len(rest, byte) } else { 0 };
                let end = rest[start..].iter().position(|&other| other == byte).map(|len| start + len);
                self.rest = end.map(|end| &rest[end + 1..]);
                return Some(rest[..end.unwrap_or(rest.len())].trim_ascii());
            }
        };
        let (cell, rest) = run?;
        self.rest = Some(rest);
        Some(cell)
    }
}

/// Length of a value in quotes at the start of a line, whose separators do not count; 0 if a separator or the end of
/// the line does not follow the quote. Two quotes in a row are part of the value.
#[inline(never)]
fn quoted_len(line: &[u8], separator: u8) -> usize {
    let mut at = line.iter().position(|&byte| byte != b' ').unwrap_or(line.len());
    if line.get(at) != Some(&b'"') {
        return 0;
    }
    at += 1;
    while let Some(len) = line[at..].iter().position(|&byte| byte == b'"') {
        at += len + 1;
        if line.get(at) == Some(&b'"') {
            at += 1;
            continue;
        }
        let after =
            line[at..].iter().position(|&byte| byte != b' ' && byte != b'\r').map_or(line.len(), |len| at + len);
        return if line.get(after).is_none_or(|&byte| byte == separator) { after } else { 0 };
    }
    0
}

/// A line without the blanks at its end. A tab at the end is kept, because it separates a last empty value.
pub(super) fn trimmed(mut line: &[u8]) -> &[u8] {
    while let [start @ .., b' ' | b'\r'] = line {
        line = start;
    }
    line
}
