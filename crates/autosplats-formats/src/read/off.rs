//! OFF text: vertices with optional normals and colours, and faces.

use std::ops::Range;

use autosplats_cloud::{Contents, Error, excerpt};

use super::{
    Attribute, Description, Format, Job, lines,
    mesh::Faces,
    table::{Column, ProgressRange, Scalar, Table},
    text::{self, Rows, Token},
};

pub(super) const FORMAT: Format = Format {
    name: "OFF",
    extensions: &["off", "coff", "noff"],
    recognised: |bytes| {
        let start = &bytes[..bytes.len().min(16)];
        let word = start.split(u8::is_ascii_whitespace).next().unwrap_or_default();
        word.len() < 16 && Kind::of(word).is_some()
    },
    sensor_frame: false,
    describe,
    read,
};

const PARSING: ProgressRange = ProgressRange { start: 0.0, len: 0.8 };

/// What a vertex has besides its position, according to the first word of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Kind {
    texture: bool,
    color: bool,
    normal: bool,
    /// Points of any number of dimensions.
    many: bool,
}

impl Kind {
    /// The kind that a word ending in OFF names.
    fn of(word: &[u8]) -> Option<Self> {
        let mut rest = word.strip_suffix(b"OFF")?;
        let mut kind = Self::default();
        while let [first, after @ ..] = rest {
            rest = after;
            match first {
                b'S' => {
                    rest = after.strip_prefix(b"T")?;
                    kind.texture = true;
                }
                b'C' => kind.color = true,
                b'N' => kind.normal = true,
                b'4' | b'n' => kind.many = true,
                _ => return None,
            }
        }
        Some(kind)
    }

    fn name(self) -> String {
        let part = |has: bool, name| if has { name } else { "" };
        part(self.texture, "ST").to_owned() + part(self.color, "C") + part(self.normal, "N") + "OFF"
    }
}

struct Header {
    kind: Kind,
    vertices: usize,
    faces: usize,
    /// First byte after the counts.
    end: usize,
}

impl Header {
    fn parse(job: &Job<'_>) -> Result<Self, Error> {
        if job.bytes.is_empty() {
            return Err(job.malformed("byte 0", "the file is empty; copy it again"));
        }
        let whole = 0..job.bytes.len();
        let mut kind = None;
        for (at, line) in lines::lines(job.bytes, &whole) {
            let fail = |what: String| job.malformed(job.line(at), what);
            let line = line.split(|&byte| byte == b'#').next().unwrap_or_default();
            let mut words = text::values(line).peekable();
            if kind.is_none() {
                // The first word is optional.
                let found = words.peek().and_then(|word| Kind::of(word));
                if found.is_some() {
                    words.next();
                }
                kind = Some(found.unwrap_or_default());
                if words.peek().is_some_and(|word| word.eq_ignore_ascii_case(b"BINARY")) {
                    return Err(job.unsupported("binary OFF; save the mesh as OFF text or PLY"));
                }
                if found.is_some_and(|kind| kind.many) {
                    return Err(job.unsupported("points of other than three dimensions; save the mesh as PLY"));
                }
                if words.peek().is_none() {
                    continue;
                }
                if found.is_none() && words.peek().is_some_and(|word| !text::is_count(word)) {
                    return Err(fail(
                        "an OFF file begins with the word OFF and the counts of vertices and faces".into(),
                    ));
                }
            }
            let mut count = |what| match words.next() {
                None => Err(fail(format!("the count of {what} is missing"))),
                Some(word) => std::str::from_utf8(word)
                    .ok()
                    .and_then(|word| word.parse::<usize>().ok())
                    .ok_or_else(|| fail(format!("'{}' is not a count of {what}", excerpt(word)))),
            };
            let (vertices, faces) = (count("vertices")?, count("faces")?);
            let end = text::after_line_end(job.bytes, at);
            // The shortest vertex is "0 0 0" and a line end, and the last line end may be missing.
            if vertices.checked_mul(6).is_none_or(|bytes| bytes > job.bytes.len() - end + 1) {
                let size = job.bytes.len();
                return Err(fail(format!(
                    "{vertices} vertices cannot be in a file of {size} bytes; correct the count or copy the file again"
                )));
            }
            return Ok(Self { kind: kind.unwrap_or_default(), vertices, faces, end });
        }
        Err(job.malformed(job.line(job.bytes.len()), "the file ends before the counts of vertices and faces"))
    }

    /// Meaning of the numbers of a vertex, by the file's first word and the first row.
    fn tokens(&self, job: &Job<'_>) -> Result<Vec<(&'static str, Token)>, Error> {
        let rest = self.end..job.bytes.len();
        let mut tokens = ["x", "y", "z"].map(|axis| (axis, Token::Store(Scalar::F64))).to_vec();
        let first = lines::lines(job.bytes, &rest).next().filter(|_| self.vertices > 0);
        let Some((at, first)) = first else { return Ok(tokens) };
        let width = text::values(first).count();
        let Kind { texture, color, normal, .. } = self.kind;
        let (normals, textures) = (if normal { 3 } else { 0 }, if texture { 2 } else { 0 });
        let Some(others) = width.checked_sub(3 + normals + textures) else {
            let name = self.kind.name();
            return Err(job.malformed(job.line(at), format!("{width} values are too few for a vertex of {name}")));
        };
        if normal {
            tokens.extend(["NormalX", "NormalY", "NormalZ"].map(|axis| (axis, Token::Store(Scalar::F32))));
        }
        // Many files have colours that their first word does not announce.
        if matches!(others, 3 | 4) && (color || !texture) {
            tokens.extend(["red", "green", "blue"].map(|channel| (channel, Token::Store(Scalar::F32))));
        }
        if self.kind.color && others == 0 {
            return Err(
                job.malformed(job.line(at), format!("{width} values: there is no colour, though the file is a COFF"))
            );
        }
        tokens.resize(width.min(super::table::MAX_COLUMNS), ("", Token::Skip));
        Ok(tokens)
    }
}

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let header = Header::parse(job)?;
    let stored = |&(name, token): &(&str, Token)| match token {
        Token::Store(_) => Some(Attribute::new(name, "text")),
        _ => None,
    };
    Ok(Description {
        format: format!("{}, text", header.kind.name()),
        points: Some(header.vertices as u64),
        faces: Some(header.faces as u64),
        attributes: header.tokens(job)?.iter().filter_map(stored).collect(),
        ..Description::default()
    })
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    let header = Header::parse(job)?;
    if !job.bytes[header.end..].contains(&b'#') {
        return read_rows(job, &header);
    }
    // Comments may follow the numbers of a line. Replacing them by blanks keeps the position of every line.
    let mut comment = false;
    let blank = |&byte: &u8| {
        comment = byte != b'\n' && (comment || byte == b'#');
        if comment { b' ' } else { byte }
    };
    job.check_memory(job.bytes.len(), 1)?;
    let bytes: Vec<u8> = job.bytes.iter().map(blank).collect();
    read_rows(&Job { bytes: &bytes, ..*job }, &header)
}

fn read_rows(job: &Job<'_>, header: &Header) -> Result<Contents, Error> {
    let (names, tokens): (Vec<_>, Vec<_>) = header.tokens(job)?.into_iter().unzip();
    let rows = Rows { tokens: &tokens, count: Some(header.vertices), may_be_cut: false };
    let stride = tokens.iter().map(|token| token.size()).sum();
    let mut offset = 0;
    let mut columns = Vec::new();
    for (name, token) in names.into_iter().zip(&tokens) {
        if let &Token::Store(scalar) = token {
            columns.push(Column { name: name.into(), scalar, offset, stride });
        }
        offset += token.size();
    }
    let done = PARSING.len;
    let (records, count) = rows.parse_and_show(job, header.end, PARSING, |bytes, count| {
        let columns = columns.clone();
        Table { bytes, count, big_endian: false, columns, packed_rgb: false, done }.preview(job, "vertices")
    })?;
    let table = Table { bytes: &records, count, big_endian: false, columns, packed_rgb: false, done };
    let cloud = table.into_cloud(job, "vertices")?;
    let triangles = if job.triangles { triangles(job, header)? } else { Vec::new() };
    Ok(Contents { cloud, triangles })
}

fn triangles(job: &Job<'_>, header: &Header) -> Result<Vec<[u32; 3]>, Error> {
    let part = ProgressRange { start: 1.0, len: 0.0 };
    let start = lines::skip_lines(job, header.end, header.vertices)?.unwrap_or(job.bytes.len());
    let Some(end) = lines::skip_lines(job, start, header.faces)? else {
        let complete = lines::lines(job.bytes, &(start..job.bytes.len())).count();
        return Err(job.malformed(
            job.line(job.bytes.len()),
            format!("the file ends after {complete} of {} faces; it is cut off, copy it again", header.faces),
        ));
    };
    job.check_memory(header.faces, 12)?;
    let parse = |range: Range<usize>| {
        let mut faces = Faces::new(header.vertices);
        let mut corners = Vec::new();
        for (at, line) in lines::lines(job.bytes, &range) {
            row(line, &mut corners).map_err(|what| job.malformed(job.line(at), what))?;
            faces.polygon(&corners)?;
        }
        Ok(faces)
    };
    let mut faces = Faces::new(header.vertices);
    lines::in_pieces(job, start..end, part, parse, |piece: Result<Faces, Error>| faces.append(piece?))?;
    Ok(faces.finish(job))
}

/// Parses a face: the count of corners, the corners, and perhaps a colour.
fn row(line: &[u8], corners: &mut Vec<i64>) -> Result<(), String> {
    corners.clear();
    let mut values = text::values(line);
    let count = values.next().map_or(Ok(0.0), text::number)? as usize;
    for _ in 0..count {
        let value = values.next();
        let value = value.ok_or_else(|| format!("a face of {count} corners has only {}", corners.len()))?;
        let number = text::number(value)?;
        corners.push(if number.fract() == 0.0 { number as i64 } else { -1 });
    }
    Ok(())
}
