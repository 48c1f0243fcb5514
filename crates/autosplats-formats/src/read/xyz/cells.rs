//! The values of a line: separators and number formats.

use super::super::text;

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

/// Notation of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Dialect {
    pub(super) separator: Separator,
    pub(super) decimal_comma: bool,
}

impl Dialect {
    pub(super) const ANY: Self = Self { separator: Separator::Any, decimal_comma: false };
    /// Notation for testing numbers that may have decimal commas.
    pub(super) const COMMAS: Self = Self { separator: Separator::Blank, decimal_comma: true };

    pub(super) fn cells<'a>(&self, line: &'a [u8]) -> Cells<'a> {
        Cells { separator: self.separator, rest: Some(line) }
    }

    /// Parses the number in a cell, which may have quotes and a decimal comma.
    #[inline]
    pub(super) fn number(&self, cell: &[u8]) -> Result<f64, String> {
        match fast_float2::parse(cell) {
            Ok(number) => Ok(number),
            Err(_) => self.odd_number(cell),
        }
    }

    #[cold]
    fn odd_number(&self, cell: &[u8]) -> Result<f64, String> {
        let cell = unquoted(cell);
        let mut points = [0; 64];
        match points.get_mut(..cell.len()) {
            Some(points) if self.decimal_comma => {
                points.copy_from_slice(cell);
                points.iter_mut().filter(|byte| **byte == b',').for_each(|byte| *byte = b'.');
                text::number(points).map_err(|_| text::number(cell).err().unwrap_or_default())
            }
            _ => text::number(cell),
        }
    }
}

/// A cell without the blanks and quotes around it.
pub(super) fn unquoted(cell: &[u8]) -> &[u8] {
    let cell = cell.trim_ascii();
    match cell {
        [b'"', inner @ .., b'"'] => inner.trim_ascii(),
        _ => cell,
    }
}

/// Whether a cell is empty or holds a placeholder for a missing value.
pub(super) fn is_missing(cell: &[u8]) -> bool {
    let cell = unquoted(cell);
    matches!(cell, b"" | b"-")
        || [&b"na"[..], b"n/a", b"null", b"none"].iter().any(|word| cell.eq_ignore_ascii_case(word))
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
                let end = rest.iter().position(|&other| other == byte);
                self.rest = end.map(|end| &rest[end + 1..]);
                return Some(rest[..end.unwrap_or(rest.len())].trim_ascii());
            }
        };
        let (cell, rest) = run?;
        self.rest = Some(rest);
        Some(cell)
    }
}

/// A line without the blanks at its end. A tab at the end is kept, because it separates a last empty value.
pub(super) fn trimmed(mut line: &[u8]) -> &[u8] {
    while let [start @ .., b' ' | b'\r'] = line {
        line = start;
    }
    line
}
