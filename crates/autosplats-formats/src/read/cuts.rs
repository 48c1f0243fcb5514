//! Text in pieces that end at line ends.

use autosplats_cloud::Error;

use super::{Job, opened::Reader};

/// Bytes of text that one thread parses at a time.
pub(super) const PIECE: usize = 1 << 19;

/// Longest line of a text that is not in memory, in bytes.
const MAX_LINE: usize = 1 << 26;

/// Bytes read at a time where a line end is searched for, or line ends are counted.
const STEP: usize = 1 << 16;

/// A text: in memory, or in a file.
#[derive(Clone, Copy)]
pub(super) enum Text<'a> {
    Held(&'a [u8]),
    /// The first bytes of a file, this many.
    File(&'a Reader<'a>, usize),
}

/// Consecutive pieces of a text, each of which ends at a line end.
pub(super) struct Batch<'a> {
    bytes: &'a [u8],
    /// The first byte's place in the text.
    start: usize,
    /// Starts of the pieces among the bytes, and the end of the last.
    pub(super) cuts: Vec<usize>,
}

impl Text<'_> {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Held(text) => text.len(),
            Self::File(_, len) => *len,
        }
    }

    /// The next pieces from byte `at` on, at most `count`; there must be a byte. `space` is used if the text is not in
    /// memory.
    pub(super) fn batch<'b>(
        &'b self,
        job: &Job<'_>,
        at: usize,
        count: usize,
        space: &'b mut Vec<u8>,
    ) -> Result<Batch<'b>, Error> {
        let piece = if let Self::File(file, _) = self { PIECE.min(file.piece()) } else { PIECE };
        let count = if let Self::File(file, _) = self { count.min(file.piece() / piece) } else { count };
        let (bytes, whole) = match self {
            Self::Held(text) => (&text[at..], true),
            Self::File(file, len) => {
                space.clear();
                file.read(at..(*len).min(at + count * piece + STEP), space)?;
                while at + space.len() < *len && !space[piece..].contains(&b'\n') {
                    if space.len() > MAX_LINE {
                        let place = self.line(at)?;
                        return Err(job.malformed(place, format!("there is a line of more than {MAX_LINE} bytes")));
                    }
                    let from = at + space.len();
                    file.read(from..(*len).min(from + space.len()), space)?;
                }
                (&space[..], at + space.len() == *len)
            }
        };
        let mut cuts = vec![0];
        let mut last = 0;
        while last < bytes.len() && cuts.len() <= count {
            let cut = after_line_end(bytes, last.saturating_add(piece).min(bytes.len()));
            if cut == bytes.len() && !(whole || bytes.ends_with(b"\n")) {
                break;
            }
            cuts.push(cut);
            last = cut;
        }
        Ok(Batch { bytes, start: at, cuts })
    }

    /// Bytes from `at` on, at most `most`.
    pub(super) fn bytes(&self, at: usize, most: usize) -> Result<Vec<u8>, Error> {
        let end = self.len().min(at.saturating_add(most));
        Ok(match self {
            Self::Held(text) => text[at..end].to_vec(),
            Self::File(file, _) => {
                let mut bytes = Vec::new();
                file.read(at..end, &mut bytes)?;
                bytes
            }
        })
    }

    /// Whether a byte is in the last line.
    pub(super) fn is_in_last_line(&self, at: usize) -> Result<bool, Error> {
        let mut at = at;
        while at < self.len() {
            let bytes = self.bytes(at, STEP)?;
            if bytes.contains(&b'\n') {
                return Ok(false);
            }
            at += bytes.len();
        }
        Ok(true)
    }

    /// The line that contains a byte, as the place of an error.
    pub(super) fn line(&self, offset: usize) -> Result<String, Error> {
        let (mut at, end, mut lines) = (0, offset.min(self.len()), 1);
        while at < end {
            let bytes = self.bytes(at, STEP.min(end - at))?;
            lines += bytes.iter().filter(|&&byte| byte == b'\n').count();
            at += bytes.len();
        }
        Ok(format!("line {lines}"))
    }
}

impl<'a> Batch<'a> {
    /// The text of a piece, and its first byte's place in the text.
    pub(super) fn piece(&self, cut: &[usize]) -> (&'a [u8], usize) {
        (&self.bytes[cut[0]..cut[1]], self.start + cut[0])
    }

    /// The place after the last piece.
    pub(super) fn end(&self) -> usize {
        self.start + self.cuts.last().copied().unwrap_or_default()
    }
}

/// The end of the line that contains byte `at`, without its line feed.
pub(super) fn line_end(text: &[u8], at: usize) -> usize {
    text[at..].iter().position(|&byte| byte == b'\n').map_or(text.len(), |len| at + len)
}

/// The start of the line after the one that contains byte `at`.
pub(super) fn after_line_end(text: &[u8], at: usize) -> usize {
    (line_end(text, at) + 1).min(text.len())
}
