//! Rows of numbers to a cloud, in parallel.
//!
//! The text is cut into pieces at line ends. The pieces are parsed in parallel, each into columns of its own, which are
//! appended to the cloud's columns in order. Besides the cloud, only one batch of pieces is in memory.

use autosplats_cloud::{Crs, Error, FieldValues, PointCloud, Unit, degree_origin, excerpt, residual, storage_origin};
use glam::DVec3;
use rayon::prelude::*;

use super::super::{
    Job,
    table::reserve,
    text,
    units::{LOOKS_LIKE_DEGREES, look_like_degrees},
};
use super::{
    cells::{Separator, is_comment, is_count, is_missing, trimmed},
    layout::{Layout, Target},
    preamble::is_words,
};
use crate::color_scale::ColorScale;

/// Bytes of text that one thread parses at a time.
const PIECE: usize = 1 << 19;

/// Pieces parsed before their points are added to the cloud.
const BATCH: usize = 16;

/// Fraction of the work that parsing takes.
const PARSING: f32 = 0.95;

/// Longest line, in bytes, that the survey of the text reads.
const MAX_LINE: usize = 1 << 16;

/// Places in the text sampled to find the middle of the points.
const PLACES: usize = 1024;

/// Heights that models write where there is none.
const NO_HEIGHTS: [f64; 4] = [-9999.0, -99999.0, -32767.0, -32768.0];

/// Reads the rows from byte `start` on.
pub(super) fn read(job: &Job<'_>, layout: &Layout, start: usize, promised: Option<usize>) -> Result<PointCloud, Error> {
    let text = job.bytes;
    let Survey { origin, crs, row_len } = survey(job, layout, start);
    job.check_memory((text.len() - start) / row_len, layout.bytes_per_point(job.options.exact))?;
    let parser = Parser { layout, origin, exact: job.options.exact, counts_between: promised.is_some() };
    let mut all = Columns::new(layout);
    let mut counts_between = 0_usize;
    let mut without = Without::default();
    let mut at = start;
    'text: while at < text.len() {
        job.tick(PARSING * (at - start) as f32 / (text.len() - start) as f32)?;
        let mut cuts = vec![at];
        while at < text.len() && cuts.len() <= BATCH {
            at = text::after_line_end(text, at.saturating_add(PIECE).min(text.len()));
            cuts.push(at);
        }
        let pieces: Vec<Piece> = cuts.par_windows(2).map(|cut| parser.piece(&text[cut[0]..cut[1]], cut[0])).collect();
        job.preview(|| {
            let mut chunk = Columns::new(layout);
            pieces.iter().try_for_each(|piece| chunk.append(&piece.columns))?;
            chunk.into_cloud(&Job { progress: &(), ..*job }, layout, origin, false)
        })?;
        for piece in pieces {
            all.append(&piece.columns)?;
            counts_between = counts_between.saturating_add(piece.counts);
            without.add(piece.without);
            if let Some((offset, what)) = piece.error {
                let Some(lines) = words_at_end(text, offset) else {
                    return Err(job.malformed(job.line(offset), what));
                };
                let lines = if lines == 1 { "a line".into() } else { format!("{lines} lines") };
                job.note(format!("{lines} of words from {} on, after the points; skipped", job.line(offset)));
                break 'text;
            }
        }
    }
    without.check(job, all.positions.len())?;
    check_promise(job, all.positions.len(), promised, counts_between)?;
    job.tick(PARSING)?;
    let mut cloud = all.into_cloud(job, layout, origin, job.options.exact)?.with_crs(crs);
    drop_no_heights(job, &mut cloud);
    Ok(cloud)
}

/// Drops points whose height stands for none, which is told by the heights of the others: they span less than they are
/// away from it.
fn drop_no_heights(job: &Job<'_>, cloud: &mut PointCloud) {
    let up = cloud.origin().z;
    let height = |point: &[f32; 3]| f64::from(point[2]) + up;
    // Such a height is the lowest of all, which is soon found out.
    let lowest = |points: &[[f32; 3]]| points.iter().fold(f32::INFINITY, |low, point| low.min(point[2]));
    let lowest = cloud.positions().par_chunks(PIECE).map(lowest).reduce(|| f32::INFINITY, f32::min);
    if !NO_HEIGHTS.contains(&(f64::from(lowest) + up)) {
        return;
    }
    let none = [(f64::INFINITY, f64::NEG_INFINITY); 2];
    // The range of the heights that stand for none, and that of the others.
    let add = |mut ranges: [(f64, f64); 2], point: &[f32; 3]| {
        let height = height(point);
        let (low, high) = &mut ranges[usize::from(!NO_HEIGHTS.contains(&height))];
        (*low, *high) = (low.min(height), high.max(height));
        ranges
    };
    let join = |a: [(f64, f64); 2], b: [(f64, f64); 2]| [0, 1].map(|i| (a[i].0.min(b[i].0), a[i].1.max(b[i].1)));
    let [marks, others] = cloud.positions().par_iter().fold(|| none, add).reduce(|| none, join);
    if marks.0 > marks.1 || others.0 > others.1 || !(others.0 - marks.1 > others.1 - others.0) {
        return;
    }
    let keep: Vec<bool> = cloud.positions().par_iter().map(|point| !NO_HEIGHTS.contains(&height(point))).collect();
    let (before, value) = (keep.len(), marks.0);
    cloud.retain(|i| keep[i]);
    let count = before - cloud.len();
    job.note(format!("{count} of {before} points have the height {value}, which stands for none; left out"));
}

/// Rows without coordinates.
#[derive(Default)]
struct Without {
    count: usize,
    /// How many of them hold no value at all.
    empty: usize,
    /// The first: its first byte, and what is missing.
    first: Option<(usize, String)>,
}

impl Without {
    fn add(&mut self, other: Self) {
        self.count += other.count;
        self.empty += other.empty;
        self.first = self.first.take().or(other.first);
    }

    /// Tells of them. A text in which most rows are so has other columns than was thought.
    fn check(self, job: &Job<'_>, points: usize) -> Result<(), Error> {
        let Some((at, what)) = self.first else { return Ok(()) };
        let (count, rows) = (self.count, self.count + points);
        if self.count - self.empty >= points {
            let what = format!("{what}, as in {count} of {rows} rows; name the columns with --columns");
            return Err(job.malformed(job.line(at), what));
        }
        job.note(format!("{count} of {rows} rows have no coordinates; skipped, the first in {}", job.line(at)));
        Ok(())
    }
}

/// Number of the lines from byte `at` to the end, if all are words and few.
fn words_at_end(text: &[u8], at: usize) -> Option<usize> {
    let rest = &text[at..];
    if rest.len() > MAX_LINE {
        return None;
    }
    let lines = rest.split(|&byte| byte == b'\n').map(text::trim).filter(|line| !text::is_blank(line));
    let lines: Vec<&[u8]> = lines.collect();
    lines.iter().all(|line| is_words(line)).then_some(lines.len())
}

/// Compares the number of rows with the stated counts.
fn check_promise(job: &Job<'_>, rows: usize, first: Option<usize>, between: usize) -> Result<(), Error> {
    let Some(first) = first else { return Ok(()) };
    if rows < first {
        return Err(job.malformed(
            job.line(job.bytes.len()),
            format!("the file ends after {rows} of {first} points; it is cut off, copy it again"),
        ));
    }
    let all = first.saturating_add(between);
    if rows < all {
        job.note(format!("the counts of points add up to {all}, but there are {rows}; the file may be cut off"));
    }
    Ok(())
}

/// What rows sampled all over the text tell.
struct Survey {
    /// An origin for the points.
    origin: DVec3,
    crs: Crs,
    /// Mean length of a row in bytes.
    row_len: usize,
}

fn survey(job: &Job<'_>, layout: &Layout, start: usize) -> Survey {
    let text = job.bytes;
    let mut points = Vec::new();
    let (mut last, mut bytes) = (None, 0);
    for place in 0..PLACES {
        let offset = start + ((text.len() - start) as u128 * place as u128 / PLACES as u128) as usize;
        // The search for a line end is bounded, because a line may be as long as the file.
        let line_end = |at: usize| {
            let window = &text[at..text.len().min(at + MAX_LINE)];
            let end = window.iter().position(|&byte| byte == b'\n').map(|len| at + len);
            end.or((window.len() < MAX_LINE).then_some(text.len()))
        };
        let at = if place == 0 { Some(start) } else { line_end(offset).map(|end| (end + 1).min(text.len())) };
        let Some((at, end)) = at.and_then(|at| Some((at, line_end(at)?))) else { continue };
        if last == Some(at) {
            continue;
        }
        last = Some(at);
        let mut point = [f64::NAN; 3];
        for (cell, target) in layout.dialect.cells(&text[at..end]).zip(&layout.targets) {
            if let Target::Axis(axis) = *target {
                point[axis] = layout.dialect.number(cell).unwrap_or(f64::NAN);
            }
        }
        if point.iter().all(|value| value.is_finite()) {
            bytes += end + 1 - at;
            points.push(DVec3::from(point));
        }
    }
    let mut crs = layout.crs.clone();
    if crs == Crs::default() && job.options.columns.is_none() && look_like_degrees(points.len(), |i| points[i]) {
        crs.unit = Some(Unit::Degree);
        job.note(LOOKS_LIKE_DEGREES);
    }
    let origin = if crs.unit == Some(Unit::Degree) {
        degree_origin(points.len(), |i| points[i])
    } else {
        storage_origin(points.len(), |i| points[i])
    };
    // The shortest row has three digits, each followed by a byte.
    Survey { origin, crs, row_len: bytes.checked_div(points.len()).unwrap_or(0).max(6) }
}

impl Layout {
    fn bytes_per_point(&self, exact: bool) -> usize {
        let fields: usize = self.fields.iter().map(|(_, wide)| if *wide { 8 } else { 4 }).sum();
        12 + if exact { 12 } else { 0 } + if self.has_color { 3 } else { 0 } + fields
    }
}

/// The values of a piece of text, or of all of it.
struct Columns {
    positions: Vec<[f32; 3]>,
    residuals: Vec<[f32; 3]>,
    colors: Colors,
    fields: Vec<Values>,
}

/// Colours in the narrowest type that holds all values so far.
enum Colors {
    /// Whole numbers of 0 to 255.
    Bytes(Vec<[u8; 3]>),
    Floats(Vec<[f32; 3]>),
}

/// Values of a field. Text does not state how wide its numbers are.
enum Values {
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl Columns {
    fn new(layout: &Layout) -> Self {
        let values = |(_, wide): &(String, bool)| if *wide { Values::F64(Vec::new()) } else { Values::F32(Vec::new()) };
        Self {
            positions: Vec::new(),
            residuals: Vec::new(),
            colors: Colors::Bytes(Vec::new()),
            fields: layout.fields.iter().map(values).collect(),
        }
    }

    fn append(&mut self, other: &Self) -> Result<(), Error> {
        append(&mut self.positions, &other.positions, "positions")?;
        append(&mut self.residuals, &other.residuals, "residuals")?;
        match (&mut self.colors, &other.colors) {
            (Colors::Bytes(all), Colors::Bytes(more)) => append(all, more, "colours")?,
            (Colors::Floats(all), Colors::Floats(more)) => append(all, more, "colours")?,
            (Colors::Floats(all), Colors::Bytes(more)) => append(all, &floats(more)?, "colours")?,
            (Colors::Bytes(all), Colors::Floats(more)) => {
                let mut widened = floats(all)?;
                append(&mut widened, more, "colours")?;
                self.colors = Colors::Floats(widened);
            }
        }
        for (all, more) in self.fields.iter_mut().zip(&other.fields) {
            match (all, more) {
                (Values::F32(all), Values::F32(more)) => append(all, more, "a field")?,
                (Values::F64(all), Values::F64(more)) => append(all, more, "a field")?,
                _ => unreachable!("both are made from one layout"),
            }
        }
        Ok(())
    }

    fn into_cloud(self, job: &Job<'_>, layout: &Layout, origin: DVec3, exact: bool) -> Result<PointCloud, Error> {
        let mut positions = self.positions;
        positions.shrink_to_fit();
        let mut cloud = PointCloud::new(origin, positions);
        if self.residuals.par_iter().any(|residual| *residual != [0.0; 3]) {
            cloud = cloud.with_residuals(self.residuals)?;
        }
        if layout.has_color {
            cloud = with_colors(job, cloud, self.colors, exact)?;
        }
        for ((name, _), values) in layout.fields.iter().zip(self.fields) {
            let values = match values {
                Values::F32(mut values) => {
                    values.shrink_to_fit();
                    FieldValues::F32(values)
                }
                Values::F64(values) => FieldValues::F64(values),
            };
            cloud = cloud.with_field(name, values)?;
        }
        Ok(cloud)
    }
}

fn append<T: Copy>(all: &mut Vec<T>, more: &[T], what: &str) -> Result<(), Error> {
    reserve(all, more.len(), what)?;
    all.extend_from_slice(more);
    Ok(())
}

fn floats(bytes: &[[u8; 3]]) -> Result<Vec<[f32; 3]>, Error> {
    let mut floats = Vec::new();
    reserve(&mut floats, bytes.len(), "colours")?;
    floats.extend(bytes.iter().map(|color| color.map(f32::from)));
    Ok(floats)
}

fn with_colors(job: &Job<'_>, cloud: PointCloud, colors: Colors, exact: bool) -> Result<PointCloud, Error> {
    let floats = match colors {
        // If no value exceeds 1, the colours are rather floats that happen to be 0 or 1.
        Colors::Bytes(bytes) if bytes.par_iter().flatten().any(|&value| value > 1) => return cloud.with_colors(bytes),
        Colors::Bytes(bytes) => floats(&bytes)?,
        Colors::Floats(floats) => floats,
    };
    let scale = ColorScale::of(floats.len(), true, |i| floats[i].map(f64::from));
    scale.note().iter().for_each(|note| job.note(note));
    let mut bytes = Vec::new();
    reserve(&mut bytes, floats.len(), "colours")?;
    bytes.par_extend(floats.par_iter().map(|color| color.map(|value| scale.byte(value.into()))));
    let mut cloud = cloud.with_colors(bytes)?;
    if exact && !floats.par_iter().flatten().all(|&value| scale.keeps(value.into())) {
        let whole = floats.par_iter().flatten().all(|value| (0.0..=65535.0).contains(value) && value.fract() == 0.0);
        for (channel, name) in ["Red", "Green", "Blue"].into_iter().enumerate() {
            let values = floats.iter().map(|color| color[channel]);
            cloud = cloud.with_field(
                name,
                if whole {
                    FieldValues::U16(values.map(|value| value as u16).collect())
                } else {
                    FieldValues::F32(values.collect())
                },
            )?;
        }
    }
    Ok(cloud)
}

/// Result of parsing one piece of text.
struct Piece {
    columns: Columns,
    /// Sum of the counts between rows.
    counts: usize,
    without: Without,
    error: Option<(usize, String)>,
}

struct Parser<'a> {
    layout: &'a Layout,
    origin: DVec3,
    exact: bool,
    /// Whether lines of a single integer are counts, not rows.
    counts_between: bool,
}

impl Parser<'_> {
    fn piece(&self, text: &[u8], start: usize) -> Piece {
        let columns = Columns::new(self.layout);
        let mut piece = Piece { columns, counts: 0, without: Without::default(), error: None };
        let mut fields = vec![0.0; self.layout.fields.len()];
        let mut at = 0;
        while at < text.len() {
            let end = text::line_end(text, at);
            let line = trimmed(&text[at..end]);
            if self.counts_between && is_count(line) {
                let count = std::str::from_utf8(line.trim_ascii()).ok().and_then(|line| line.parse().ok());
                piece.counts = piece.counts.saturating_add(count.unwrap_or(usize::MAX));
            } else if !(line.is_empty() || matches!(line[0], b'#' | b'/' | b' ' | b'\t') && is_comment(line)) {
                match self.row(line, &mut piece.columns, &mut fields) {
                    Ok(()) => {}
                    Err(Odd::Without(what)) => {
                        let empty = self.layout.dialect.cells(line).all(<[u8]>::is_empty);
                        let first = Some((start + at, what));
                        piece.without.add(Without { count: 1, empty: usize::from(empty), first });
                    }
                    Err(Odd::Broken(what)) => {
                        piece.error = Some((start + at, what));
                        break;
                    }
                }
            }
            at = end + 1;
        }
        piece
    }

    fn row(&self, line: &[u8], columns: &mut Columns, fields: &mut [f64]) -> Result<(), Odd> {
        let Layout { dialect, targets, open, .. } = self.layout;
        let mut cells = dialect.cells(text::without_mark(line));
        let (mut world, mut color) = (DVec3::ZERO, [0.0; 3]);
        let mut missing = None;
        for (index, target) in targets.iter().enumerate() {
            let cell = cells.next().ok_or_else(|| {
                let count = targets.len();
                Odd::Broken(format!("{index} values where a point has {count}; complete or remove the line"))
            })?;
            // Numbers are tried first, because values are hardly ever missing.
            let value = || match dialect.number(cell) {
                Err(_) if is_missing(cell) => Ok(f64::NAN),
                value => value.map_err(Odd::Broken),
            };
            match *target {
                Target::Skip => {}
                Target::Axis(axis) => match dialect.number(cell) {
                    Ok(number) => world[axis] = number,
                    Err(_) if is_missing(cell) => missing = missing.or(Some(axis)),
                    Err(what) => return Err(Odd::Broken(what)),
                },
                Target::Channel(channel) => color[channel] = value()?,
                Target::Field(field) => fields[field] = value()?,
            }
        }
        if !open && let Some(more) = cells.next() {
            let trailing = dialect.separator != Separator::Any && more.is_empty() && cells.next().is_none();
            if !trailing {
                let count = targets.len();
                return Err(Odd::Broken(format!(
                    "more values than the {count} a point has, from '{}' on; '...' at the end of --columns leaves them out",
                    excerpt(more)
                )));
            }
        }
        if let Some(axis) = missing {
            return Err(Odd::Without(format!("{} is missing", ["x", "y", "z"][axis])));
        }
        columns.positions.push((world - self.origin).as_vec3().to_array());
        if self.exact {
            columns.residuals.push(residual(world - self.origin));
        }
        if self.layout.has_color {
            columns.colors.push(color);
        }
        for (values, &value) in columns.fields.iter_mut().zip(fields.iter()) {
            match values {
                Values::F32(values) => values.push(value as f32),
                Values::F64(values) => values.push(value),
            }
        }
        Ok(())
    }
}

/// Why a row is no point.
enum Odd {
    /// A coordinate is missing.
    Without(String),
    /// The row is not of the layout.
    Broken(String),
}

impl Colors {
    fn push(&mut self, color: [f64; 3]) {
        let bytes = color.map(|value| value as u8);
        match self {
            Self::Bytes(all) if bytes.map(f64::from) == color => all.push(bytes),
            Self::Bytes(all) => {
                let mut floats: Vec<[f32; 3]> = all.iter().map(|color| color.map(f32::from)).collect();
                floats.push(color.map(|value| value as f32));
                *self = Self::Floats(floats);
            }
            Self::Floats(all) => all.push(color.map(|value| value as f32)),
        }
    }
}
