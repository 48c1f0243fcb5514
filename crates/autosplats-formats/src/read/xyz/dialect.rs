//! Detection of the separator and of the notation of numbers from the first rows.

use super::super::{columns::MAX_COLUMNS, text};
use super::cells::{Dialect, Separator, is_missing};
use super::numbers::Notation;
use super::numbers::unquoted;

/// Rows that the dialect is taken from.
const ROWS: usize = 200;

/// Numbers of values on the first rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Widths {
    pub(super) first: usize,
    pub(super) min: usize,
    pub(super) max: usize,
}

impl Widths {
    /// The number of values, if all rows have as many.
    pub(super) fn equal(self) -> Option<usize> {
        (self.min == self.max).then_some(self.min)
    }
}

impl Dialect {
    /// How the rows are written, and their numbers of values. `named` is the number of names in a header.
    pub(super) fn of(lines: &[&[u8]], named: Option<usize>) -> Result<(Self, Widths), String> {
        let lines = &lines[..lines.len().min(ROWS)];
        for separator in [Separator::Semicolon, Separator::Tab, Separator::Comma] {
            if !separator.byte().is_some_and(|byte| lines.iter().all(|line| line.contains(&byte))) {
                continue;
            }
            if separator == Separator::Comma
                && !blanks_in_numbers(lines)
                && let Some(notation) = commas_in_numbers(lines)
            {
                let dialect = Self { separator: Separator::Blank, notation };
                return Ok((dialect, dialect.widths(lines)));
            }
            if let Some(found) = strict(separator, lines, named)? {
                return Ok(found);
            }
        }
        let any = Self { separator: Separator::Any, notation: Notation::default() };
        let notation = Notation::of(lines.iter().flat_map(|line| any.cells(line)))?.unwrap_or_default();
        Ok((Self { notation, ..any }, any.widths(lines)))
    }

    fn widths(&self, lines: &[&[u8]]) -> Widths {
        let counts = || lines.iter().map(|line| self.count(line).0);
        Widths {
            first: counts().next().unwrap_or(0),
            min: counts().min().unwrap_or(0),
            max: counts().max().unwrap_or(0),
        }
    }

    /// The number of values that all lines share. One separator may follow the last value.
    fn common_width(&self, lines: &[&[u8]], named: Option<usize>) -> Option<usize> {
        let counts: Vec<(usize, usize)> = lines.iter().map(|line| self.count(line)).collect();
        let width = match named {
            Some(named) if counts.iter().all(|&(all, _)| all == named) => named,
            _ => counts.iter().map(|&(_, filled)| filled).max()?,
        };
        counts.iter().all(|&(all, filled)| all == width || filled == width).then_some(width)
    }
}

/// The dialect in which exactly one separator is between two values, if the rows are of it.
fn strict(separator: Separator, lines: &[&[u8]], named: Option<usize>) -> Result<Option<(Dialect, Widths)>, String> {
    let mut dialect = Dialect { separator, notation: Notation::default() };
    let cells = || lines.iter().flat_map(|line| dialect.cells(line));
    let widths = match dialect.common_width(lines, named) {
        Some(width) if width >= 3 => Widths { first: width, min: width, max: width },
        // Without empty values and quotes, rows of unequal length are read alike by any separator.
        None if cells().any(|cell| cell.is_empty() || cell.starts_with(b"\"")) => {
            let filled = || lines.iter().map(|line| dialect.count(line).1);
            let min = filled().min().unwrap_or(0);
            Widths { first: filled().next().unwrap_or(0), min, max: filled().max().unwrap_or(0) }
        }
        _ => return Ok(None),
    };
    if widths.min < 3 {
        return Ok(None);
    }
    // Where commas separate values, the few in quotes that could be either mark tell nothing.
    let ambiguous = || Err("numbers such as \"1,250\" may have decimal commas or thousands; write them without".into());
    let notation = match Notation::of(cells())? {
        None if separator == Separator::Comma => return ambiguous(),
        None => Notation { decimal_comma: true, ..Notation::default() },
        Some(notation) => notation,
    };
    let numbers = |cell: &[u8]| text::values(cell).all(Notation::any);
    let several = |cell: &[u8]| {
        let cell = unquoted(cell);
        notation.number(cell).is_err() && !is_missing(cell) && text::values(cell).nth(1).is_some() && numbers(cell)
    };
    // Several tabs in a row align columns, unless a header has as many names.
    let aligned = separator == Separator::Tab && named != Some(widths.first) && cells().any(<[u8]>::is_empty);
    if aligned || cells().any(several) {
        return Ok(None);
    }
    dialect.notation = notation;
    Ok(Some((dialect, widths)))
}

/// Whether commas separate three or more numbers on each line, of which some have blanks inside.
fn blanks_in_numbers(lines: &[&[u8]]) -> bool {
    let commas = Dialect { separator: Separator::Comma, notation: Notation::default() };
    let cells = || lines.iter().flat_map(|line| commas.cells(line));
    cells().any(|cell| cell.contains(&b' '))
        && lines.iter().all(|line| commas.count(line).1 >= 3)
        && cells().all(|cell| is_missing(cell) || commas.number(cell).is_ok())
}

/// The notation of rows in which blanks separate the numbers and commas are inside them.
fn commas_in_numbers(lines: &[&[u8]]) -> Option<Notation> {
    let blank = Dialect { separator: Separator::Blank, notation: Notation::default() };
    let lines: Vec<Vec<&[u8]>> = lines.iter().map(|line| blank.cells(line).collect()).collect();
    let words = || lines.iter().flatten().copied();
    let comma = |word: &&[u8]| word.contains(&b',');
    if words().any(|word| word.starts_with(b",") || word.ends_with(b",") || word.contains(&b'"')) {
        return None;
    }
    let notation = Notation::of(words()).ok()?.unwrap_or(Notation { decimal_comma: true, ..Notation::default() });
    let number = |word: &&[u8]| notation.number(word).is_ok();
    // Triples such as 255,255,255 have no decimals; numbers in groups have some.
    let sure = notation.decimal_comma || words().filter(comma).any(|word| word.contains(&b'.'));
    let numbers = |line: &Vec<&[u8]>| line.len() <= MAX_COLUMNS && line.iter().filter(|word| number(word)).count() >= 3;
    (sure && lines.iter().all(numbers) && words().filter(comma).all(|word| number(&word))).then_some(notation)
}
