//! PTX: text of one or several scans, each a header of ten lines and one line per measured direction.
//!
//! The header states the size of the scan in columns and rows, and the scanner's position and axes. A 4 × 4 matrix maps
//! the scanner's frame to the world, for row vectors. Scans are found by counting lines, then parsed in parallel.

use std::ops::Range;

use autosplats_cloud::{Axes, Contents, Error, FieldValues, PointCloud, Scan, excerpt};
use glam::{DMat3, DMat4, DVec3, DVec4};
use rayon::prelude::*;

use super::{
    Attribute, Description, Format, Job, lines,
    placed::{fill, place},
    table::{ProgressRange, Scalar},
    text::{self, Rows, Short, Token},
};
use crate::color_scale::{ColorScale, Levels};

/// Fraction of the work that parsing takes.
const PARSING: f32 = 0.8;

/// Number of values on each line of a header.
const HEADER: [usize; 10] = [1, 1, 3, 3, 3, 3, 4, 4, 4, 4];

/// Bytes of the shortest line of a point: `0 0 0` and a line end.
const MIN_LINE: usize = 6;

/// Largest file, in bytes, of which all scans are described; of larger files only the first.
const MAX_WALKED_BYTES: usize = 1 << 24;

/// Lines of a scan whose numbers of values are counted before they are parsed.
const SAMPLED_LINES: usize = 1000;

/// Brightness of points without a colour, if others have one.
const GREY: u8 = 200;

/// Points of a preview chunk.
const CHUNK: usize = 1 << 20;

pub(super) const FORMAT: Format = Format {
    name: "PTX",
    extensions: &["ptx"],
    recognised: |bytes| header(bytes, 0).is_ok(),
    sensor_frame: false,
    describe,
    read,
};

/// Header of a scan.
struct Header {
    columns: u64,
    rows: u64,
    /// Maps the numbers of the file to world coordinates; may scale.
    world_from_local: DMat4,
    world_from_sensor: DMat4,
    /// Whether the matrix was written for column vectors.
    transposed: bool,
    /// First byte of the first point.
    start: usize,
}

/// A scan found in the file: its header, the byte range of its points, and the largest number of values per line.
struct FoundScan {
    header: Header,
    count: usize,
    points: Range<usize>,
    width: usize,
}

/// Parses the header at byte `at`, the start of a line. The error holds the byte and the reason.
fn header(bytes: &[u8], mut at: usize) -> Result<Header, (usize, String)> {
    let mut values = [[0.0; 4]; 10];
    for (line, &width) in HEADER.iter().enumerate() {
        let end = text::line_end(&bytes[..bytes.len().min(at + 1024)], at);
        let row = bytes.get(at..end).unwrap_or_default().trim_ascii();
        if row.is_empty() {
            return Err((
                at,
                format!("the file ends, or has an empty line, in the header of a scan at line {}", line + 1),
            ));
        }
        let mut count = 0;
        for value in text::values(row) {
            let number = text::number(value).map_err(|what| (at, what))?;
            if count == width || !number.is_finite() {
                return Err((
                    at,
                    format!("'{}' is not the {width} numbers of line {} of a header", excerpt(row), line + 1),
                ));
            }
            values[line][count] = number;
            count += 1;
        }
        if count < width || width == 1 && !text::is_count(row) {
            return Err((
                at,
                format!("'{}' is not the {width} numbers of line {} of a header", excerpt(row), line + 1),
            ));
        }
        at = text::after_line_end(bytes, at);
    }
    let transposed = transpose(&mut values).map_err(|what| (at, what))?;
    let vector = |line: usize| DVec3::new(values[line][0], values[line][1], values[line][2]);
    // The file multiplies row vectors from the left, so its rows are the columns here.
    let column = |line: usize, last: f64| DVec4::from((vector(line), last));
    let world_from_local = DMat4::from_cols(column(6, 0.0), column(7, 0.0), column(8, 0.0), column(9, 1.0));
    let placed = DMat4::from_cols(column(3, 0.0), column(4, 0.0), column(5, 0.0), column(2, 1.0));
    // The scanner stands at the origin of its frame. Files in world coordinates have an identity matrix, and state the
    // scanner's position in the other lines.
    let sensor = if world_from_local == DMat4::IDENTITY { placed } else { world_from_local };
    let whole = |line: usize| values[line][0] as u64;
    let world_from_sensor = rigid(sensor);
    Ok(Header { columns: whole(0), rows: whole(1), world_from_local, world_from_sensor, transposed, start: at })
}

/// Turns a matrix over that was written for column vectors, and returns whether it was. Only the place of the
/// translation tells: it is in the last row, unless that row is 0 0 0 1 and the last column is not.
fn transpose(values: &mut [[f64; 4]; 10]) -> Result<bool, String> {
    let last = [0, 1, 2, 3].map(|line| values[6 + line][3]);
    if last[..3] == [0.0; 3] {
        return Ok(false);
    }
    if values[9] != [0.0, 0.0, 0.0, 1.0] {
        let what = "neither the last column nor the last row of the matrix before this line is 0 0 0 1; correct it";
        return Err(what.into());
    }
    let matrix = [values[6], values[7], values[8], values[9]];
    for (row, line) in values[6..].iter_mut().enumerate() {
        *line = matrix.map(|column| column[row]);
    }
    Ok(true)
}

/// The map without its scaling.
fn rigid(map: DMat4) -> DMat4 {
    let [x, y, z] = [map.x_axis, map.y_axis, map.z_axis].map(|axis| axis.truncate());
    let x = x.normalize_or_zero();
    let y = (y - x * x.dot(y)).normalize_or_zero();
    let right_handed = x.cross(y);
    let turned = if right_handed.dot(z) > 0.0 { DMat3::from_cols(x, y, right_handed) } else { DMat3::IDENTITY };
    DMat4::from_mat3_translation(turned, map.w_axis.truncate())
}

/// Finds the scans and the layout of their lines. With `only_first`, lines are not counted.
fn walk(job: &Job<'_>, only_first: bool) -> Result<Vec<FoundScan>, Error> {
    let bytes = job.bytes;
    if bytes.is_empty() {
        return Err(job.malformed("byte 0", "the file is empty; copy it again"));
    }
    let mut scans = Vec::new();
    let mut at = 0;
    loop {
        // Blank lines between scans.
        while bytes.get(at).is_some_and(u8::is_ascii_whitespace) {
            at += 1;
        }
        if at >= bytes.len() || only_first && !scans.is_empty() {
            return Ok(scans);
        }
        job.tick(0.0)?;
        let header = header(bytes, at).map_err(|(at, what)| job.malformed(job.line(at), what))?;
        let claimed = header.columns.checked_mul(header.rows).and_then(|count| usize::try_from(count).ok());
        let left = bytes.len() - header.start;
        let count = claimed.filter(|&count| count <= (left + 1) / MIN_LINE).ok_or_else(|| {
            let points = u128::from(header.columns) * u128::from(header.rows);
            job.malformed(
                job.line(at),
                format!("{points} points cannot be in the {left} bytes that are left; copy the file again"),
            )
        })?;
        let (end, lines) = if only_first { (bytes.len(), count) } else { after_lines(bytes, header.start, count) };
        if lines < count {
            // An error, as in all formats that count their points: half a scan may be mistaken for a whole one.
            let what =
                format!("the file ends after {lines} of {count} points of scan {}; copy it again", scans.len() + 1);
            return Err(job.malformed(job.line(bytes.len()), what));
        }
        let first = &bytes[header.start..text::line_end(bytes, header.start).min(header.start + 1024)];
        let width = text::values(first).count();
        if count > 0 && !matches!(width, 3 | 4 | 6 | 7) {
            return Err(job.malformed(
                job.line(header.start),
                format!("{width} values; points have 3, 4 with intensity, 6 with colour, or 7 with both"),
            ));
        }
        // Lines without a return may lack the colour that the others have.
        let range = header.start..end;
        let mut widths =
            lines::lines(bytes, &range).take(count.min(SAMPLED_LINES)).map(|(_, line)| text::values(line).count());
        let width = widths.find(|&other| width < 6 && other == width + 3).unwrap_or(width);
        at = end;
        scans.push(FoundScan { points: header.start..end, header, count, width });
    }
}

/// The byte after `count` lines from `at` on, and the number of lines, which is lower if the text ends before.
fn after_lines(bytes: &[u8], mut at: usize, count: usize) -> (usize, usize) {
    const BLOCK: usize = 1 << 14;
    let mut lines = 0;
    while lines < count && at < bytes.len() {
        let block = &bytes[at..bytes.len().min(at + BLOCK)];
        let ends = block.iter().filter(|&&byte| byte == b'\n').count();
        if lines + ends < count {
            lines += ends;
            at += block.len();
            continue;
        }
        while lines < count {
            at = text::after_line_end(bytes, at);
            lines += 1;
        }
        return (at, lines);
    }
    // The last line needs no line feed.
    let unfinished = lines < count && bytes.last().is_some_and(|&byte| byte != b'\n');
    (at, lines + usize::from(unfinished))
}

/// Points of a scan as records: x, y and z in 24 bytes, intensity in 4, colour in 12.
struct Records {
    bytes: Vec<u8>,
    stride: usize,
    /// Byte offset of the intensity, and of the colour.
    intensity: Option<usize>,
    color: Option<usize>,
    world_from_local: DMat4,
    /// Indices of the points with a return, unless all points have one.
    keep: Option<Vec<usize>>,
    count: usize,
    /// Number of points without a colour, if others have one.
    uncolored: usize,
}

impl Records {
    fn parse(job: &Job<'_>, scan: &FoundScan, part: ProgressRange) -> Result<Self, Error> {
        Self::of_width(job, scan, scan.width, part).or_else(|error| match error {
            // The first lines with a colour may come late.
            Error::Malformed { .. } if scan.width < 6 => {
                Self::of_width(job, scan, scan.width + 3, part).map_err(|_| error)
            }
            _ => Err(error),
        })
    }

    fn of_width(job: &Job<'_>, scan: &FoundScan, width: usize, part: ProgressRange) -> Result<Self, Error> {
        let (has_intensity, has_color) = (matches!(width, 4 | 7), width >= 6);
        let mut tokens = vec![Token::Store(Scalar::F64); 3];
        tokens.extend(has_intensity.then_some(Token::Store(Scalar::F32)));
        tokens.extend([Token::Store(Scalar::F32); 3].into_iter().take(if has_color { 3 } else { 0 }));
        let stride: usize = tokens.iter().map(|token| token.size()).sum();
        job.check_memory(scan.count, 2 * stride)?;
        // Numbers of nothing but set bits are not numbers.
        let short = Short::new(width.saturating_sub(3), u8::MAX);
        let rows = Rows { tokens: &tokens, count: Some(scan.count), may_be_cut: false };
        let own = Job { bytes: &job.bytes[..scan.points.end], ..*job };
        let (bytes, count) = if has_color {
            rows.parse_with_short(&own, scan.points.start, part, &short)?
        } else {
            rows.parse(&own, scan.points.start, part)?
        };
        let color = 24 + if has_intensity { 4 } else { 0 };
        let mut records = Self {
            bytes,
            stride,
            intensity: has_intensity.then_some(24),
            color: has_color.then_some(color),
            world_from_local: scan.header.world_from_local,
            keep: None,
            count,
            uncolored: short.rows(),
        };
        if !job.options.keep_no_returns {
            let seen = |i: &usize| records.local(*i) != DVec3::ZERO;
            if !(0..count).into_par_iter().all(|i| seen(&i)) {
                records.keep = Some((0..count).into_par_iter().filter(seen).collect());
            }
        }
        Ok(records)
    }

    fn len(&self) -> usize {
        self.keep.as_ref().map_or(self.count, Vec::len)
    }

    fn record(&self, point: usize) -> &[u8] {
        let index = self.keep.as_ref().map_or(point, |keep| keep[point]);
        &self.bytes[index * self.stride..][..self.stride]
    }

    fn local(&self, index: usize) -> DVec3 {
        position(&self.bytes[index * self.stride..])
    }

    fn world(&self, point: usize) -> DVec3 {
        let local = position(self.record(point));
        if self.world_from_local == DMat4::IDENTITY { local } else { self.world_from_local.transform_point3(local) }
    }

    fn number(&self, point: usize, at: usize) -> f32 {
        let mut raw = [0; 4];
        raw.copy_from_slice(&self.record(point)[at..at + 4]);
        f32::from_le_bytes(raw)
    }

    fn intensity(&self, point: usize) -> f32 {
        self.intensity.map_or(f32::NAN, |at| self.number(point, at))
    }

    /// Levels of the colours of some points.
    fn levels(&self, points: Range<usize>) -> Levels {
        let Some(at) = self.color else { return Levels::default() };
        let channel = |point: usize| [at, at + 4, at + 8].map(|at| f64::from(self.number(point, at)));
        Levels::of(points.len(), |i| channel(points.start + i))
    }

    fn color(&self, point: usize, scale: ColorScale) -> [u8; 3] {
        // Grey, if other scans have colours.
        self.color.map_or([GREY; 3], |at| {
            let rgb = [at, at + 4, at + 8].map(|at| f64::from(self.number(point, at)));
            if rgb[0].is_nan() { [GREY; 3] } else { rgb.map(|value| scale.byte(value)) }
        })
    }
}

fn position(record: &[u8]) -> DVec3 {
    DVec3::from([0, 8, 16].map(|at| {
        let mut raw = [0; 8];
        raw.copy_from_slice(&record[at..at + 8]);
        f64::from_le_bytes(raw)
    }))
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    let scans = walk(job, false)?;
    let mut records = Vec::new();
    for scan in &scans {
        let share = |bytes: usize| PARSING * bytes as f32 / job.bytes.len() as f32;
        let part = ProgressRange { start: share(scan.points.start), len: share(scan.points.len()) };
        let parsed = Records::parse(job, scan, part)?;
        if job.progress.wants_chunks() {
            preview(job, &parsed)?;
        }
        records.push(parsed);
    }
    let transposed = scans.iter().filter(|scan| scan.header.transposed).count();
    if transposed > 0 {
        let count = scans.len();
        job.note(format!("{transposed} of {count} scans have a matrix for column vectors; turned over"));
    }
    let uncolored: usize = records.iter().map(|records| records.uncolored).sum();
    if uncolored > 0 {
        job.note(format!("{uncolored} lines have no colour, while others of their scan do; taken for grey"));
    }
    let lens: Vec<usize> = records.iter().map(Records::len).collect();
    let total: usize = records.iter().map(|records| records.count).sum();
    let kept: usize = lens.iter().sum();
    if kept < total {
        job.note(format!("{} of {total} points are at (0, 0, 0), where nothing came back; dropped", total - kept));
    }
    job.check_memory(kept, 12 + 3 + 4 + if job.options.exact { 12 } else { 0 })?;
    let part = |step: u8| ProgressRange {
        start: PARSING + (1.0 - PARSING) * f32::from(step) / 3.0,
        len: (1.0 - PARSING) / 3.0,
    };
    let mut cloud = cloud(job, &records, &lens, part)?;
    if records.iter().any(|records| records.intensity.is_some()) {
        if records.iter().any(|records| records.intensity.is_none() && records.len() > 0) {
            job.note("only some scans have Intensity; NaN in the others");
        }
        let intensity = fill(job, "Intensity", &lens, part(2), |scan| {
            let records = &records[scan];
            move |i| records.intensity(i)
        })?;
        cloud = cloud.with_field("Intensity", FieldValues::F32(intensity))?;
    }
    let mut start = 0;
    let scans = scans.iter().zip(&lens).map(|(scan, len)| {
        let points = start..start + len;
        start = points.end;
        Scan { name: None, world_from_sensor: scan.header.world_from_sensor, points }
    });
    let scans = scans.collect();
    Ok(cloud.with_axes(Axes::ZUp).with_scans(scans).into())
}

/// Positions and colours of all scans.
fn cloud(
    job: &Job<'_>,
    records: &[Records],
    lens: &[usize],
    part: impl Fn(u8) -> ProgressRange,
) -> Result<PointCloud, Error> {
    let cloud = place(job, lens, part(0), |scan| {
        let records = &records[scan];
        move |i| records.world(i)
    })?;
    if records.iter().all(|records| records.color.is_none()) {
        return Ok(cloud);
    }
    let levels = records.iter().map(|records| records.levels(0..records.len()));
    let scale = ColorScale::of_levels(levels.fold(Levels::default(), Levels::and), true);
    scale.note().iter().for_each(|note| job.note(note));
    let colors = fill(job, "colours", lens, part(1), |scan| {
        let records = &records[scan];
        move |i| records.color(i, scale)
    })?;
    cloud.with_colors(colors)
}

/// Passes the points of a scan to the caller as preview chunks.
fn preview(job: &Job<'_>, records: &Records) -> Result<(), Error> {
    let quiet = Job { progress: &(), ..*job };
    let nothing = ProgressRange { start: 0.0, len: 0.0 };
    for start in (0..records.len()).step_by(CHUNK) {
        let lens = [CHUNK.min(records.len() - start)];
        job.preview(|| {
            let cloud = place(&quiet, &lens, nothing, |_| move |i| records.world(start + i))?;
            if records.color.is_none() {
                return Ok(cloud);
            }
            let scale = ColorScale::of_levels(records.levels(start..start + lens[0]), true);
            cloud.with_colors(fill(&quiet, "colours", &lens, nothing, |_| move |i| records.color(start + i, scale))?)
        })?;
    }
    Ok(())
}

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let all = job.bytes.len() <= MAX_WALKED_BYTES;
    let walked = walk(job, !all)?;
    let mut notes = Vec::new();
    if !all {
        notes.push("only the first scan is described; finding the others would take counting all lines".into());
    }
    let mut start = 0;
    let scans = walked.iter().map(|scan| {
        let points = start..start + scan.count;
        start = points.end;
        Scan { name: None, world_from_sensor: scan.header.world_from_sensor, points }
    });
    let scans: Vec<_> = scans.collect();
    let widest = walked.iter().filter(|scan| scan.count > 0).map(|scan| scan.width).max().unwrap_or(0);
    let names: &[&str] = match widest {
        0 => &[],
        3 => &["x", "y", "z"],
        4 => &["x", "y", "z", "intensity"],
        6 => &["x", "y", "z", "red", "green", "blue"],
        _ => &["x", "y", "z", "intensity", "red", "green", "blue"],
    };
    let size = |scan: &FoundScan| format!("{} columns, {} rows", scan.header.columns, scan.header.rows);
    let details = walked.iter().take(100).enumerate().map(|(i, scan)| (format!("scan {}", i + 1), size(scan)));
    Ok(Description {
        format: "PTX, text".into(),
        points: all.then_some(start as u64),
        attributes: names.iter().map(|name| Attribute::new(*name, "text")).collect(),
        scans,
        details: details.collect(),
        notes,
        ..Description::default()
    })
}
