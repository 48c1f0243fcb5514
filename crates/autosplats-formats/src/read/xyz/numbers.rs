//! Numbers as people and spreadsheets write them: decimal commas, and digits in groups of three.
//!
//! A number of one group, such as `1.250`, may be one and a quarter or more than a thousand. All numbers of a file are
//! written alike, so those that have one meaning decide about the others.

use autosplats_cloud::excerpt;

use super::super::text;

/// Longest number in bytes.
const MAX_LEN: usize = 64;

/// A cell without the blanks and quotes around it.
pub(super) fn unquoted(cell: &[u8]) -> &[u8] {
    let cell = cell.trim_ascii();
    match cell {
        [b'"', inner @ .., b'"'] => inner.trim_ascii(),
        _ => cell,
    }
}

/// What separates groups of three digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Grouping {
    Point,
    Comma,
    /// Straight and typographic apostrophes.
    Apostrophe,
    /// Blanks of every width that Unicode has, and underscores.
    Blank,
}

/// Notation of numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Notation {
    pub(super) decimal_comma: bool,
    /// Whether the other of comma and point groups digits in numbers that could be read otherwise.
    pub(super) grouped: bool,
}

impl Notation {
    const POINT: Self = Self { decimal_comma: false, grouped: false };
    const ALL: [Self; 4] = [
        Self::POINT,
        Self { decimal_comma: true, grouped: false },
        Self { decimal_comma: false, grouped: true },
        Self { decimal_comma: true, grouped: true },
    ];

    /// The notation in which all numbers among the cells have a meaning. Words do not count. `None` in it means that
    /// nothing tells whether a comma is a decimal mark.
    pub(super) fn of<'a>(cells: impl Iterator<Item = &'a [u8]>) -> Result<Option<Self>, String> {
        let mut found = Evidence::default();
        cells.filter_map(Shape::of).for_each(|shape| found.add(&shape));
        let Evidence { comma, point, .. } = found;
        let decimal_comma = comma.decimal || !point.decimal && point.group;
        let decimal_point = point.decimal || !comma.decimal && comma.group;
        let unlike = |decimal: Mark, other: Mark| decimal.group || other.decimal || other.either && !other.group;
        let contradicts = match (decimal_comma, decimal_point) {
            (true, true) => true,
            (true, false) => unlike(comma, point),
            (false, true) => unlike(point, comma),
            (false, false) => comma.either && point.either,
        };
        if contradicts {
            return Err("some numbers have decimal commas, others points; use points throughout".into());
        }
        if comma.either && !decimal_comma && !decimal_point {
            return Ok(None);
        }
        let grouped = if decimal_comma { point.group } else { comma.group };
        Ok(Some(Self { decimal_comma, grouped }))
    }

    /// Parses the number in a cell.
    #[inline]
    pub(super) fn number(self, cell: &[u8]) -> Result<f64, String> {
        let plain = if self.decimal_comma { with_comma(cell) } else { fast_float2::parse(cell).ok() };
        match plain {
            Some(number) => Ok(number),
            None => self.parse(cell),
        }
    }

    /// Parses a number with quotes, groups of digits, or written in words.
    #[cold]
    fn parse(self, cell: &[u8]) -> Result<f64, String> {
        let cell = unquoted(cell);
        let fail = || {
            let unlike = || format!("'{}' has a point, where other numbers have decimal commas", excerpt(cell));
            Err(text::number(cell).err().unwrap_or_else(unlike))
        };
        let Some(shape) = Shape::of(cell) else {
            return if self.decimal_comma && cell.len() > MAX_LEN { fail() } else { text::number(cell) };
        };
        let (decimal, other) = if self.decimal_comma { (b',', Grouping::Point) } else { (b'.', Grouping::Comma) };
        let fits = match shape.grouping {
            None => shape.decimal.is_none_or(|mark| mark == decimal),
            Some(Grouping::Point | Grouping::Comma) if shape.one_group && shape.decimal.is_none() => {
                // The mark of a single group may be a decimal mark.
                let mark = if shape.grouping == Some(Grouping::Point) { b'.' } else { b',' };
                if mark == decimal {
                    return shape.number(Some(mark));
                }
                self.grouped
            }
            Some(grouping @ (Grouping::Point | Grouping::Comma)) => {
                grouping == other && shape.decimal.is_none_or(|mark| mark == decimal)
            }
            Some(_) => shape.decimal.is_none_or(|mark| mark == decimal),
        };
        if fits { shape.number(shape.decimal) } else { fail() }
    }

    /// Whether a cell is a number in some notation.
    pub(super) fn any(cell: &[u8]) -> bool {
        Self::ALL.iter().any(|notation| notation.number(cell).is_ok())
    }
}

/// A number of digits and perhaps a decimal comma, which most cells of such files are.
fn with_comma(cell: &[u8]) -> Option<f64> {
    let mut plain = [0; MAX_LEN];
    let points = plain.get_mut(..cell.len())?;
    let mut comma = false;
    for (point, &byte) in points.iter_mut().zip(cell) {
        *point = match byte {
            b',' if !comma => {
                comma = true;
                b'.'
            }
            b'0'..=b'9' | b'-' | b'+' | b'e' | b'E' => byte,
            _ => return None,
        };
    }
    fast_float2::parse(&*points).ok()
}

/// What numbers of a file show about a mark.
#[derive(Clone, Copy, Default)]
struct Mark {
    decimal: bool,
    group: bool,
    /// Whether the mark stands before three last digits and nothing else.
    either: bool,
}

#[derive(Clone, Copy, Default)]
struct Evidence {
    comma: Mark,
    point: Mark,
}

impl Evidence {
    fn add(&mut self, shape: &Shape<'_>) {
        match shape.decimal {
            Some(b',') => self.comma.decimal = true,
            Some(_) => self.point.decimal = true,
            None => {}
        }
        let mark = match shape.grouping {
            Some(Grouping::Comma) => &mut self.comma,
            Some(Grouping::Point) => &mut self.point,
            _ => return,
        };
        if shape.one_group && shape.decimal.is_none() {
            mark.either = true;
        } else {
            mark.group = true;
        }
    }
}

/// The parts of a number. A comma or point before three last digits counts as grouping.
struct Shape<'a> {
    cell: &'a [u8],
    grouping: Option<Grouping>,
    one_group: bool,
    decimal: Option<u8>,
}

impl<'a> Shape<'a> {
    /// `None` for what is no number in any notation.
    fn of(cell: &'a [u8]) -> Option<Self> {
        let cell = outside_blanks(unquoted(cell));
        if cell.len() > MAX_LEN {
            return None;
        }
        let mut at = sign_len(cell);
        let (mut groups, mut digits, mut grouping) = (0, 0, None);
        let mut first_zero = false;
        let mut decimal = None;
        while at < cell.len() {
            let byte = cell[at];
            if byte.is_ascii_digit() {
                first_zero |= groups == 0 && digits == 0 && byte == b'0';
                digits += 1;
                at += 1;
            } else if matches!(byte, b'e' | b'E') {
                let exponent = &cell[at + 1..];
                let digits = exponent.strip_prefix(b"-").or(exponent.strip_prefix(b"+")).unwrap_or(exponent);
                if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
                    return None;
                }
                break;
            } else if let Some((kind, len)) = separator(&cell[at..]) {
                let three = cell[at + len..].iter().take_while(|byte| byte.is_ascii_digit()).count() == 3;
                let whole = if groups == 0 { (1..=3).contains(&digits) && !first_zero } else { digits == 3 };
                if three && whole && decimal.is_none() && grouping.is_none_or(|grouping| grouping == kind) {
                    (grouping, digits) = (Some(kind), 0);
                    groups += 1;
                } else if matches!(byte, b'.' | b',') && decimal.is_none() && (groups == 0 || digits == 3) {
                    decimal = Some(byte);
                } else {
                    return None;
                }
                at += len;
            } else {
                return None;
            }
        }
        let same = |mark| decimal == Some(mark);
        if grouping == Some(Grouping::Point) && same(b'.') || grouping == Some(Grouping::Comma) && same(b',') {
            return None;
        }
        let shape = Self { cell, grouping, one_group: groups == 1, decimal };
        shape.number(decimal).is_ok().then_some(shape)
    }

    fn number(&self, decimal: Option<u8>) -> Result<f64, String> {
        let mut plain = [0; MAX_LEN];
        let mut len = 0;
        let sign = sign_len(self.cell);
        if sign > 0 && self.cell[0] != b'+' {
            (plain[0], len) = (b'-', 1);
        }
        for &byte in &self.cell[sign..] {
            if byte.is_ascii_digit() || matches!(byte, b'e' | b'E' | b'-' | b'+') {
                plain[len] = byte;
                len += 1;
            } else if Some(byte) == decimal {
                plain[len] = b'.';
                len += 1;
            }
        }
        fast_float2::parse(&plain[..len]).map_err(|_| text::number(self.cell).err().unwrap_or_default())
    }
}

/// Length of a sign in bytes: plus, hyphen, or the minus of typesetters.
fn sign_len(cell: &[u8]) -> usize {
    match cell {
        [b'+' | b'-', ..] => 1,
        [0xe2, 0x88, 0x92, ..] => 3,
        _ => 0,
    }
}

/// What separates digits at the start of a cell, and its length in bytes.
fn separator(cell: &[u8]) -> Option<(Grouping, usize)> {
    Some(match cell {
        [b'.', ..] => (Grouping::Point, 1),
        [b',', ..] => (Grouping::Comma, 1),
        [b'\'' | b'`', ..] => (Grouping::Apostrophe, 1),
        [0xc2, 0xb4, ..] => (Grouping::Apostrophe, 2),
        [0xca, 0xbc, ..] => (Grouping::Apostrophe, 2),
        [0xe2, 0x80, 0x98 | 0x99, ..] => (Grouping::Apostrophe, 3),
        [b' ' | b'_', ..] => (Grouping::Blank, 1),
        [0xc2, 0xa0, ..] => (Grouping::Blank, 2),
        [0xe2, 0x80, 0x80..=0x8a | 0xaf, ..] => (Grouping::Blank, 3),
        _ => return None,
    })
}

/// A cell without wide blanks around it.
fn outside_blanks(mut cell: &[u8]) -> &[u8] {
    while let [0xc2, 0xa0, rest @ ..] | [rest @ .., 0xc2, 0xa0] = cell {
        cell = rest;
    }
    cell.trim_ascii()
}
