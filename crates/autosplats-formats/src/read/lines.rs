//! Text cut into pieces at line ends, for parallel parsing.

use std::ops::Range;

use autosplats_cloud::Error;
use rayon::prelude::*;

use super::{Job, table::ProgressRange, text};

/// Bytes of text that one thread parses at a time. The number of threads does not change where the cuts are.
const PIECE: usize = 1 << 19;

/// Parses the text in `range` piece by piece in parallel, and passes the results to `take` in order. Lines joined by
/// backslashes stay in one piece.
pub(super) fn in_pieces<T: Send>(
    job: &Job<'_>,
    range: Range<usize>,
    part: ProgressRange,
    parse: impl Fn(Range<usize>) -> T + Sync + Send,
    mut take: impl FnMut(T) -> Result<(), Error>,
) -> Result<(), Error> {
    let text = &job.bytes[..range.end];
    let mut at = range.start;
    while at < range.end {
        job.tick(part.start + part.len * (at - range.start) as f32 / range.len() as f32)?;
        let mut cuts = vec![at];
        while at < range.end && cuts.len() <= 4 * rayon::current_num_threads() {
            at = text::after_line_end(text, at.saturating_add(PIECE).min(text.len()));
            while at < range.end && is_continued(&text[..at]) {
                at = text::after_line_end(text, at);
            }
            cuts.push(at);
        }
        let pieces: Vec<T> = cuts.par_windows(2).map(|cut| parse(cut[0]..cut[1])).collect();
        pieces.into_iter().try_for_each(&mut take)?;
    }
    Ok(())
}

/// Whether a text ends in a line that a backslash joins with the next line.
fn is_continued(text: &[u8]) -> bool {
    let line = text.strip_suffix(b"\n").unwrap_or(text);
    line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\")
}

/// The trimmed lines of a piece, except blank lines and comments, each with the byte at which it starts.
pub(super) fn lines<'a>(text: &'a [u8], range: &Range<usize>) -> impl Iterator<Item = (usize, &'a [u8])> {
    let (mut at, end) = (range.start, range.end);
    std::iter::from_fn(move || {
        while at < end {
            let start = at;
            let line_end = text::line_end(&text[..end], at);
            at = line_end + 1;
            let line = text::trim(&text[start..line_end]);
            if !text::is_blank(line) {
                return Some((start, line));
            }
        }
        None
    })
}

/// The start of the line after `lines` lines, blank lines and comments not counted; `None` if the file ends before.
pub(super) fn skip_lines(job: &Job<'_>, mut at: usize, lines: usize) -> Result<Option<usize>, Error> {
    let mut skipped = 0;
    while skipped < lines {
        if skipped % (1 << 16) == 0 {
            job.tick(0.0)?;
        }
        if at >= job.bytes.len() {
            return Ok(None);
        }
        let end = text::line_end(job.bytes, at);
        skipped += usize::from(!text::is_blank(job.bytes[at..end].trim_ascii()));
        at = text::after_line_end(job.bytes, at);
    }
    Ok(Some(at))
}
