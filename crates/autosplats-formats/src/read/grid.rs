//! Heights on a grid, as Esri's ASCII files have them: a header of words and numbers, then a height per cell, from the
//! north-west corner eastward, row by row. Line ends mean nothing.

use std::ops::Range;

use autosplats_cloud::{Axes, Contents, Error, excerpt};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    Attribute, Description, Format, Job,
    placed::place,
    table::{ProgressRange, reserve},
    text,
};

pub(super) const FORMAT: Format = Format {
    name: "ESRI grid",
    extensions: &["grd"],
    recognised: |bytes| {
        let mut words = Words { bytes: &bytes[..bytes.len().min(1 << 10)], at: 0 };
        let first = words.next().and_then(|(_, word)| Key::of(word));
        first.is_some_and(|key| key != Key::NoData) && words.next().is_some_and(|(_, value)| number(value).is_ok())
    },
    sensor_frame: false,
    describe,
    read,
};

/// Value of cells without a height, unless the header states another.
const NO_DATA: f64 = -9999.0;

/// Bytes of text that one thread parses at a time.
const PIECE: usize = 1 << 19;

/// Pieces parsed before their values are put together.
const BATCH: usize = 16;

/// Fraction of the work that parsing takes.
const PARSING: f32 = 0.8;

/// A word of the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Key {
    Columns,
    Rows,
    /// Lower left corner along an axis: of the cell if `true`, otherwise its centre.
    Lower(usize, bool),
    /// Size of a cell along one axis, or along both.
    Size(Option<usize>),
    NoData,
}

impl Key {
    fn of(word: &[u8]) -> Option<Self> {
        let word = String::from_utf8_lossy(word).to_ascii_lowercase();
        Some(match word.trim_end_matches(':') {
            "ncols" => Self::Columns,
            "nrows" => Self::Rows,
            "xllcorner" => Self::Lower(0, true),
            "yllcorner" => Self::Lower(1, true),
            "xllcenter" | "xllcentre" => Self::Lower(0, false),
            "yllcenter" | "yllcentre" => Self::Lower(1, false),
            "cellsize" => Self::Size(None),
            "dx" | "xdim" | "xcellsize" => Self::Size(Some(0)),
            "dy" | "ydim" | "ycellsize" => Self::Size(Some(1)),
            "nodata_value" | "nodata" | "nodatavalue" | "no_data" => Self::NoData,
            _ => return None,
        })
    }
}

/// The words of a text, each with its first byte.
struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Iterator for Words<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let rest = &self.bytes[self.at..];
        let start = self.at + rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let rest = &self.bytes[start..];
        self.at = start + rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        Some((start, &self.bytes[start..self.at]))
    }
}

/// A number, perhaps with a decimal comma.
fn number(value: &[u8]) -> Result<f64, String> {
    text::number(value).or_else(|what| {
        let points: Vec<u8> = value.iter().map(|&byte| if byte == b',' { b'.' } else { byte }).collect();
        text::number(&points).map_err(|_| what)
    })
}

struct Header {
    columns: usize,
    rows: usize,
    /// Centre of the cell in the south-west.
    lower: DVec2,
    size: DVec2,
    no_data: f64,
    /// First byte of the heights.
    start: usize,
}

impl Header {
    fn parse(job: &Job<'_>) -> Result<Self, Error> {
        let mut words = Words { bytes: job.bytes, at: 0 };
        let (mut counts, mut lower, mut size, mut no_data) = ([None; 2], [None; 2], [None; 2], NO_DATA);
        let start = loop {
            let before = words.at;
            let Some((at, word)) = words.next() else { break before };
            if number(word).is_ok() {
                break at;
            }
            let fail = |what: String| job.malformed(job.line(at), what);
            let shown = excerpt(word);
            let key = Key::of(word).ok_or_else(|| fail(format!("'{shown}' is no word of the header of a grid")))?;
            let (_, value) = words.next().ok_or_else(|| fail(format!("the file ends after '{shown}'")))?;
            let number = number(value).map_err(fail)?;
            let whole = || {
                let count = Some(number as usize).filter(|&count| count as f64 == number && count > 0);
                count.ok_or_else(|| fail(format!("{shown} is {}; it has to be a count", excerpt(value))))
            };
            match key {
                Key::Columns => counts[0] = Some(whole()?),
                Key::Rows => counts[1] = Some(whole()?),
                Key::NoData => no_data = number,
                _ if !number.is_finite() => return Err(fail(format!("{shown} is not finite"))),
                Key::Lower(axis, corner) => lower[axis] = Some((number, corner)),
                Key::Size(axis) => {
                    if number <= 0.0 {
                        return Err(fail(format!("{shown} is {}; cells have a size above 0", excerpt(value))));
                    }
                    for (other, size) in size.iter_mut().enumerate() {
                        if axis.is_none_or(|axis| axis == other) {
                            *size = Some(number);
                        }
                    }
                }
            }
        };
        let missing = |what: &str| job.malformed(job.line(start), format!("the header of the grid has no {what}"));
        let [columns, rows] = [counts[0].ok_or_else(|| missing("ncols"))?, counts[1].ok_or_else(|| missing("nrows"))?];
        let size = DVec2::new(
            size[0].ok_or_else(|| missing("cellsize, nor dx and dy"))?,
            size[1].ok_or_else(|| missing("cellsize, nor dx and dy"))?,
        );
        let [x, y] = [
            lower[0].ok_or_else(|| missing("xllcorner, nor xllcenter"))?,
            lower[1].ok_or_else(|| missing("yllcorner, nor yllcenter"))?,
        ];
        let centre = |(value, corner): (f64, bool), size: f64| if corner { value + 0.5 * size } else { value };
        let lower = DVec2::new(centre(x, size.x), centre(y, size.y));
        // The shortest height is a digit and a blank.
        let left = job.bytes.len() - start;
        if columns.checked_mul(rows).is_none_or(|count| count > left.div_ceil(2)) {
            let cells = columns as u128 * rows as u128;
            let what = format!("{cells} cells cannot be in the {left} bytes that are left; copy the file again");
            return Err(job.malformed(job.line(start), what));
        }
        Ok(Self { columns, rows, lower, size, no_data, start })
    }

    fn count(&self) -> usize {
        self.columns * self.rows
    }

    fn world(&self, cell: usize, height: f64) -> DVec3 {
        let (column, row) = (cell % self.columns, self.rows - 1 - cell / self.columns);
        (self.lower + DVec2::new(column as f64, row as f64) * self.size).extend(height)
    }

    /// Whether a value stands for no height. Programs print the same float with more or fewer digits.
    fn is_no_data(&self, value: f64) -> bool {
        value.is_nan() || value as f32 == self.no_data as f32
    }
}

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let header = Header::parse(job)?;
    let size = if header.size.x == header.size.y {
        header.size.x.to_string()
    } else {
        format!("{} × {}", header.size.x, header.size.y)
    };
    Ok(Description {
        format: "ESRI grid, text".into(),
        points: Some(header.count() as u64),
        attributes: vec![Attribute::new("z", text::TEXT)],
        details: vec![
            ("grid".into(), format!("{} columns, {} rows", header.columns, header.rows)),
            ("size of a cell".into(), size),
        ],
        ..Description::default()
    })
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    let header = Header::parse(job)?;
    job.check_memory(header.count(), 8 + 8 + 12)?;
    let heights = heights(job, &header)?;
    let keep: Vec<usize> = (0..heights.len()).into_par_iter().filter(|&i| !header.is_no_data(heights[i])).collect();
    if keep.len() < heights.len() {
        job.note(format!("{} of {} cells have no data; left out", heights.len() - keep.len(), heights.len()));
    }
    let part = ProgressRange { start: PARSING, len: 1.0 - PARSING };
    let cloud = place(job, &[keep.len()], part, |_| |i: usize| header.world(keep[i], heights[keep[i]]))?;
    Ok(cloud.with_axes(Axes::ZUp).into())
}

/// All heights, parsed in parallel.
fn heights(job: &Job<'_>, header: &Header) -> Result<Vec<f64>, Error> {
    let text = job.bytes;
    let mut all = Vec::new();
    reserve(&mut all, header.count(), "the heights of a grid")?;
    let mut at = header.start;
    while at < text.len() {
        job.tick(PARSING * (at - header.start) as f32 / (text.len() - header.start) as f32)?;
        let mut cuts = vec![at];
        while at < text.len() && cuts.len() <= BATCH {
            let from = at.saturating_add(PIECE).min(text.len());
            at = text[from..].iter().position(u8::is_ascii_whitespace).map_or(text.len(), |len| from + len);
            cuts.push(at);
        }
        let parse = |range: Range<usize>| -> Result<Vec<f64>, (usize, String)> {
            let words = Words { bytes: &text[..range.end], at: range.start };
            words.map(|(at, word)| number(word).map_err(|what| (at, what))).collect()
        };
        let pieces: Vec<_> = cuts.par_windows(2).map(|cut| parse(cut[0]..cut[1])).collect();
        for piece in pieces {
            let piece = piece.map_err(|(at, what)| job.malformed(job.line(at), what))?;
            if piece.len() > header.count() - all.len() {
                let (columns, rows) = (header.columns, header.rows);
                let what =
                    format!("more heights than the {columns} × {rows} that the header states; correct the header");
                return Err(job.malformed(job.line(at), what));
            }
            all.extend(piece);
        }
    }
    if all.len() < header.count() {
        let what =
            format!("the file ends after {} of {} heights; it is cut off, copy it again", all.len(), header.count());
        return Err(job.malformed(job.line(text.len()), what));
    }
    Ok(all)
}
