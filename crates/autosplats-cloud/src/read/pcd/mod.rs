//! PCD: ascii, binary and binary_compressed.

mod header;
mod lzf;

use glam::DVec3;

use self::header::{Encoding, Header};
use super::{
    Attribute, Contents, Description, Format, Job, shown,
    table::{Column, Part, Scalar, Table, reserve},
    text::{Rows, Token},
};
use crate::{Axes, Error, PointCloud};

pub(super) const FORMAT: Format =
    Format { name: "PCD", extensions: &["pcd"], recognised: header::recognised, sensor_frame: true, describe, read };

/// Part of the work that parsing text is.
const PARSING: Part = Part { start: 0.0, len: 0.8 };

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let header = Header::parse(job)?;
    let stored = |field: &header::Field| match field.count {
        1 => field.scalar.name().to_owned(),
        count => format!("{count} × {}", field.scalar.name()),
    };
    let fields = header.fields.iter().filter(|field| field.name != "_");
    Ok(Description {
        format: format!("PCD, {}", header.encoding.name()),
        points: Some(header.points as u64),
        attributes: fields.map(|field| Attribute::new(shown(field.name.as_bytes()), stored(field))).collect(),
        ..Description::default()
    })
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    let header = Header::parse(job)?;
    let stride = header.stride().ok_or_else(|| job.malformed("header", "a point is larger than any memory"))?;
    let cloud = match header.encoding {
        Encoding::Ascii => ascii(job, &header)?,
        Encoding::Binary => {
            job.check_not_text_converted(header.end)?;
            let bytes = &job.bytes[header.end..];
            if header.points.checked_mul(stride).is_none_or(|needed| needed > bytes.len()) {
                let complete = bytes.len() / stride.max(1);
                return Err(job.malformed(
                    format!("byte {}", job.bytes.len()),
                    format!("the file ends after {complete} of {} points; it is cut off, copy it again", header.points),
                ));
            }
            let table = table(&header, bytes, 0.0, |before, _| (before, stride));
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
    Ok(if seen_from_origin(&header, &cloud) { cloud.with_axes(Axes::Camera) } else { cloud }.into())
}

/// The columns over binary data. `place` makes offset and stride of a field from the bytes of a point before it and of
/// itself.
fn table<'a>(header: &Header, bytes: &'a [u8], done: f32, place: impl Fn(usize, usize) -> (usize, usize)) -> Table<'a> {
    let mut columns = Vec::new();
    let mut before = 0;
    for field in &header.fields {
        let size = field.scalar.size() * field.count;
        // A name of "_" is padding.
        if field.count == 1 && field.name != "_" {
            let (offset, stride) = place(before, size);
            columns.push(Column { name: field.name.clone(), scalar: field.scalar, offset, stride });
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
        if field.count != 1 || field.name == "_" {
            // A line cannot be shorter than its values, which bounds what the header can ask for.
            if field.count > job.bytes.len().saturating_sub(tokens.len()) {
                return Err(job.malformed("header", format!("a point of {} values", field.count)));
            }
            tokens.extend(std::iter::repeat_n(Token::Skip, field.count));
            continue;
        }
        let name = field.name.to_ascii_lowercase();
        let (scalar, token) = match name.as_str() {
            // Text may hold more digits than the type declared for it; coordinates need them.
            "x" | "y" | "z" => (Scalar::F64, Token::Store(Scalar::F64)),
            "rgb" | "rgba" if field.scalar.size() == 4 => (Scalar::U32, Token::Packed),
            _ => (field.scalar, Token::Store(field.scalar)),
        };
        columns.push(Column { name: field.name.clone(), scalar, offset, stride: 0 });
        tokens.push(token);
        offset += token.size();
    }
    for column in &mut columns {
        column.stride = offset;
    }
    let rows = Rows { tokens: &tokens, count: Some(header.points), counts_between: false };
    let (bytes, count) = rows.parse(job, header.end, PARSING)?;
    Table { bytes: &bytes, count, big_endian: false, columns, packed_rgb: true, done: PARSING.len }
        .into_cloud(job, "header")
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

/// Furthest that depth cameras see, metres, with room to spare.
const DEPTH_CAMERA_RANGE: f32 = 20.0;

/// Points in a depth camera's own frame: an image of points, or coloured ones nearer than such cameras see, all in front.
fn seen_from_origin(header: &Header, cloud: &PointCloud) -> bool {
    if !header.viewpoint_is_identity || cloud.origin() != DVec3::ZERO {
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
