//! PCD: ascii, binary and binary_compressed.

mod frame;
mod header;
mod lzf;
pub(super) mod parts;

use autosplats_cloud::{Contents, Error, excerpt};
use glam::DVec3;

use self::{
    frame::{Frame, InFront, image_from_origin, may_be_seen_from_origin, ray, sampled_pairs, scans},
    header::{Encoding, Header, Viewpoint},
};
use super::{
    Attribute, Description, Format, Job,
    body::Body,
    columns::{MAX_COUNT, numbered, unrepeated},
    records::Records,
    table::{Column, Table, reserve},
    text::{TEXT, Token, is_coordinate},
    xyz,
};

pub(super) const FORMAT: Format =
    Format { name: "PCD", extensions: &["pcd"], recognised: header::recognised, sensor_frame: true, describe, read };

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

/// Tells what is odd about the header. Returns the bytes of a binary point.
fn check(job: &Job<'_>, header: &Header) -> Result<usize, Error> {
    header.tell_odd(job)?;
    let long = |field: &&header::Field| field.name != "_" && field.count > MAX_COUNT;
    for field in header.fields.iter().filter(long).take(MAX_NOTED_FIELDS) {
        let name = excerpt(field.name.as_bytes());
        job.note(format!("{name} has {} values a point; left out, {MAX_COUNT} at most are read", field.count));
    }
    header.stride().ok_or_else(|| job.malformed("header", "a point is larger than any memory"))
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    if without_header(job) {
        job.note(NO_HEADER);
        return (xyz::FORMAT.read)(job);
    }
    let header = Header::parse(job)?;
    let stride = check(job, &header)?;
    let cloud = match header.encoding {
        Encoding::Ascii | Encoding::Binary => records(job, &header, stride)?.into_cloud(job)?,
        Encoding::Compressed => {
            job.check_not_text_converted(header.end)?;
            let bytes = decompress(job, &header, stride)?;
            // Compressed files hold all values of the first field, then all of the second, and so on.
            let columns = columns(&header, |before, size| (before * header.points, size));
            let (count, big_endian, done) = (header.points, false, 0.5);
            let table = Table { bytes: &bytes, count, big_endian, columns, packed_rgb: true, done };
            table.preview(job, "header")?;
            table.into_cloud(job, "header")?
        }
    };
    let from_origin = image_from_origin(&sampled_pairs(&header, cloud.len()), |i| ray(cloud.world_position(i)));
    let may_be_seen = may_be_seen_from_origin(&header, cloud.origin());
    let seen = may_be_seen.then(|| InFront::default().with(cloud.positions()));
    let frame = Frame::of(&header, from_origin, cloud.colors().is_some(), seen);
    Ok(frame.set(cloud).into())
}

/// Largest number of left-out fields that are noted one by one.
const MAX_NOTED_FIELDS: usize = 10;

/// The values of a point. `place` maps the bytes before a field and its own to its offset and stride.
fn columns(header: &Header, place: impl Fn(usize, usize) -> (usize, usize)) -> Vec<Column> {
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
    columns
}

/// Where the records of the points are, of `stride` bytes if they are no text.
fn records(job: &Job<'_>, header: &Header, stride: usize) -> Result<Records, Error> {
    let (start, big_endian) = (header.end, false);
    if header.encoding == Encoding::Binary {
        job.check_not_text_converted(start)?;
        let count = header.points.min((job.bytes.len() - start) / stride.max(1));
        job.tell_cut_off(count, header.points, "points")?;
        let columns = columns(header, |before, _| (before, stride));
        return Ok(Records { columns, start, count, stride, big_endian, tokens: None });
    }
    let (mut columns, mut tokens, mut stride) = (Vec::new(), Vec::new(), 0);
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
            columns.push(Column { name, scalar, offset: stride, stride: 0 });
            tokens.push(token);
            stride += token.size();
        }
    }
    Ok(Records { columns, start, count: header.points, stride, big_endian, tokens: Some(tokens) })
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
