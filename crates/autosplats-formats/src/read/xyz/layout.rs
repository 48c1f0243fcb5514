//! The lines before the first point, and the meaning of the values of a row.

use autosplats_cloud::{Crs, Error, Unit, excerpt};

use super::super::{Job, columns, columns::MAX_COLUMNS, text};
use super::{
    cells::{Dialect, is_missing, trimmed},
    guess::{Cell, guessed, wide, words},
    header::Header,
};

/// Rows sampled to guess the meaning of the columns.
const SAMPLED_ROWS: usize = 1000;

/// Rows of numbers required to read a file of unknown name as points; a shorter file needs all its rows to be such.
const MIN_ROWS_OF_POINTS: usize = 2;

/// The lines before the first point.
pub(super) struct Preamble {
    header: Option<Header>,
    /// Number of points that a count line states.
    pub(super) promised: Option<usize>,
    /// First byte of the first row.
    pub(super) start: usize,
    pub(super) byte_order_mark: bool,
}

impl Preamble {
    pub(super) fn parse(job: &Job<'_>) -> Result<Self, Error> {
        let bytes = job.bytes;
        let byte_order_mark = bytes.starts_with(b"\xef\xbb\xbf");
        let mut at = if byte_order_mark { 3 } else { 0 };
        let mut header: Option<Header> = None;
        let mut promised = None;
        let mut header_seen = false;
        let mut looks = 0;
        while at < bytes.len() {
            looks += 1;
            if looks % (1 << 14) == 0 {
                job.tick(0.0)?;
            }
            let line = bytes[at..text::line_end(bytes, at)].trim_ascii();
            if text::is_blank(line) {
                header = Header::parse(line).filter(Header::has_axes).or(header);
            } else if text::is_count(line) {
                promised = std::str::from_utf8(line).ok().and_then(|line| line.parse().ok());
                if promised.is_none() {
                    return Err(job.malformed(job.line(at), "this count of points is too large"));
                }
            } else if is_row(line) || only_numbers(line) {
                break;
            } else if !header_seen && promised.is_none() {
                header_seen = true;
                header = Header::parse(line);
            } else if let Some(named) = Header::parse(line).filter(|named| promised.is_none() && named.has_axes()) {
                // The line before was a title.
                header = Some(named);
            } else {
                let what = text::values(line).find_map(|value| Dialect::ANY.number(value).err()).unwrap_or_default();
                return Err(job.malformed(job.line(at), what));
            }
            at = text::after_line_end(bytes, at);
        }
        if at >= bytes.len() && header_seen && !header.as_ref().is_some_and(Header::has_axes) {
            return Err(job.malformed("line 1", "there are no points in this text: no line has x, y and z"));
        }
        Ok(Self { header, promised, start: at, byte_order_mark })
    }
}

/// Whether a line is a row of values rather than a header: at least three values are numbers.
fn is_row(line: &[u8]) -> bool {
    // Names may contain blanks if another separator is used.
    let separator = [b';', b'\t', b','].into_iter().find(|separator| line.contains(separator));
    let numbers = |cells: &mut dyn Iterator<Item = &[u8]>| {
        cells.take(MAX_COLUMNS + 1).filter(|cell| Dialect::COMMAS.number(cell).is_ok()).count()
    };
    3 <= match separator {
        Some(separator) => numbers(&mut line.split(|&byte| byte == separator)),
        None => numbers(&mut text::values(line)),
    }
}

fn only_numbers(line: &[u8]) -> bool {
    text::values(line).take(MAX_COLUMNS + 1).all(|value| Dialect::ANY.number(value).is_ok())
}

/// Whether a text of unknown name has rows of three or more numbers, perhaps after comments and a header.
pub(in super::super) fn looks_like_rows(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(1 << 13)];
    if start.contains(&0) || std::str::from_utf8(start).is_err_and(|error| error.error_len().is_some()) {
        return false;
    }
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start);
    // The sample may end inside a line.
    let end = if start.len() < bytes.len() { start.iter().rposition(|&byte| byte == b'\n') } else { Some(start.len()) };
    let lines = start[..end.unwrap_or(0)].split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii);
    let mut lines = lines.filter(|line| !text::is_blank(line) && !text::is_count(line)).peekable();
    lines.next_if(|line| Header::parse(line).is_some_and(|header| header.has_axes()));
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

/// Destination of a value of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    Skip,
    Axis(usize),
    Channel(usize),
    Field(usize),
}

/// Meaning and notation of the values of a row.
pub(super) struct Layout {
    pub(super) dialect: Dialect,
    /// Destination of each value.
    pub(super) targets: Vec<Target>,
    /// Names of the fields, and whether they need `f64`.
    pub(super) fields: Vec<(String, bool)>,
    pub(super) has_color: bool,
    pub(super) crs: Crs,
    /// Names of all columns; `None` for those left out.
    pub(super) names: Vec<Option<String>>,
    /// Notes for the user.
    pub(super) notes: Vec<String>,
}

impl Layout {
    /// Inspects the first rows; `None` if there are none.
    pub(super) fn of(job: &Job<'_>, preamble: &Preamble) -> Result<Option<Self>, Error> {
        let lines = sample(job.bytes, preamble.start);
        let Some(&(first, _)) = lines.first() else { return Ok(None) };
        let place = || job.line(first);
        let rows: Vec<&[u8]> = lines.iter().map(|&(_, line)| line).collect();
        let named_columns = preamble.header.as_ref().map(Header::len);
        let (dialect, width) = Dialect::of(&rows, named_columns).map_err(|what| job.unsupported(what))?;
        if width < 3 {
            return Err(job.malformed(place(), format!("{width} values; a point needs x, y and z")));
        }
        if width > MAX_COLUMNS {
            return Err(job.malformed(place(), format!("more than {MAX_COLUMNS} values; are there no line ends?")));
        }
        let mut notes = Vec::new();
        let mut crs = Crs::default();
        let rows = values(&dialect, &rows, width);
        let given = columns::given(job)?;
        let names: Vec<Option<String>> = if let Some(given) = given {
            if given.len() != width {
                let what = format!(
                    "{width} values, but --columns names {}; name each column, with - for one to leave out",
                    given.len()
                );
                return Err(job.malformed(place(), what));
            }
            given
        } else if let Some((names, units)) =
            preamble.header.as_ref().and_then(|header| Some((header.fitting(width)?, &header.units)))
        {
            named(names, units, &mut crs, &mut notes)
        } else {
            let names = guessed(&rows, width, preamble.promised.is_some());
            // Three columns leave nothing to guess, and PTS defines its columns.
            let pts = preamble.promised.is_some() && (width == 4 || width == 7 && names[4] == "red");
            let names: Vec<Option<String>> = names.into_iter().map(Some).collect();
            if width > 3 && !pts {
                notes.push(columns::taken_for(&names));
            }
            names
        };
        Ok(Some(Self::from_names(names, dialect, crs, notes, &rows, job.options.exact)))
    }

    fn from_names(
        mut names: Vec<Option<String>>,
        dialect: Dialect,
        crs: Crs,
        mut notes: Vec<String>,
        rows: &[Vec<Cell>],
        exact: bool,
    ) -> Self {
        let known: Vec<String> = names.iter().map(|name| name.clone().unwrap_or_default()).collect();
        let axes = columns::find_axes(&known).unwrap_or([0, 1, 2]);
        let color = columns::find_color(&known);
        let mut targets = Vec::with_capacity(names.len());
        let mut fields: Vec<(String, bool)> = Vec::new();
        for (index, name) in names.iter_mut().enumerate() {
            let place = |three: [usize; 3]| three.iter().position(|&place| place == index);
            targets.push(match name {
                _ if place(axes).is_some() => Target::Axis(place(axes).unwrap_or_default()),
                Some(_) if color.and_then(place).is_some() => {
                    Target::Channel(color.and_then(place).unwrap_or_default())
                }
                Some(text) if words(rows, index) => {
                    notes.push(format!("column '{}' holds words; left out", excerpt(text.as_bytes())));
                    *name = None;
                    Target::Skip
                }
                Some(text) => {
                    let mut unique = columns::field_name(text);
                    while fields.iter().any(|(other, _)| *other == unique) {
                        unique.push('_');
                    }
                    fields.push((unique, text.to_lowercase().contains("time") || wide(rows, index, exact)));
                    Target::Field(fields.len() - 1)
                }
                None => Target::Skip,
            });
        }
        Self { dialect, targets, fields, has_color: color.is_some(), crs, names, notes }
    }
}

/// The first rows, each with its first byte.
fn sample(bytes: &[u8], start: usize) -> Vec<(usize, &[u8])> {
    let mut lines = Vec::new();
    let mut at = start;
    while at < bytes.len() && lines.len() < SAMPLED_ROWS && at - start < 1 << 20 {
        let line = trimmed(&bytes[at..text::line_end(bytes, at)]);
        if !text::is_blank(line.trim_ascii()) && !text::is_count(line.trim_ascii()) {
            lines.push((at, line));
        }
        at = text::after_line_end(bytes, at);
    }
    lines
}

/// The values of the sampled rows, up to the first row that is shorter than the first.
fn values(dialect: &Dialect, lines: &[&[u8]], width: usize) -> Vec<Vec<Cell>> {
    let cell = |value: &[u8]| match dialect.number(value) {
        _ if is_missing(value) => Cell::Missing,
        Ok(number) => Cell::Number(number),
        Err(_) => Cell::Word,
    };
    let row = |line: &&[u8]| dialect.cells(line).take(width).map(cell).collect::<Vec<_>>();
    lines.iter().map(row).take_while(|row| row.len() == width).collect()
}

/// Names from a header, and the units they state. If x, y or z is missing, the first three columns are taken for them.
fn named(names: &[String], units: &[Option<Unit>], crs: &mut Crs, notes: &mut Vec<String>) -> Vec<Option<String>> {
    let mut names = names.to_vec();
    for (index, name) in names.iter_mut().enumerate().filter(|(_, name)| name.is_empty()) {
        *name = format!("column_{}", index + 1);
    }
    if let Some([x, _, z]) = columns::find_axes(&names) {
        crs.unit = if columns::is_longitude(&names[x]) { Some(Unit::Degree) } else { units[x] };
        crs.vertical_unit = units[z].filter(|_| units[z] != crs.unit);
        return names.into_iter().map(Some).collect();
    }
    for (name, axis) in names.iter_mut().zip(["x", "y", "z"]) {
        *name = axis.into();
    }
    let names: Vec<Option<String>> = names.into_iter().map(Some).collect();
    notes.push(format!("the header names no x, y and z; {}", columns::taken_for(&names)));
    names
}
