//! A line of column names before the points.

use std::borrow::Cow;

use autosplats_cloud::Unit;

use super::super::{MAX_HEADER_LINE, columns, columns::MAX_COLUMNS, names, text};
use super::cells::{Dialect, Separator};
use super::numbers::Notation;

/// Names of columns, and the units they state.
#[derive(Clone)]
pub(super) struct Header {
    pub(super) names: Vec<String>,
    pub(super) units: Vec<Option<Unit>>,
    /// Indices of x, y and z among the names.
    axes: [Option<usize>; 3],
    /// Whether the last name stood for a list, such as `TRACK[]`, which is left out.
    pub(super) open: bool,
    /// Whether the line is a comment.
    pub(super) comment: bool,
    /// First byte of the line.
    pub(super) at: usize,
}

impl Header {
    /// Parses a header line, which may be a comment. Names may contain blanks if another separator is used.
    pub(super) fn parse(line: &[u8], at: usize) -> Option<Self> {
        if line.len() > MAX_HEADER_LINE {
            return None;
        }
        decoded(line).filter_map(|line| Self::of(&line, at)).find(Self::has_axes).or_else(|| {
            let line = decoded(line).next()?;
            Self::of(&line, at)
        })
    }

    fn of(line: &str, at: usize) -> Option<Self> {
        let comment = text::is_blank(line.as_bytes());
        let line = line.trim_start_matches(['#', '/', '%', ' ', '\u{feff}']);
        let separator = [Separator::Semicolon, Separator::Tab, Separator::Comma]
            .into_iter()
            .find(|separator| separator.byte().is_some_and(|byte| line.as_bytes().contains(&byte)));
        let clean = |name: &str| name.trim().trim_matches(['"', '\'']).trim().to_owned();
        let mut names: Vec<String> = Vec::new();
        match separator {
            Some(separator) => {
                let cells = Dialect { separator, notation: Notation::default() };
                names.extend(cells.cells(line.as_bytes()).map(|cell| clean(&String::from_utf8_lossy(cell))));
            }
            None => {
                // `x [m] y [m]`: a unit belongs to the name before it.
                for word in line.split_ascii_whitespace() {
                    match names.last_mut() {
                        Some(last) if word.starts_with(['[', '(']) && !last.ends_with([']', ')']) => *last += word,
                        _ => names.push(clean(word)),
                    }
                }
            }
        }
        let list = names.iter().position(|name| name.contains("[]") || matches!(&**name, "..." | "…"));
        if let Some(list) = list {
            names.truncate(list);
        }
        if names.len() < 2 || names.len() > MAX_COLUMNS + 1 {
            return None;
        }
        let mut units = Vec::with_capacity(names.len());
        for name in &mut names {
            let inside = name.find(['[', '(']).filter(|&at| at > 0).map(|at| (at, name[at..].to_owned()));
            let Some((at, inside)) = inside else {
                units.push(None);
                continue;
            };
            let inside = inside.trim_matches(['[', ']', '(', ')', ' ']);
            units.push(unit_of(inside));
            name.truncate(name[..at].trim_end().len());
            // `X (Northing)`: the direction counts more than the letter.
            if name.chars().count() == 1 && inside.len() > 1 && names::axis(&names::plain(inside)).is_some() {
                *name = inside.to_owned();
            }
        }
        let axes = columns::axes(&names);
        Some(Self { names, units, axes, open: list.is_some(), comment, at })
    }

    /// Number of names; a separator after the last name is not counted.
    pub(super) fn len(&self) -> usize {
        self.names.iter().rposition(|name| !name.is_empty()).map_or(0, |last| last + 1)
    }

    pub(super) fn has_axes(&self) -> bool {
        self.axes.iter().all(Option::is_some)
    }

    /// Why the names make no points: x and y are there, but no z.
    pub(super) fn lacks_z(&self) -> Option<String> {
        let [Some(_), Some(_), None] = self.axes else { return None };
        let names = autosplats_cloud::excerpt(self.names.join(" ").as_bytes());
        Some(format!("z is missing: no column of '{names}' is a height, and a point needs x, y and z"))
    }

    /// The names, if a row has as many values. A separator may follow the last name.
    pub(super) fn fits(&self, width: usize) -> bool {
        let more = self.names.get(width..);
        more.is_some_and(|more| more.is_empty() || more.len() == 1 && more[0].is_empty())
    }

    /// Takes the units from a line of units below the names. Returns whether the line is one.
    pub(super) fn take_units(&mut self, line: &Self) -> bool {
        let units: Option<Vec<Option<Unit>>> = line
            .names
            .iter()
            .map(|name| match name.trim_matches(['[', ']', '(', ')', ' ', '-']) {
                "" => Some(None),
                name => unit_of(name).map(Some),
            })
            .collect();
        match units {
            Some(units) if units.len() == self.names.len() && units.iter().any(Option::is_some) => {
                self.units = units;
                true
            }
            _ => false,
        }
    }
}

/// A line as UTF-8 and, if it is not, as the code pages of Western and Eastern Windows.
fn decoded(line: &[u8]) -> impl Iterator<Item = Cow<'_, str>> {
    let utf8 = std::str::from_utf8(line).ok();
    let page = |number: u16| {
        let char = move |&byte: &u8| match byte {
            0..0x80 => char::from(byte),
            0xa8 if number == 1251 => 'Ё',
            0xb8 if number == 1251 => 'ё',
            0xc0.. if number == 1251 => char::from_u32(0x410 + u32::from(byte) - 0xc0).unwrap_or_default(),
            _ => char::from(byte),
        };
        Cow::Owned(line.iter().map(char).collect())
    };
    let pages = [1252, 1251].into_iter().filter(move |_| utf8.is_none()).map(page);
    utf8.map(Cow::Borrowed).into_iter().chain(pages)
}

fn unit_of(name: &str) -> Option<Unit> {
    Some(match &*name.to_lowercase() {
        "m" | "metre" | "meter" | "metres" | "meters" => Unit::Metre,
        "mm" => Unit::Millimetre,
        "ft" | "feet" | "foot" => Unit::Foot,
        "usft" | "us ft" | "ftus" => Unit::UsSurveyFoot,
        "deg" | "degree" | "degrees" | "°" => Unit::Degree,
        _ => return None,
    })
}
