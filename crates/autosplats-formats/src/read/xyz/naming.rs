//! Names of the columns: from a header, or guessed.

use autosplats_cloud::{Crs, Unit, excerpt};

use super::super::{Job, columns};
use super::cells::Dialect;
use super::dialect::Widths;
use super::guess::{Cell, counts, guessed, words};
use super::header::Header;

/// Rows required to take a first column for point numbers; fewer coordinates may rise evenly by chance.
const MIN_COUNTED_ROWS: usize = 8;

/// Places in the text at which point numbers have to rise.
const PLACES: usize = 256;

/// Longest line, in bytes, that is looked at between two places.
const MAX_LINE: usize = 1 << 12;

/// The first rows.
pub(super) struct Sample<'a> {
    pub(super) job: &'a Job<'a>,
    /// First byte of the first row.
    pub(super) start: usize,
    /// Whether a count of points precedes the rows, as in PTS.
    pub(super) promised: bool,
    pub(super) dialect: Dialect,
    pub(super) widths: Widths,
    pub(super) cells: Vec<Vec<Cell>>,
}

/// Names of the columns, and which are coordinates.
pub(super) struct Naming {
    /// `None` for a column to leave out.
    pub(super) names: Vec<Option<String>>,
    pub(super) axes: [usize; 3],
    /// Whether more values may follow, which are left out.
    pub(super) open: bool,
    pub(super) crs: Crs,
    /// Notes for the user.
    pub(super) notes: Vec<String>,
}

impl Naming {
    /// The names, and the header that states them. The error has the byte of the line that it is about.
    pub(super) fn of<'h>(
        sample: &Sample<'_>,
        headers: &'h [Header],
    ) -> Result<(Self, Option<&'h Header>), (usize, String)> {
        let width = sample.widths.first;
        // Comments and titles may name columns too; a line with as many names as a row has values counts most.
        let with_axes = || headers.iter().rev().filter(|header| header.has_axes());
        if let Some(header) = with_axes().find(|header| !header.open && header.fits(width)) {
            return Ok((Self::fitting(header, sample), Some(header)));
        }
        for header in with_axes() {
            if let Some(naming) = Self::partial(header, sample).map_err(|what| (header.at, what))? {
                return Ok((naming, Some(header)));
            }
        }
        let last = headers.last().filter(|header| !header.comment);
        let header = last.filter(|header| header.fits(width));
        let naming = Self::guessed(sample, header).map_err(|what| (header.map_or(sample.start, |h| h.at), what))?;
        Ok((naming, header))
    }

    /// All columns have names.
    fn fitting(header: &Header, sample: &Sample<'_>) -> Self {
        let names: Vec<String> = filled(&header.names[..sample.widths.first]);
        let axes = columns::find_axes(&names).unwrap_or([0, 1, 2]);
        let crs = crs(&names, &header.units, axes, &sample.cells);
        Self { names: names.into_iter().map(Some).collect(), axes, open: false, crs, notes: Vec::new() }
    }

    /// Some columns have names; `None` if it cannot be told which.
    fn partial(header: &Header, sample: &Sample<'_>) -> Result<Option<Self>, String> {
        let Widths { first, min, .. } = sample.widths;
        let count = header.len();
        let mut names = filled(&header.names[..count]);
        let mut units = header.units.clone();
        let equal = sample.widths.equal();
        let mut note = None;
        let mut left_out = 0;
        if header.open && count <= min {
            note = Some(format!("the columns after the first {count} are a list; left out"));
        } else if count < min {
            if equal == Some(2 * count) && sample.dialect.separator.byte() == Some(b',') && !header.comment {
                return Err(format!(
                    "{count} names, but {first} values in each row; if the commas are decimal marks too, use points or \
                     semicolons"
                ));
            }
            // R writes row names without a name of their own.
            if equal == Some(count + 1) && (words(&sample.cells, 0) || sample.counts_points(0)) {
                names.insert(0, String::new());
                units.insert(0, None);
                left_out = 1;
                note = Some("the first column has no name and counts the rows; left out".into());
            } else if equal == Some(first) && count == 3 && columns::find_axes(&names) == Some([0, 1, 2]) {
                let guess = guessed(&sample.cells, first, false);
                names.extend_from_slice(&guess[3..]);
            } else if equal.is_some() {
                names.extend((count..first).map(|index| format!("column_{}", index + 1)));
            } else {
                note = Some(format!("names are given for the first {count} columns; the others are left out"));
            }
        } else if count > sample.widths.max && !header.comment {
            names.truncate(first);
            note = Some(format!("{count} names, but {first} values in each row; the last names are left out"));
        } else {
            return Ok(None);
        }
        let Some(axes) = columns::find_axes(&names) else { return Ok(None) };
        let crs = crs(&names, &units, axes, &sample.cells);
        let open = names.len() < sample.widths.max;
        let names: Vec<Option<String>> =
            names.into_iter().enumerate().map(|(index, name)| (index >= left_out).then_some(name)).collect();
        let notes = vec![note.unwrap_or_else(|| columns::taken_for(&names))];
        Ok(Some(Self { names, axes, open, crs, notes }))
    }

    /// No names, or names that do not state x, y and z: the first three columns of numbers are taken for them.
    fn guessed(sample: &Sample<'_>, header: Option<&Header>) -> Result<Self, String> {
        let width = sample.widths.first;
        let mut kept: Vec<usize> = (0..width).collect();
        let mut notes = Vec::new();
        let numbers = |index: &usize| !words(&sample.cells, *index);
        let is_word = |row: &Vec<Cell>| row[0] == Cell::Word;
        // Names of points may be numbers here and there.
        if width > 3 && sample.cells.iter().any(is_word) && (1..4).all(|index| numbers(&index)) {
            kept.remove(0);
        }
        let plain: Vec<usize> = kept.iter().copied().filter(numbers).collect();
        if plain.len() >= 3 {
            kept = plain;
        }
        let counter = Some(kept[0]).filter(|&first| kept.len() > 3 && sample.counts_points(first));
        kept.retain(|&index| Some(index) != counter);
        let projected: Vec<Vec<Cell>> =
            sample.cells.iter().map(|row| kept.iter().map(|&index| row[index]).collect()).collect();
        let pts = sample.promised;
        let guess = guessed(&projected, kept.len(), pts);
        let axes = [kept[0], kept[1], kept[2]];
        let stated: Vec<String> = header.map(|header| filled(&header.names[..width])).unwrap_or_default();
        if let Some(header) = header {
            check_stated(header, &stated, axes, width)?;
        }
        let mut names: Vec<Option<String>> = vec![None; width];
        for (name, &index) in guess.iter().zip(&kept) {
            let is_axis = axes.contains(&index);
            names[index] = Some(stated.get(index).filter(|_| !is_axis).unwrap_or(name).clone());
        }
        for (index, name) in names.iter_mut().enumerate().filter(|(index, _)| !kept.contains(index)) {
            let is_counter = counter == Some(index);
            *name = stated.get(index).filter(|_| !is_counter && words(&sample.cells, index)).cloned();
            if name.is_none() {
                let what = if is_counter { "counts the points" } else { "holds words" };
                notes.push(format!("column {} {what}; left out", index + 1));
            }
        }
        // Three columns leave nothing to guess, and PTS defines its columns.
        let defined = width == 3 || pts && (width == 4 || width == 7 && guess.get(4).is_some_and(|name| name == "red"));
        match header {
            Some(_) => notes.insert(0, format!("the header names no x, y and z; {}", columns::taken_for(&names))),
            None if defined => {}
            None => notes.insert(0, columns::taken_for(&names)),
        }
        Ok(Self { names, axes, open: false, crs: Crs::default(), notes })
    }
}

/// Fails if a header states some of x, y and z, and the columns taken for them are others.
fn check_stated(header: &Header, names: &[String], taken: [usize; 3], width: usize) -> Result<(), String> {
    let stated = columns::axes(names);
    let Some(missing) = (0..3).find(|&axis| stated[axis].is_none()) else { return Ok(()) };
    let contradicts = (0..3).any(|axis| stated[axis].is_some_and(|index| index != taken[axis]));
    // A column of intensities or colours is no height, nor is one of many columns because it comes third.
    let other = columns::is_known(&names[taken[missing]]) || width > 3;
    if stated.iter().any(Option::is_some) && (contradicts || other) {
        return Err(header.lacks_z().unwrap_or_else(|| {
            let names = excerpt(names.join(" ").as_bytes());
            format!("{} is missing among the columns '{names}'; name them with --columns", ["x", "y", "z"][missing])
        }));
    }
    Ok(())
}

impl Sample<'_> {
    /// Whether a column counts the points: whole numbers that rise by one step from row to row, all over the text, with
    /// three more numbers behind it.
    fn counts_points(&self, column: usize) -> bool {
        self.cells.len() >= MIN_COUNTED_ROWS
            && (column + 1..column + 4).all(|index| index < self.widths.first && !words(&self.cells, index))
            && counts(&self.cells, column)
            && self.rises_everywhere(column)
    }

    /// Whether a column rises from place to place in the text: coordinates of a grid begin again in each of its rows.
    fn rises_everywhere(&self, column: usize) -> bool {
        let text = self.job.bytes;
        let line_end = |at: usize| {
            let window = &text[at..text.len().min(at + MAX_LINE)];
            window.iter().position(|&byte| byte == b'\n').map(|len| at + len)
        };
        let mut last = (self.start, f64::NEG_INFINITY);
        for place in 1..PLACES {
            let offset = self.start + ((text.len() - self.start) as u128 * place as u128 / PLACES as u128) as usize;
            let Some(at) = line_end(offset).map(|end| end + 1) else { continue };
            let Some(end) = line_end(at).filter(|_| at > last.0) else { continue };
            let number = self.dialect.cells(&text[at..end]).nth(column).and_then(|cell| self.dialect.number(cell).ok());
            let Some(number) = number else { continue };
            if number <= last.1 {
                return false;
            }
            last = (at, number);
        }
        true
    }
}

/// Names of columns; those without a name are numbered.
fn filled(names: &[String]) -> Vec<String> {
    let name = |(index, name): (usize, &String)| {
        if name.is_empty() { format!("column_{}", index + 1) } else { name.clone() }
    };
    names.iter().enumerate().map(name).collect()
}

/// The units of positions, from the names and units of their columns. Words for longitude and latitude also mean the
/// length and width of things, so the values have to be angles.
fn crs(names: &[String], units: &[Option<Unit>], [x, y, z]: [usize; 3], rows: &[Vec<Cell>]) -> Crs {
    let unit = |index: usize| units.get(index).copied().flatten();
    let within = |column: usize, limit: f64| rows.iter().all(|row| !(row[column].number().abs() > limit));
    let degrees = columns::is_longitude(&names[x]) && within(x, 360.0) && within(y, 90.0);
    let horizontal = if degrees { Some(Unit::Degree) } else { unit(x) };
    Crs { unit: horizontal, vertical_unit: unit(z).filter(|_| unit(z) != horizontal), ..Crs::default() }
}
