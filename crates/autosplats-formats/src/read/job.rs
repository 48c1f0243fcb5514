//! What a format is, and what every reader gets.

use std::path::Path;

use autosplats_cloud::{Contents, Error, PointCloud, Progress, check_memory, one_line, tell_loss};

use super::{describe::Description, options::ReadOptions};

/// A file format: how to recognise and how to read it.
pub(super) struct Format {
    /// Name in messages and tables.
    pub(super) name: &'static str,
    /// Extensions of file names, in lower case and without the first dot.
    pub(super) extensions: &'static [&'static str],
    /// Whether the content starts as only this format does.
    pub(super) recognised: fn(&[u8]) -> bool,
    /// Whether coordinates are in the sensor's frame, so that even a single point at (0, 0, 0) is a missing return.
    pub(super) sensor_frame: bool,
    /// Reads the header.
    pub(super) describe: fn(&Job<'_>) -> Result<Description, Error>,
    /// Reads the points, and the triangles of a mesh if asked for.
    pub(super) read: fn(&Job<'_>) -> Result<Contents, Error>,
}

/// Longest header line, in bytes; a longer one means a broken file.
pub(super) const MAX_HEADER_LINE: usize = 1 << 16;

/// Input of every reader.
#[derive(Clone, Copy)]
pub(super) struct Job<'a> {
    pub(super) path: &'a Path,
    pub(super) progress: &'a dyn Progress,
    pub(super) bytes: &'a [u8],
    pub(super) options: &'a ReadOptions,
    /// Whether triangles shall be read.
    pub(super) triangles: bool,
}

impl Job<'_> {
    pub(super) fn tick(&self, fraction: f32) -> Result<(), Error> {
        self.progress.tick(fraction)
    }

    /// Reports a note to the user.
    pub(super) fn note(&self, note: impl AsRef<str>) {
        self.progress.note(&one_line(note.as_ref()));
    }

    /// Tells that the file ends after `held` of `claimed` points, if it does.
    ///
    /// # Errors
    /// [`Error::Malformed`] if it holds none of them, or if the options take only whole files.
    pub(super) fn tell_cut_off(&self, held: usize, claimed: usize, what: &str) -> Result<(), Error> {
        if held == 0 && claimed > 0 {
            let what = format!("the file ends before the first of {claimed} {what}; it is cut off, copy it again");
            return Err(self.malformed(format!("byte {}", self.bytes.len()), what));
        }
        if held < claimed {
            let lost = claimed - held;
            let end = format!("byte {}", self.bytes.len());
            self.loss(&end, format!("the file is cut off: {lost} of {claimed} {what} are lost; copy it again"))?;
        }
        Ok(())
    }

    /// Tells what is lost of a file that is cut off or damaged.
    ///
    /// # Errors
    /// [`Error::Malformed`] if the options take only whole files.
    pub(super) fn loss(&self, place: &str, loss: impl AsRef<str>) -> Result<(), Error> {
        tell_loss(self.path, place, loss.as_ref(), self.options.whole, self.progress)
    }

    /// Fails if the caller cancels; reports no progress.
    pub(super) fn go_on(&self) -> Result<(), Error> {
        if self.progress.cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// Passes points to the caller before reading ends, if the caller wants chunks.
    pub(super) fn preview(&self, points: impl FnOnce() -> Result<PointCloud, Error>) -> Result<(), Error> {
        if self.progress.wants_chunks() {
            self.go_on()?;
            let points = points()?;
            if !points.is_empty() {
                self.progress.chunk(points);
            }
        }
        Ok(())
    }

    /// Fails if `count` points of `bytes_per_point` bytes do not fit into memory, before anything is allocated.
    pub(super) fn check_memory(&self, count: usize, bytes_per_point: usize) -> Result<(), Error> {
        let bytes = (count as u64).saturating_mul(bytes_per_point as u64);
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        check_memory(&format!("the {count} points of {name}"), bytes)
    }

    pub(super) fn malformed(&self, place: impl Into<String>, what: impl AsRef<str>) -> Error {
        Error::malformed(self.path, place, what)
    }

    pub(super) fn unsupported(&self, what: impl AsRef<str>) -> Error {
        Error::unsupported(self.path, what)
    }

    /// The line that contains byte `offset`, as the place of an error.
    pub(super) fn line(&self, offset: usize) -> String {
        let newlines = self.bytes[..offset.min(self.bytes.len())].iter().filter(|&&byte| byte == b'\n').count();
        format!("line {}", newlines + 1)
    }

    /// Fails if binary data passed through a text conversion, which replaces every byte that is no UTF-8 by U+FFFD.
    /// Lengths and values are then wrong. Intact floats are hardly ever valid UTF-8, and never contain that character.
    pub(super) fn check_not_text_converted(&self, start: usize) -> Result<(), Error> {
        let sample = &self.bytes[start..self.bytes.len().min(start + (1 << 16))];
        let valid = match std::str::from_utf8(sample) {
            Ok(text) => Some(text),
            // The sample may end inside a character.
            Err(error) if error.error_len().is_none() => std::str::from_utf8(&sample[..error.valid_up_to()]).ok(),
            Err(_) => None,
        };
        if valid.is_some_and(|text| text.contains('\u{FFFD}')) {
            return Err(self.malformed(
                format!("byte {start}"),
                "the binary data was destroyed by a conversion to UTF-8 text; copy the original file as binary",
            ));
        }
        Ok(())
    }
}
