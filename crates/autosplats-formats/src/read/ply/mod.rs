//! PLY: ascii and binary of both byte orders, with any properties in any order and further elements. Faces and triangle
//! strips are read on request.

mod faces;
mod header;
mod length;
mod walk;

use autosplats_cloud::{Contents, Error, PointCloud, excerpt};

pub(super) use self::length::body;
use self::{
    header::{Element, Encoding, Header},
    walk::{skip, skip_rows, walk},
};
use super::{
    Attribute, Description, Format, Job,
    table::{Column, ProgressRange, Scalar, Table, reserve},
    text::{Rows, TEXT, Token, is_coordinate},
};

pub(super) const FORMAT: Format = Format {
    name: "PLY",
    extensions: &["ply"],
    recognised: |bytes| bytes.starts_with(b"ply") && bytes.get(3).is_none_or(u8::is_ascii_whitespace),
    sensor_frame: false,
    describe,
    read,
};

/// Largest number of further elements that a description lists.
const MAX_DESCRIBED_ELEMENTS: usize = 100;

/// Largest file, in bytes, whose strips a description counts through; counting then takes milliseconds.
const MAX_COUNTED_BYTES: usize = 4 << 20;

/// Share of the work that packing text or lists into records takes.
const PACKING: ProgressRange = ProgressRange { start: 0.0, len: 0.8 };

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let header = Header::parse(job)?;
    let vertex = &header.elements[vertices(job, &header)?];
    let stored = |property: &header::Property| match property.list {
        Some(_) => format!("list of {}", property.scalar.name()),
        None if header.encoding == Encoding::Ascii && is_coordinate(&property.name) => TEXT.into(),
        None => property.scalar.name().into(),
    };
    let count = |name: &str| header.elements.iter().find(|element| element.name == name).map(|element| element.count);
    // The number of triangles in a strip is known only by reading it.
    let in_strips = || {
        count("tristrips").filter(|_| job.bytes.len() <= MAX_COUNTED_BYTES)?;
        faces::triangles(job, &header, vertex.count).ok().map(|triangles| triangles.len())
    };
    let others = header.elements.iter().filter(|element| element.name != "vertex").take(MAX_DESCRIBED_ELEMENTS);
    Ok(Description {
        format: format!("PLY, {}", header.encoding.name()),
        points: Some(vertex.count as u64),
        faces: count("face").or_else(in_strips).map(|faces| faces as u64),
        attributes: vertex.properties.iter().map(|p| Attribute::new(excerpt(p.name.as_bytes()), stored(p))).collect(),
        details: others.map(|e| (format!("element {}", excerpt(e.name.as_bytes())), e.count.to_string())).collect(),
        ..Description::default()
    })
}

/// Whether the file is a PLY with faces.
pub(super) fn is_mesh(job: &Job<'_>) -> bool {
    let faces = |element: &Element| ["face", "tristrips"].contains(&&*element.name) && element.count > 0;
    (FORMAT.recognised)(job.bytes) && Header::parse(job).is_ok_and(|header| header.elements.iter().any(faces))
}

fn vertices(job: &Job<'_>, header: &Header) -> Result<usize, Error> {
    let index = header.elements.iter().position(|element| element.name == "vertex");
    index.ok_or_else(|| job.malformed("header", "there is no element 'vertex', so there are no points"))
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    let header = Header::parse(job)?;
    let index = vertices(job, &header)?;
    let (before, vertex) = (&header.elements[..index], &header.elements[index]);
    if header.encoding != Encoding::Ascii {
        job.check_not_text_converted(header.end)?;
    }
    let cloud = match (header.encoding, vertex.stride()) {
        (Encoding::Ascii, _) => ascii(job, &header, before, vertex)?,
        (_, Some(stride)) => plain(job, &header, before, vertex, stride)?,
        (_, None) => with_lists(job, &header, before, vertex)?,
    };
    let cloud = match header.axes {
        Some(axes) => cloud.with_axes(axes),
        None => cloud,
    };
    let triangles = if job.triangles { faces::triangles(job, &header, cloud.len())? } else { Vec::new() };
    Ok(Contents { cloud, triangles })
}

fn ascii(job: &Job<'_>, header: &Header, before: &[Element], vertex: &Element) -> Result<PointCloud, Error> {
    let start = skip_rows(job, header, before, vertex)?;
    let mut columns = Vec::new();
    let mut tokens = Vec::new();
    let mut offset = 0;
    for property in &vertex.properties {
        if property.list.is_some() {
            tokens.push(Token::SkipList);
            continue;
        }
        let scalar = if is_coordinate(&property.name) { Scalar::F64 } else { property.scalar };
        columns.push(Column { name: property.name.clone(), scalar, offset, stride: 0 });
        tokens.push(Token::Store(scalar));
        offset += scalar.size();
    }
    let rows = Rows { tokens: &tokens, count: Some(vertex.count), counts_between: false };
    let (records, count) = rows.parse_and_show(job, start, PACKING, |records, count| {
        packed_table(records, count, false, columns.clone(), offset).preview(job, "header")
    })?;
    packed_table(&records, count, false, columns, offset).into_cloud(job, "header")
}

/// The fast path: records of equal length form a table in the file itself.
fn plain(
    job: &Job<'_>,
    header: &Header,
    before: &[Element],
    vertex: &Element,
    stride: usize,
) -> Result<PointCloud, Error> {
    let start = skip(job, header, before, vertex)?;
    let bytes = &job.bytes[start..];
    if vertex.count.checked_mul(stride).is_none_or(|needed| needed > bytes.len()) {
        let complete = bytes.len() / stride.max(1);
        return Err(job.malformed(
            format!("byte {}", job.bytes.len()),
            format!("the file ends after {complete} of {} points; it is cut off, copy it again", vertex.count),
        ));
    }
    let mut offset = 0;
    let columns = vertex.properties.iter().map(|property| {
        offset += property.scalar.size();
        Column { name: property.name.clone(), scalar: property.scalar, offset: offset - property.scalar.size(), stride }
    });
    let columns = columns.collect();
    let big_endian = header.encoding == Encoding::Big;
    let table = Table { bytes, count: vertex.count, big_endian, columns, packed_rgb: false, done: 0.0 };
    table.preview(job, "header")?;
    table.into_cloud(job, "header")
}

/// Lists make records of unequal length, so the other values are packed first.
fn with_lists(job: &Job<'_>, header: &Header, before: &[Element], vertex: &Element) -> Result<PointCloud, Error> {
    let start = skip(job, header, before, vertex)?;
    let mut columns = Vec::new();
    let mut stride = 0;
    for property in vertex.properties.iter().filter(|property| property.list.is_none()) {
        columns.push(Column { name: property.name.clone(), scalar: property.scalar, offset: stride, stride: 0 });
        stride += property.scalar.size();
    }
    let mut records = Vec::new();
    walk(job, header, vertex, start, PACKING, |bytes| {
        reserve(&mut records, bytes.len(), "points with lists")?;
        records.extend_from_slice(bytes);
        Ok(())
    })?;
    let big_endian = header.encoding == Encoding::Big;
    let table = packed_table(&records, vertex.count, big_endian, columns, stride);
    table.preview(job, "header")?;
    table.into_cloud(job, "header")
}

fn packed_table(bytes: &[u8], count: usize, big_endian: bool, mut columns: Vec<Column>, stride: usize) -> Table<'_> {
    for column in &mut columns {
        column.stride = stride;
    }
    Table { bytes, count, big_endian, columns, packed_rgb: false, done: PACKING.start + PACKING.len }
}
