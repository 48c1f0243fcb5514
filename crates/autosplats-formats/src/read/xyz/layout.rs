//! The meaning and notation of the values of a row.

use autosplats_cloud::{Crs, Error, excerpt};

use super::super::{Job, columns, columns::MAX_COLUMNS, text};
use super::cells::{Dialect, is_comment, is_count, is_missing, trimmed};
use super::dialect::Widths;
use super::guess::{Cell, wide, words};
use super::naming::{Naming, Sample};
use super::preamble::{Preamble, is_like_row};

/// Rows sampled to guess the meaning of the columns.
const SAMPLED_ROWS: usize = 1000;

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
    /// Whether more values may follow, which are left out.
    pub(super) open: bool,
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
        let fail = |what: String| job.malformed(job.line(first), what);
        let rows: Vec<&[u8]> = lines.iter().map(|&(_, line)| line).collect();
        let given = columns::given(job)?;
        let named = given.as_ref().map(|given| given.names.len()).or_else(|| preamble.headers.last().map(|h| h.len()));
        let (dialect, widths) = Dialect::of(&rows, named).map_err(|what| job.unsupported(what))?;
        if widths.first < 3 {
            let lacks_z = preamble.headers.iter().find_map(|header| header.lacks_z());
            return Err(fail(lacks_z.unwrap_or_else(|| format!("{} values; a point needs x, y and z", widths.first))));
        }
        if widths.first > MAX_COLUMNS {
            return Err(fail(format!("more than {MAX_COLUMNS} values; are there no line ends?")));
        }
        let (start, promised) = (preamble.start, preamble.promised.is_some());
        let sample = Sample { job, start, promised, dialect, widths, cells: cells(&dialect, &rows, widths) };
        let (naming, header) = match given {
            Some(columns::Given { names, open }) => {
                (given_names(names, open, widths).map_err(fail)?, preamble.headers.last())
            }
            None => Naming::of(&sample, &preamble.headers).map_err(|(at, what)| job.malformed(job.line(at), what))?,
        };
        let mut layout = Self::from_names(naming, dialect, &sample.cells, job.options.exact);
        // The line of names may be the only line of words.
        let used = header.filter(|header| !header.comment).map(|header| header.at);
        let skipped: Vec<usize> = preamble.words.iter().copied().filter(|&at| Some(at) != used).collect();
        if let [first, .., last] | [first @ last] = skipped[..] {
            let what = if first == last {
                format!("{} holds words and no point; skipped", job.line(first))
            } else {
                format!(
                    "{} lines of words, {} to {}, hold no point; skipped",
                    skipped.len(),
                    job.line(first),
                    job.line(last)
                )
            };
            layout.notes.insert(0, what);
        }
        Ok(Some(layout))
    }

    /// Most bytes of a point in memory.
    pub(super) fn bytes_per_point(&self, exact: bool) -> usize {
        let fields: usize = self.fields.iter().map(|(_, wide)| if *wide { 8 } else { 4 }).sum();
        12 + if exact { 12 } else { 0 } + if self.has_color { 3 } else { 0 } + fields
    }

    fn from_names(naming: Naming, dialect: Dialect, rows: &[Vec<Cell>], exact: bool) -> Self {
        let Naming { mut names, axes, open, crs, mut notes } = naming;
        let known: Vec<String> = names.iter().map(|name| name.clone().unwrap_or_default()).collect();
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
        Self { dialect, targets, open, fields, has_color: color.is_some(), crs, names, notes }
    }
}

/// The caller's names. They have to cover each row, unless they are open.
fn given_names(names: Vec<Option<String>>, open: bool, widths: Widths) -> Result<Naming, String> {
    let count = names.len();
    if open && count > widths.min {
        return Err(format!(
            "--columns names {count} columns before '...', but there are rows of {} values",
            widths.min
        ));
    }
    if !open && count != widths.first {
        return Err(format!(
            "{} values, but --columns names {count}; name each column, with - for one to leave out, or ... at the end for \
             all others",
            widths.first
        ));
    }
    let known: Vec<String> =
        names.iter().map(|name| name.as_deref().unwrap_or_default().to_ascii_lowercase()).collect();
    let axes = ["x", "y", "z"].map(|axis| known.iter().position(|name| name == axis).unwrap_or_default());
    Ok(Naming { names, axes, open, crs: Crs::default(), notes: Vec::new() })
}

/// The first rows, each with its first byte. Lines of words among them are left out, as they may end the points.
fn sample(bytes: &[u8], start: usize) -> Vec<(usize, &[u8])> {
    let mut lines = Vec::new();
    let mut at = start;
    while at < bytes.len() && lines.len() < SAMPLED_ROWS && at - start < 1 << 20 {
        let line = trimmed(&bytes[at..text::line_end(bytes, at)]);
        if !is_comment(line) && !is_count(line) && (lines.is_empty() || is_like_row(line)) {
            lines.push((at, line));
        }
        at = text::after_line_end(bytes, at);
    }
    lines
}

/// The values of the sampled rows, without rows of unlike length and, as far as there are others, without those whose
/// values are missing.
fn cells(dialect: &Dialect, lines: &[&[u8]], widths: Widths) -> Vec<Vec<Cell>> {
    let cell = |value: &[u8]| match dialect.number(value) {
        _ if is_missing(value) => Cell::Missing,
        Ok(number) => Cell::Number(number),
        Err(_) => Cell::Word,
    };
    let width = widths.first;
    let row = |line: &&[u8]| dialect.cells(line).take(width).map(cell).collect::<Vec<_>>();
    let mut rows: Vec<Vec<Cell>> = lines.iter().map(row).collect();
    rows.iter_mut().for_each(|row| row.resize(width.min(row.len().max(widths.min)), Cell::Missing));
    rows.retain(|row| row.len() == width);
    let numbers = |row: &Vec<Cell>| row.iter().filter(|cell| matches!(cell, Cell::Number(_))).count();
    if rows.iter().any(|row| numbers(row) >= 3) {
        rows.retain(|row| numbers(row) >= 3);
    }
    rows
}
