//! Text points: XYZ, PTS, CSV and their kin, which share columns of numbers and little else.
//!
//! The columns are named by a header line or comment, or else guessed from their number and the values of the first
//! rows: 3 are positions, 4 add an intensity, 6 a colour or a normal, 7 both intensity and colour, and so on.

use super::{
    Description, Format, Job, MAX_HEADER_LINE,
    table::{Column, MAX_COLUMNS, Part, Scalar, Table},
    text::{self, Rows, Token},
};
use crate::{Error, PointCloud};

pub(super) const FORMAT: Format = Format {
    name: "text",
    extensions: &["xyz", "txt", "csv", "pts", "asc"],
    recognised: |_| false,
    sensor_frame: false,
    describe,
    read: |job| Ok(read(job)?.into()),
};

/// Part of the work that parsing is.
const PARSING: Part = Part { start: 0.0, len: 0.8 };

/// Rows looked at to guess what the columns are.
const SAMPLE: usize = 1000;

/// What stands before the first point.
struct Preamble {
    names: Option<Vec<String>>,
    /// Points that a count line promises.
    promised: Option<usize>,
    /// First byte of the first row.
    start: usize,
}

fn describe(_job: &Job<'_>) -> Result<Description, Error> {
    Ok(Description { format: "text".into(), ..Description::default() })
}

fn read(job: &Job<'_>) -> Result<PointCloud, Error> {
    let bytes = job.bytes;
    if bytes.is_empty() {
        return Err(job.malformed("byte 0", "the file is empty; copy it again"));
    }
    if let Some(at) = bytes[..bytes.len().min(1 << 16)].iter().position(|&byte| byte == 0) {
        return Err(job.malformed(format!("byte {at}"), "this is no text of 8-bit characters; save it as UTF-8 text"));
    }
    let Preamble { names, promised, start } = preamble(job)?;
    let sample = sample(bytes, start);
    let Some(width) = sample.first().map(Vec::len) else {
        return match promised {
            Some(points) if points > 0 => {
                Err(job.malformed(job.line(start), format!("the file ends after 0 of {points} points; copy it again")))
            }
            _ => Ok(PointCloud::default()),
        };
    };
    if width < 3 {
        return Err(job.malformed(job.line(start), format!("{width} values; a point needs x, y and z")));
    }
    if width > MAX_COLUMNS {
        return Err(job.malformed(job.line(start), format!("more than {MAX_COLUMNS} values; are there no line ends?")));
    }
    let names = match names {
        Some(names) if names.len() == width => named(names),
        _ => guessed(&sample, width),
    };

    let mut columns = Vec::new();
    let mut tokens = Vec::new();
    let mut offset = 0;
    for name in names {
        // Text does not say how wide its numbers are. Only positions and times need more than 24 bits.
        let wide = ["x", "y", "z"].contains(&&*name.to_lowercase()) || name.to_lowercase().contains("time");
        let scalar = if wide { Scalar::F64 } else { Scalar::F32 };
        columns.push(Column { name, scalar, offset, stride: 0 });
        tokens.push(Token::Store(scalar));
        offset += scalar.size();
    }
    for column in &mut columns {
        column.stride = offset;
    }
    let rows = Rows { tokens: &tokens, count: None, counts_between: promised.is_some() };
    let (records, count) = rows.parse(job, start, PARSING)?;
    if let Some(promised) = promised.filter(|&promised| promised > count) {
        return Err(job.malformed(
            job.line(bytes.len()),
            format!("the file ends after {count} of {promised} points; it is cut off, copy it again"),
        ));
    }
    Table { bytes: &records, count, big_endian: false, columns, packed_rgb: false, done: PARSING.len }
        .into_cloud(job, "header")
}

fn preamble(job: &Job<'_>) -> Result<Preamble, Error> {
    let bytes = job.bytes;
    let mut at = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    let mut names = None;
    let mut promised = None;
    let mut header_seen = false;
    while at < bytes.len() {
        let line = bytes[at..text::line_end(bytes, at)].trim_ascii();
        if text::is_blank(line) {
            names = column_names(line).filter(|names| has_xyz(names)).or(names);
        } else if text::is_count(line) {
            promised = std::str::from_utf8(line).ok().and_then(|line| line.parse().ok());
            if promised.is_none() {
                return Err(job.malformed(job.line(at), "this count of points is beyond all bounds"));
            }
        } else if text::values(line).all(|value| text::number(value).is_ok()) {
            if decimal_commas(line) {
                return Err(job.unsupported("numbers with decimal commas; write them with points"));
            }
            break;
        } else if !header_seen && promised.is_none() {
            header_seen = true;
            names = column_names(line);
        } else {
            let what = text::values(line).find_map(|value| text::number(value).err()).unwrap_or_default();
            return Err(job.malformed(job.line(at), what));
        }
        at = text::after_line_end(bytes, at);
    }
    if at >= bytes.len() && header_seen && !names.as_deref().is_some_and(has_xyz) {
        return Err(job.malformed("line 1", "there are no points in this text: no line has x, y and z"));
    }
    Ok(Preamble { names, promised, start: at })
}

fn has_xyz(names: &[String]) -> bool {
    ["x", "y", "z"].iter().all(|axis| names.iter().any(|name| name.eq_ignore_ascii_case(axis)))
}

/// The names in a header line, which may be a comment. Names may hold blanks where something else separates them.
fn column_names(line: &[u8]) -> Option<Vec<String>> {
    if line.len() > MAX_HEADER_LINE {
        return None;
    }
    let line = String::from_utf8_lossy(line);
    let line = line.trim_start_matches(['#', '/', ' ']);
    let separator = [',', ';', '\t'].into_iter().find(|&separator| line.contains(separator));
    let clean = |name: &str| name.trim().trim_matches('"').trim().to_owned();
    let names: Vec<String> = match separator {
        Some(separator) => line.split(separator).map(clean).collect(),
        None => line.split_ascii_whitespace().map(clean).collect(),
    };
    (names.len() >= 3).then_some(names)
}

/// Whether commas stand inside the numbers: either something else separates these, or every number has one.
fn decimal_commas(line: &[u8]) -> bool {
    if line.contains(&b';') && line.contains(&b',') {
        return true;
    }
    let words: Vec<&[u8]> = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).collect();
    let inside = |word: &&[u8]| {
        word.iter().filter(|&&byte| byte == b',').count() == 1 && !word.starts_with(b",") && !word.ends_with(b",")
    };
    words.len() >= 3 && words.iter().all(inside)
}

/// The first rows, as far as they are as long as the first one.
fn sample(bytes: &[u8], start: usize) -> Vec<Vec<f64>> {
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let mut at = start;
    while at < bytes.len() && rows.len() < SAMPLE {
        let line = bytes[at..text::line_end(bytes, at)].trim_ascii();
        at = text::after_line_end(bytes, at);
        if text::is_blank(line) || text::is_count(line) {
            continue;
        }
        let Ok(row) = text::values(line).take(MAX_COLUMNS + 1).map(text::number).collect::<Result<Vec<f64>, _>>()
        else {
            break;
        };
        if rows.first().is_some_and(|first| first.len() != row.len()) {
            break;
        }
        rows.push(row);
    }
    rows
}

/// Names from a header. Without x, y and z among them (easting, northing, height) the first three are these.
fn named(mut names: Vec<String>) -> Vec<String> {
    if !has_xyz(&names) {
        for (name, axis) in names.iter_mut().zip(["x", "y", "z"]) {
            *name = axis.into();
        }
    }
    names
}

fn guessed(rows: &[Vec<f64>], width: usize) -> Vec<String> {
    let rest: &[&str] = match width {
        4 => &["Intensity"],
        6 if unit_vectors(rows, 3) => &["nx", "ny", "nz"],
        6 if colors(rows, 3) => &["red", "green", "blue"],
        7 if colors(rows, 3) && constant(rows, 6) => &["red", "green", "blue", "alpha"],
        7 if colors(rows, 4) => &["Intensity", "red", "green", "blue"],
        9 if unit_vectors(rows, 3) && colors(rows, 6) => &["nx", "ny", "nz", "red", "green", "blue"],
        9 if colors(rows, 3) && unit_vectors(rows, 6) => &["red", "green", "blue", "nx", "ny", "nz"],
        10 if colors(rows, 4) && unit_vectors(rows, 7) => &["Intensity", "red", "green", "blue", "nx", "ny", "nz"],
        _ => &[],
    };
    let known = ["x", "y", "z"].iter().chain(rest).map(|&name| name.to_owned());
    let unknown = (3 + rest.len()..width).map(|index| format!("column_{}", index + 1));
    known.chain(unknown).collect()
}

/// Whether three columns are normals: all but a few of length 1, and not all along an axis, as pure colours would be.
fn unit_vectors(rows: &[Vec<f64>], first: usize) -> bool {
    let unit = |row: &&Vec<f64>| {
        let length = row[first..first + 3].iter().map(|value| value * value).sum::<f64>().sqrt();
        (0.95..1.05).contains(&length)
    };
    let fractional_or_negative =
        rows.iter().any(|row| row[first..first + 3].iter().any(|value| value.fract() != 0.0 || *value < 0.0));
    fractional_or_negative && rows.iter().filter(unit).count() * 10 >= rows.len() * 9
}

/// Whether three columns can be colours: 0 to 1, to 255 or to 65535, and whole numbers beyond 1.
fn colors(rows: &[Vec<f64>], first: usize) -> bool {
    let values = || rows.iter().flat_map(|row| &row[first..first + 3]);
    let largest = values().copied().fold(0.0, f64::max);
    values().all(|&value| (0.0..=65535.0).contains(&value) && (largest <= 1.0 || value.fract() == 0.0))
}

fn constant(rows: &[Vec<f64>], column: usize) -> bool {
    let first = rows[0][column];
    (first == 255.0 || first == 1.0) && rows.iter().all(|row| row[column] == first)
}
