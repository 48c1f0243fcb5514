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
    walk::{Walked, skip, skip_rows, walk},
};
use super::{
    Attribute, Description, Format, Job,
    columns::unrepeated,
    table::{Column, ProgressRange, Table, reserve},
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

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    let header = Header::parse(job)?;
    let index = vertices(job, &header)?;
    let (before, vertex) = (&header.elements[..index], &header.elements[index]);
    check_unknown_lines(job, &header)?;
    if vertex.properties.iter().any(|property| property.name == "packed_position") {
        return Err(job.unsupported("compressed 3D Gaussian splats; export them as an uncompressed PLY"));
    }
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
        let (scalar, token) = Token::of(&property.name, property.scalar);
        columns.push(Column { name: property.name.clone(), scalar, offset, stride: 0 });
        tokens.push(token);
        offset += token.size();
    }
    let rows = Rows { tokens: &tokens, count: Some(vertex.count), may_be_cut: true };
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
    let count = vertex.count.min(bytes.len() / stride.max(1));
    job.tell_cut_off(count, vertex.count, "points")?;
    let mut offset = 0;
    let columns = vertex.properties.iter().map(|property| {
        offset += property.scalar.size();
        Column { name: property.name.clone(), scalar: property.scalar, offset: offset - property.scalar.size(), stride }
    });
    let columns = columns.collect();
    let big_endian = header.encoding == Encoding::Big;
    let table = Table { bytes, count, big_endian, columns, packed_rgb: true, done: 0.0 };
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
    let Walked { count, .. } = walk(job, header, vertex, start, PACKING, |bytes| {
        reserve(&mut records, bytes.len(), "points with lists")?;
        records.extend_from_slice(bytes);
        Ok(())
    })?;
    job.tell_cut_off(count, vertex.count, "points")?;
    let big_endian = header.encoding == Encoding::Big;
    let table = packed_table(&records, count, big_endian, columns, stride);
    table.preview(job, "header")?;
    table.into_cloud(job, "header")
}

fn packed_table(bytes: &[u8], count: usize, big_endian: bool, mut columns: Vec<Column>, stride: usize) -> Table<'_> {
    for column in &mut columns {
        column.stride = stride;
    }
    Table { bytes, count, big_endian, columns, packed_rgb: true, done: PACKING.start + PACKING.len }
}
