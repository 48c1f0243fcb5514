//! Detection of the separator and of decimal commas from the first rows.

use super::super::{columns::MAX_COLUMNS, text};
use super::cells::{Dialect, Separator, unquoted};

impl Dialect {
    /// The notation of the rows, and their number of values. `named` is the number of names in a header.
    pub(super) fn of(lines: &[&[u8]], named: Option<usize>) -> Result<(Self, usize), String> {
        let any = (Self::ANY, Self::ANY.cells(lines[0]).take(MAX_COLUMNS + 1).count());
        let lines = &lines[..lines.len().min(200)];
        for separator in [Separator::Semicolon, Separator::Tab, Separator::Comma] {
            if !separator.byte().is_some_and(|byte| lines.iter().all(|line| line.contains(&byte))) {
                continue;
            }
            if separator == Separator::Comma && decimal_commas(lines) {
                let dialect = Self { separator: Separator::Blank, decimal_comma: true };
                return Ok((dialect, dialect.cells(lines[0]).count()));
            }
            let strict = Self { separator, decimal_comma: false };
            let Some(width) = strict.common_width(lines, named).filter(|&width| width >= 3) else { continue };
            let cells = || lines.iter().flat_map(|line| strict.cells(line));
            let numbers = |cell: &[u8]| text::values(cell).all(|value| Self::ANY.number(value).is_ok());
            let with_comma = || cells().filter(|cell| cell.contains(&b','));
            if separator != Separator::Comma && with_comma().any(|cell| numbers(unquoted(cell))) {
                let points = cells().any(|cell| cell.contains(&b'.'));
                if with_comma().all(one_decimal_comma) && !points {
                    return Ok((Self { separator, decimal_comma: true }, width));
                }
                if points {
                    return Err("some numbers have decimal commas, others points; use points throughout".into());
                }
            }
            // Several tabs in a row align columns, unless a header has as many names.
            let aligned = separator == Separator::Tab && named != Some(width) && cells().any(<[u8]>::is_empty);
            let several = |cell: &[u8]| text::values(cell).nth(1).is_some() && numbers(cell);
            if !aligned && !cells().any(several) {
                return Ok((strict, width));
            }
        }
        Ok(any)
    }

    /// The number of values that all lines share. One separator may follow the last value.
    fn common_width(&self, lines: &[&[u8]], named: Option<usize>) -> Option<usize> {
        let count = |line: &[u8]| {
            let mut last = &[][..];
            let count = self.cells(line).take(MAX_COLUMNS + 2).inspect(|cell| last = cell).count();
            (count, count - usize::from(last.is_empty()))
        };
        let counts: Vec<(usize, usize)> = lines.iter().map(|line| count(line)).collect();
        let width = match named {
            Some(named) if counts.iter().all(|&(all, _)| all == named) => named,
            _ => counts.iter().map(|&(_, filled)| filled).max()?,
        };
        counts.iter().all(|&(all, filled)| all == width || filled == width).then_some(width)
    }
}

/// Whether blanks separate the numbers and commas are decimal marks.
fn decimal_commas(lines: &[&[u8]]) -> bool {
    lines.iter().all(|line| {
        let words = || line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let fits = |word: &[u8]| !word.contains(&b'.') && (!word.contains(&b',') || one_decimal_comma(word));
        words().count() >= 3 && words().all(fits)
    })
}

fn one_decimal_comma(word: &[u8]) -> bool {
    let inside = !word.starts_with(b",") && !word.ends_with(b",");
    inside && word.iter().filter(|&&byte| byte == b',').count() == 1 && Dialect::COMMAS.number(word).is_ok()
}
