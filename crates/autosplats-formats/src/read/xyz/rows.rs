//! Rows of numbers to columns, in parallel.
//!
//! The text is cut into pieces at line ends. The pieces are parsed in parallel, each into columns of its own.

use autosplats_cloud::{Error, excerpt, residual};
use glam::DVec3;
use rayon::prelude::*;

use super::super::{Job, cuts::Text, table::ProgressRange, text};
use super::{
    cells::{Separator, is_comment, is_count, is_missing, trimmed},
    columns::{Columns, Values},
    layout::{Layout, Target},
    preamble::is_words,
    settle::{Look, Without},
};

/// Pieces parsed before their points are passed on.
const BATCH: usize = 16;

/// Most bytes of words after the points.
const MAX_WORDS: usize = 1 << 16;

/// Points of one piece of text.
pub(super) struct Piece {
    pub(super) columns: Columns,
    pub(super) look: Look,
}

/// Number of the lines from byte `at` to the end, if all are words and few.
fn words_at_end(text: &Text<'_>, at: usize) -> Result<Option<usize>, Error> {
    if text.len() - at > MAX_WORDS {
        return Ok(None);
    }
    let rest = text.bytes(at, MAX_WORDS)?;
    let lines = rest.split(|&byte| byte == b'\n').map(text::trim).filter(|line| !text::is_blank(line));
    let lines: Vec<&[u8]> = lines.collect();
    Ok(lines.iter().all(|line| is_words(line)).then_some(lines.len()))
}

/// How rows become points.
pub(super) struct Parser<'a> {
    pub(super) layout: &'a Layout,
    pub(super) origin: DVec3,
    /// Whether all digits are kept.
    pub(super) exact: bool,
    /// Whether lines of a single integer are counts, not rows.
    pub(super) counts_between: bool,
}

impl Parser<'_> {
    /// Parses the rows from byte `start` of a text on, and passes the points on in order, some pieces at a time.
    /// Returns the end of the rows.
    pub(super) fn each(
        &self,
        job: &Job<'_>,
        text: Text<'_>,
        start: usize,
        part: ProgressRange,
        mut take: impl FnMut(Vec<Piece>) -> Result<(), Error>,
    ) -> Result<usize, Error> {
        let mut space = Vec::new();
        let mut at = start;
        while at < text.len() {
            job.tick(part.start + part.len * (at - start) as f32 / (text.len() - start) as f32)?;
            let batch = text.batch(job, at, BATCH, &mut space)?;
            let parse = |cut: &[usize]| {
                let (piece, start) = batch.piece(cut);
                self.piece(piece, start)
            };
            let mut pieces: Vec<(Piece, Option<(usize, String)>)> = batch.cuts.par_windows(2).map(parse).collect();
            at = batch.end();
            let broken = pieces.iter().position(|(_, error)| error.is_some());
            pieces.truncate(broken.map_or(pieces.len(), |index| index + 1));
            let error = pieces.last_mut().and_then(|(_, error)| error.take());
            take(pieces.into_iter().map(|(piece, _)| piece).collect())?;
            if let Some((offset, what)) = error {
                let Some(lines) = words_at_end(&text, offset)? else {
                    return Err(job.malformed(text.line(offset)?, what));
                };
                let lines = if lines == 1 { "a line".into() } else { format!("{lines} lines") };
                job.note(format!("{lines} of words from {} on, after the points; skipped", text.line(offset)?));
                return Ok(offset);
            }
        }
        Ok(at)
    }

    /// Parses a piece. Returns the place and the reason of what ends it early, too.
    fn piece(&self, text: &[u8], start: usize) -> (Piece, Option<(usize, String)>) {
        let mut columns = Columns::new(self.layout);
        let (mut counts, mut without, mut error) = (0_usize, Without::default(), None);
        let mut fields = vec![0.0; self.layout.fields.len()];
        let mut at = 0;
        while at < text.len() {
            let end = text::line_end(text, at);
            let line = trimmed(&text[at..end]);
            if self.counts_between && is_count(line) {
                let count = std::str::from_utf8(line.trim_ascii()).ok().and_then(|line| line.parse().ok());
                counts = counts.saturating_add(count.unwrap_or(usize::MAX));
            } else if !(line.is_empty() || matches!(line[0], b'#' | b'/' | b' ' | b'\t') && is_comment(line)) {
                match self.row(line, &mut columns, &mut fields) {
                    Ok(()) => {}
                    Err(Odd::Without(what)) => {
                        let empty = self.layout.dialect.cells(line).all(<[u8]>::is_empty);
                        let first = Some((start + at, what));
                        without.add(Without { count: 1, empty: usize::from(empty), first });
                    }
                    Err(Odd::Broken(what)) => {
                        error = Some((start + at, what));
                        break;
                    }
                }
            }
            at = end + 1;
        }
        let mut look = Look::of(&columns, self.origin, self.exact);
        (look.counts, look.without) = (counts, without);
        (Piece { columns, look }, error)
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
