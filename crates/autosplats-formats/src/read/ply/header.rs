//! The header of a PLY file.

use autosplats_cloud::{Axes, Error, excerpt};

use super::super::{Job, MAX_HEADER_LINE, table::Scalar};

/// Encoding of the values after the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

impl Encoding {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Ascii => "ascii",
            Self::Little => "binary little endian",
            Self::Big => "binary big endian",
        }
    }
}

/// One value of an element, or a list of values.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    /// Type of the count, if the property is a list.
    pub(super) list: Option<Scalar>,
}

/// A sequence of equal records, such as vertices or faces.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Bytes of a record, if the element has no list.
    pub(super) fn stride(&self) -> Option<usize> {
        self.properties
            .iter()
            .map(|property| property.list.is_none().then(|| property.scalar.size()))
            .sum::<Option<usize>>()
    }
}

/// Contents of the header.
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    pub(super) axes: Option<Axes>,
    /// Number and first word of the first line that begins with an unknown word.
    pub(super) unknown: Option<(usize, String)>,
    /// First byte after the header.
    pub(super) end: usize,
}

impl Header {
    pub(super) fn parse(job: &Job<'_>) -> Result<Self, Error> {
        let bytes = job.bytes;
        if bytes.is_empty() {
            return Err(job.malformed("byte 0", "the file is empty; copy it again"));
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let (mut axes, mut unknown) = (None, None);
        let mut start = 0;
        for number in 1.. {
            let fail = |what: String| job.malformed(format!("line {number}"), what);
            if start >= bytes.len() {
                return Err(fail("the file ends inside the header, before end_header; copy it again".into()));
            }
            let (line, next) = header_line(bytes, start);
            start = next;
            if line.len() > MAX_HEADER_LINE {
                return Err(fail(format!("a header line of more than {MAX_HEADER_LINE} bytes")));
            }
            let line = String::from_utf8_lossy(line);
            let mut words = line.split_ascii_whitespace();
            let word = words.next();
            if number == 1 {
                if word != Some("ply") {
                    return Err(fail("a PLY file begins with a line 'ply'".into()));
                }
                continue;
            }
            match word {
                None | Some("obj_info") => {}
                Some("comment") => {
                    if words.next() == Some("axes") {
                        axes = words.next().and_then(Axes::from_name).or(axes);
                    }
                }
                Some("format") => {
                    encoding = Some(match words.next() {
                        Some("ascii") => Encoding::Ascii,
                        Some("binary_little_endian") => Encoding::Little,
                        Some("binary_big_endian") => Encoding::Big,
                        other => {
                            return Err(fail(format!(
                                "unknown format '{}'",
                                excerpt(other.unwrap_or_default().as_bytes())
                            )));
                        }
                    });
                }
                Some("element") => {
                    let (Some(name), Some(count)) = (words.next(), words.next()) else {
                        return Err(fail("an element needs a name and a count".into()));
                    };
                    let count =
                        count.parse().map_err(|_| fail(format!("'{}' is not a count", excerpt(count.as_bytes()))))?;
                    elements.push(Element { name: name.into(), count, properties: Vec::new() });
                }
                Some("property") => {
                    let element = elements.last_mut().ok_or_else(|| fail("a property before any element".into()))?;
                    element.properties.push(property(&mut words).map_err(fail)?);
                }
                Some("end_header") => break,
                Some(other) => {
                    unknown.get_or_insert_with(|| (number, excerpt(other.as_bytes())));
                }
            }
        }
        let encoding = encoding.ok_or_else(|| job.malformed("header", "no line 'format'"))?;
        Ok(Self { encoding, elements, axes, unknown, end: start })
    }
}

/// A line of the header, and the start of the next. Lines end in LF, CR LF or, in old files, a bare CR.
fn header_line(bytes: &[u8], start: usize) -> (&[u8], usize) {
    // A longer line is refused, whatever follows.
    let rest = &bytes[start..bytes.len().min(start + MAX_HEADER_LINE + 2)];
    let end = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(rest.len());
    let ending = if rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
    (&rest[..end], (start + end + ending).min(bytes.len()))
}

fn property<'a>(words: &mut impl Iterator<Item = &'a str>) -> Result<Property, String> {
    let mut scalar = |what: &str| {
        let word = words.next().ok_or_else(|| format!("a property without {what}"))?;
        if word == "list" {
            Ok(None)
        } else {
            scalar_of(word).map(Some).ok_or_else(|| format!("unknown type '{}'", excerpt(word.as_bytes())))
        }
    };
    let nested = "a list of lists";
    let (scalar, list) = match scalar("a type")? {
        Some(single) => (single, None),
        None => {
            let count = scalar("the type of its count")?.ok_or(nested)?;
            if matches!(count, Scalar::F32 | Scalar::F64) {
                return Err("the count of a list must be an integer".into());
            }
            (scalar("a type")?.ok_or(nested)?, Some(count))
        }
    };
    let name = words.next().ok_or("a property without a name")?.into();
    Ok(Property { name, scalar, list })
}

fn scalar_of(word: &str) -> Option<Scalar> {
    Some(match word {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "int64" => Scalar::I64,
        "uint64" => Scalar::U64,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}
