//! PLY: ascii and binary of both byte orders, with any properties in any order and further elements. Faces and triangle
//! strips are read on request.

mod faces;
mod header;
mod length;
pub(super) mod parts;
mod walk;

use autosplats_cloud::{Contents, Error, PointCloud, excerpt};

pub(super) use self::length::body;
use self::{
    header::{Element, Encoding, Header},
    walk::{Walked, skip, skip_rows, walk},
};
use super::{
    Attribute, Description, Format, Job,
    columns::unrepeated,
    records::Records,
    table::{Column, ProgressRange, Table, reserve},
    text::{TEXT, Token, is_coordinate},
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

/// Share of the work that packing lists into records takes.
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
        attributes: unrepeated(vertex.properties.iter().map(|p| Attribute::new(excerpt(p.name.as_bytes()), stored(p)))),
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

/// Fails if the points cannot be read, and tells what is odd about the file.
fn check(job: &Job<'_>, header: &Header, vertex: &Element) -> Result<(), Error> {
    check_unknown_lines(job, header)?;
    if vertex.properties.iter().any(|property| property.name == "packed_position") {
        return Err(job.unsupported("compressed 3D Gaussian splats; export them as an uncompressed PLY"));
    }
    if header.encoding == Encoding::Ascii { Ok(()) } else { job.check_not_text_converted(header.end) }
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    let header = Header::parse(job)?;
    let index = vertices(job, &header)?;
    let (before, vertex) = (&header.elements[..index], &header.elements[index]);
    check(job, &header, vertex)?;
    let cloud = match records(job, &header, before, vertex)? {
        Some(records) => records.into_cloud(job)?,
        None => with_lists(job, &header, before, vertex)?,
    };
    let cloud = match header.axes {
        Some(axes) => cloud.with_axes(axes),
        None => cloud,
    };
    let whole = cloud.len() == vertex.count;
    let triangles = if job.triangles && whole { faces::triangles(job, &header, cloud.len())? } else { Vec::new() };
    Ok(Contents { cloud, triangles })
}

/// Tells which lines of the header are skipped. Such a line may be a misspelt property, so a binary file has to be as
/// long as the others say.
fn check_unknown_lines(job: &Job<'_>, header: &Header) -> Result<(), Error> {
    let Some((line, word)) = &header.unknown else { return Ok(()) };
    if header.encoding != Encoding::Ascii && !length::fits(job)? {
        return Err(job.malformed(format!("line {line}"), format!("unknown word '{word}' in the header")));
    }
    job.note(format!("line {line} of the header begins with the unknown word '{word}'; such lines are skipped"));
    Ok(())
}

/// Where the records of the points are; `None` if lists make their lengths unequal.
fn records(job: &Job<'_>, header: &Header, before: &[Element], vertex: &Element) -> Result<Option<Records>, Error> {
    if header.encoding == Encoding::Ascii {
        let start = skip_rows(job, header, before, vertex)?;
        let (mut columns, mut tokens, mut stride) = (Vec::new(), Vec::new(), 0);
        for property in &vertex.properties {
            if property.list.is_some() {
                tokens.push(Token::SkipList);
                continue;
            }
            let (scalar, token) = Token::of(&property.name, property.scalar);
            columns.push(Column { name: property.name.clone(), scalar, offset: stride, stride: 0 });
            tokens.push(token);
            stride += token.size();
        }
        let (count, tokens) = (vertex.count, Some(tokens));
        return Ok(Some(Records { columns, start, count, stride, big_endian: false, tokens }));
    }
    let Some(stride) = vertex.stride() else { return Ok(None) };
    let start = skip(job, header, before, vertex)?;
    let count = vertex.count.min((job.bytes.len() - start) / stride.max(1));
    job.tell_cut_off(count, vertex.count, "points")?;
    let (columns, _) = columns(vertex);
    Ok(Some(Records { columns, start, count, stride, big_endian: header.encoding == Encoding::Big, tokens: None }))
}

/// The values of a binary record without its lists, and their bytes.
fn columns(vertex: &Element) -> (Vec<Column>, usize) {
    let (mut columns, mut stride) = (Vec::new(), 0);
    for property in vertex.properties.iter().filter(|property| property.list.is_none()) {
        columns.push(Column { name: property.name.clone(), scalar: property.scalar, offset: stride, stride: 0 });
        stride += property.scalar.size();
    }
    (columns, stride)
}

/// Lists make records of unequal length, so the other values are packed first.
fn with_lists(job: &Job<'_>, header: &Header, before: &[Element], vertex: &Element) -> Result<PointCloud, Error> {
    let start = skip(job, header, before, vertex)?;
    let (mut columns, stride) = columns(vertex);
    columns.iter_mut().for_each(|column| column.stride = stride);
    let mut records = Vec::new();
    let Walked { count, .. } = walk(job, header, vertex, start, PACKING, |bytes| {
        reserve(&mut records, bytes.len(), "points with lists")?;
        records.extend_from_slice(bytes);
        Ok(())
    })?;
    job.tell_cut_off(count, vertex.count, "points")?;
    let big_endian = header.encoding == Encoding::Big;
    let table =
        Table { bytes: &records, count, big_endian, columns, packed_rgb: true, done: PACKING.start + PACKING.len };
    table.preview(job, "header")?;
    table.into_cloud(job, "header")
}
