//! PCD: ascii, binary and binary_compressed.

mod header;
mod lzf;

use autosplats_cloud::{Axes, Contents, Error, PointCloud, Scan, excerpt};
use glam::{DMat4, DVec3};

use self::header::{Encoding, Header, Viewpoint};
use super::{
    Attribute, Description, Format, Job,
    body::Body,
    columns::{MAX_COUNT, numbered, unrepeated},
    table::{Column, ProgressRange, Table, reserve},
    text::{Rows, TEXT, Token, is_coordinate},
    xyz,
};

pub(super) const FORMAT: Format =
    Format { name: "PCD", extensions: &["pcd"], recognised: header::recognised, sensor_frame: true, describe, read };

/// Share of the work that parsing text takes.
const PARSING: ProgressRange = ProgressRange { start: 0.0, len: 0.8 };

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    if without_header(job) {
        let mut description = (xyz::FORMAT.describe)(job)?;
        description.notes.insert(0, NO_HEADER.into());
        return Ok(description);
    }
    let header = Header::parse(job)?;
    let stored = |field: &header::Field| match field.count {
        1 if header.encoding == Encoding::Ascii && is_coordinate(&field.name) => TEXT.to_owned(),
        1 => field.scalar.name().to_owned(),
        count => format!("{count} × {}", field.scalar.name()),
    };
    let fields = header.fields.iter().filter(|field| field.name != "_");
    let mut details = Vec::new();
    if let Some(width) = header.width {
        details.push(("size".into(), format!("{width} × {}", header.height)));
    }
    let viewpoint = match header.viewpoint {
        Viewpoint::Identity => "origin".into(),
        Viewpoint::At(pose) => {
            let DVec3 { x, y, z } = pose.w_axis.truncate();
            format!("{x} {y} {z}")
        }
        Viewpoint::Broken => "no pose".into(),
    };
    details.push(("viewpoint".into(), viewpoint));
    Ok(Description {
        format: format!("PCD, {}", header.encoding.name()),
        points: Some(header.points as u64),
        attributes: unrepeated(fields.map(|field| Attribute::new(excerpt(field.name.as_bytes()), stored(field)))),
        scans: scans(&header, header.points),
        details,
        ..Description::default()
    })
}

/// Note on a file named `.pcd` without a PCD header. Such a file can only be meant as rows of numbers.
const NO_HEADER: &str = "there is no PCD header; read as text";

/// Whether the file has rows of numbers instead of a PCD header.
pub(super) fn without_header(job: &Job<'_>) -> bool {
    !header::recognised(job.bytes) && xyz::looks_like_rows(job.bytes)
}

/// The body after the header, its first byte, and its least number of bytes; `None` if that number overflows.
pub(super) fn body(job: &Job<'_>) -> Result<(Body, usize, Option<usize>), Error> {
    let header = Header::parse(job)?;
    let bytes = header.stride().and_then(|stride| header.points.checked_mul(stride));
    Ok(match header.encoding {
        // A value and a line end.
        Encoding::Ascii => (Body::Lines(header.points), header.end, header.points.checked_mul(2)),
        Encoding::Binary => (Body::Bytes(bytes.unwrap_or(usize::MAX)), header.end, bytes),
        Encoding::Compressed => (Body::Sized, header.end, bytes),
    })
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    if without_header(job) {
        job.note(NO_HEADER);
        return (xyz::FORMAT.read)(job);
    }
    let header = Header::parse(job)?;
    header.tell_odd(job)?;
    let long = |field: &&header::Field| field.name != "_" && field.count > MAX_COUNT;
    for field in header.fields.iter().filter(long).take(MAX_NOTED_FIELDS) {
        let name = excerpt(field.name.as_bytes());
        job.note(format!("{name} has {} values a point; left out, {MAX_COUNT} at most are read", field.count));
    }
    let stride = header.stride().ok_or_else(|| job.malformed("header", "a point is larger than any memory"))?;
    let cloud = match header.encoding {
        Encoding::Ascii => ascii(job, &header)?,
        Encoding::Binary => {
            job.check_not_text_converted(header.end)?;
            let bytes = &job.bytes[header.end..];
            let held = header.points.min(bytes.len() / stride.max(1));
            job.tell_cut_off(held, header.points, "points")?;
            let table = Table { count: held, ..table(&header, bytes, 0.0, |before, _| (before, stride)) };
            table.preview(job, "header")?;
            table.into_cloud(job, "header")?
        }
        Encoding::Compressed => {
            job.check_not_text_converted(header.end)?;
            let bytes = decompress(job, &header, stride)?;
            // Compressed files hold all values of the first field, then all of the second, and so on.
            let table = table(&header, &bytes, 0.5, |before, size| (before * header.points, size));
            table.preview(job, "header")?;
            table.into_cloud(job, "header")?
        }
    };
    let mut scans = scans(&header, cloud.len());
    if scans.is_empty() && image_from_origin(&header, &cloud) {
        scans.push(at_the_origin(cloud.len()));
    }
    let axes = header.axes.or_else(|| seen_from_origin(&header, &cloud).then_some(Axes::Camera));
    let cloud = cloud.with_scans(scans);
    Ok(if let Some(axes) = axes { cloud.with_axes(axes) } else { cloud }.into())
}

/// Largest number of left-out fields that are noted one by one.
const MAX_NOTED_FIELDS: usize = 10;

/// Pairs of neighbours sampled to find out from where an image of points was taken.
const MAX_SAMPLED_PAIRS: usize = 1 << 14;

/// The sensor's pose, if VIEWPOINT is not the default, or if a file of this project states that the default is true.
///
/// Points are not moved by the pose. The format calls VIEWPOINT the place from which the points were acquired, not a
/// transformation to apply, and other programs leave points unmoved.
fn scans(header: &Header, points: usize) -> Vec<Scan> {
    match header.viewpoint {
        Viewpoint::At(world_from_sensor) => vec![Scan { name: None, world_from_sensor, points: 0..points }],
        Viewpoint::Identity if header.knows_sensor => vec![at_the_origin(points)],
        Viewpoint::Identity | Viewpoint::Broken => Vec::new(),
    }
}

fn at_the_origin(points: usize) -> Scan {
    Scan { name: None, world_from_sensor: DMat4::IDENTITY, points: 0..points }
}

/// Whether an organised cloud was taken from the origin, although its VIEWPOINT is the default. Seen from the sensor,
/// neighbours in a row of the image have about the same angle between them, near or far. Moved points do not.
fn image_from_origin(header: &Header, cloud: &PointCloud) -> bool {
    let Some(width) =
        header.width.filter(|&width| width > 0 && header.viewpoint == Viewpoint::Identity && header.height > 1)
    else {
        return false;
    };
    let ray = |i: usize| cloud.world_position(i).try_normalize().filter(|ray| ray.is_finite());
    let step = cloud.len().div_ceil(MAX_SAMPLED_PAIRS).max(1);
    let starts = (0..cloud.len().saturating_sub(1)).step_by(step).filter(|i| (i + 1) % width != 0);
    let mut angles: Vec<f64> = starts.filter_map(|i| Some(ray(i)?.cross(ray(i + 1)?).length())).collect();
    if angles.is_empty() {
        return false;
    }
    angles.sort_unstable_by(f64::total_cmp);
    let middle = angles[angles.len() / 2];
    let even = angles.iter().filter(|&&angle| (0.3 * middle..=3.0 * middle).contains(&angle)).count();
    middle > 0.0 && even * 10 >= angles.len() * 9
}

/// The columns over binary data. `place` maps the bytes before a field and its own to its offset and stride.
fn table<'a>(header: &Header, bytes: &'a [u8], done: f32, place: impl Fn(usize, usize) -> (usize, usize)) -> Table<'a> {
    let mut columns = Vec::new();
    let mut before = 0;
    for field in &header.fields {
        let size = field.scalar.size() * field.count;
        let (offset, stride) = place(before, size);
        for (index, name) in numbered(&field.name, field.count).into_iter().enumerate() {
            let offset = offset + index * field.scalar.size();
            columns.push(Column { name, scalar: field.scalar, offset, stride });
        }
        before += size;
    }
    Table { bytes, count: header.points, big_endian: false, columns, packed_rgb: true, done }
}

fn ascii(job: &Job<'_>, header: &Header) -> Result<PointCloud, Error> {
    let mut columns = Vec::new();
    let mut tokens = Vec::new();
    let mut offset = 0;
    for field in &header.fields {
        let names = numbered(&field.name, field.count);
        if names.is_empty() {
            // A line is at least as long as its number of values, which bounds what the header can claim.
            if field.count > job.bytes.len().saturating_sub(tokens.len()) {
                return Err(job.malformed("header", format!("a point of {} values", field.count)));
            }
            tokens.extend(std::iter::repeat_n(Token::Skip, field.count));
            continue;
        }
        let (scalar, token) = Token::of(&field.name, field.scalar);
        for name in names {
            columns.push(Column { name, scalar, offset, stride: 0 });
            tokens.push(token);
            offset += token.size();
        }
    }
    for column in &mut columns {
        column.stride = offset;
    }
    let rows = Rows { tokens: &tokens, count: Some(header.points), may_be_cut: true };
    let done = PARSING.len;
    let (bytes, count) = rows.parse_and_show(job, header.end, PARSING, |bytes, count| {
        Table { bytes, count, big_endian: false, columns: columns.clone(), packed_rgb: true, done }
            .preview(job, "header")
    })?;
    Table { bytes: &bytes, count, big_endian: false, columns, packed_rgb: true, done }.into_cloud(job, "header")
}

fn decompress(job: &Job<'_>, header: &Header, stride: usize) -> Result<Vec<u8>, Error> {
    let fail = |at: usize, what: &str| job.malformed(format!("byte {at}"), what);
    let data = &job.bytes[header.end..];
    let Some((sizes, data)) = data.split_first_chunk::<8>() else {
        return Err(fail(header.end, "the sizes of the compressed data are missing; the file is cut off"));
    };
    let [compressed, plain] = bytemuck::cast::<[u8; 8], [[u8; 4]; 2]>(*sizes).map(u32::from_le_bytes);
    let (compressed, plain) = (compressed as usize, plain as usize);
    if header.points.checked_mul(stride) != Some(plain) {
        let what = format!("{plain} uncompressed bytes are not {} points of {stride} bytes", header.points);
        return Err(fail(header.end + 4, &what));
    }
    let Some(data) = data.get(..compressed) else {
        return Err(fail(job.bytes.len(), "the file ends inside the compressed data; it is cut off, copy it again"));
    };
    if plain / lzf::MAX_RATIO > compressed {
        return Err(fail(header.end, "the compressed data are too short for so many points"));
    }
    job.check_memory(header.points, stride)?;
    let mut bytes = Vec::new();
    reserve(&mut bytes, plain, "compressed points")?;
    let go_on = |made: usize| job.tick(0.5 * made as f32 / plain as f32);
    if let Err((at, what)) = lzf::decompress(data, plain, &mut bytes, go_on)? {
        return Err(fail(header.end + 8 + at, what));
    }
    if bytes.len() != plain {
        let what = format!("the compressed data make {} bytes, the header promises {plain}", bytes.len());
        return Err(fail(header.end, &what));
    }
    Ok(bytes)
}

/// Largest range of depth cameras, in metres, with a margin.
const DEPTH_CAMERA_RANGE: f32 = 20.0;

/// Whether an image of points, or coloured points in a depth camera's range, are in the camera's frame: 99 % in front.
fn seen_from_origin(header: &Header, cloud: &PointCloud) -> bool {
    if header.viewpoint != Viewpoint::Identity || cloud.origin() != DVec3::ZERO {
        return false;
    }
    let far = || cloud.positions().iter().flatten().any(|value| value.abs() > DEPTH_CAMERA_RANGE);
    if header.height < 2 && (cloud.colors().is_none() || far()) {
        return false;
    }
    let finite = cloud.positions().iter().filter(|point| point.iter().all(|value| value.is_finite()));
    let (mut front, mut behind) = (0_usize, 0_usize);
    for [_, _, z] in finite {
        if *z > 0.0 { front += 1 } else { behind += 1 }
    }
    front > 0 && behind * 100 <= front
}
