//! The header of a PCD file.

use autosplats_cloud::{Axes, Error, excerpt};
use glam::{DMat4, DQuat, DVec3, DVec4};

use super::super::{
    Job, MAX_HEADER_LINE,
    table::Scalar,
    text::{self, after_line_end, line_end},
};

/// Encoding of the values after the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

impl Encoding {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Ascii => "ascii",
            Self::Binary => "binary",
            Self::Compressed => "binary, compressed",
        }
    }
}

/// A named number, or `count` numbers, of each point.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    pub(super) count: usize,
}

/// Pose of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Viewpoint {
    /// At the origin, unrotated. Programs that do not know the pose write this too.
    Identity,
    /// Elsewhere.
    At(DMat4),
    /// Not a valid pose.
    Broken,
}

impl Viewpoint {
    /// Parses tx ty tz qw qx qy qz.
    fn of(values: &[String]) -> Self {
        let values: Option<Vec<f64>> = values.iter().map(|value| value.parse().ok()).collect();
        let Some(&[x, y, z, qw, qx, qy, qz]) = values.as_deref() else { return Self::Broken };
        let (place, turn) = (DVec3::new(x, y, z), DVec4::new(qx, qy, qz, qw));
        let length = turn.length();
        if !place.is_finite() || !(1e-6..1e6).contains(&length) {
            return Self::Broken;
        }
        let turn = DQuat::from_vec4(turn / length);
        if place == DVec3::ZERO && turn.w.abs() == 1.0 {
            return Self::Identity;
        }
        Self::At(DMat4::from_rotation_translation(turn, place))
    }
}

/// Contents of the header.
pub(super) struct Header {
    pub(super) fields: Vec<Field>,
    pub(super) width: Option<usize>,
    pub(super) height: usize,
    pub(super) points: usize,
    pub(super) encoding: Encoding,
    pub(super) viewpoint: Viewpoint,
    /// Axes, which only files of this project state, in a comment.
    pub(super) axes: Option<Axes>,
    /// Whether an identity viewpoint is the sensor's true pose; files of this project state it in a comment.
    pub(super) knows_sensor: bool,
    /// Place and words of the first thing in the header that the format does not know.
    odd: Option<(String, String)>,
    /// First byte after the header.
    pub(super) end: usize,
}

/// The words of a header line. A line of broken text has no known words.
fn words(line: &[u8]) -> Vec<String> {
    String::from_utf8_lossy(line).split_ascii_whitespace().map(str::to_owned).collect()
}

impl Header {
    pub(super) fn parse(job: &Job<'_>) -> Result<Self, Error> {
        if job.bytes.is_empty() {
            return Err(job.malformed("byte 0", "the file is empty; copy it again"));
        }
        let (mut names, mut sizes, mut types, mut counts) = (None, None, None, None);
        let (mut width, mut height, mut points) = (None, None, None);
        let mut viewpoint = Viewpoint::Identity;
        let (mut axes, mut knows_sensor, mut odd) = (None, false, None);
        let mut seen = false;
        let (mut at, mut line) = (0, 0);
        let (encoding, line) = loop {
            line += 1;
            let place = format!("line {line}");
            let fail = |what: String| job.malformed(place.clone(), what);
            if at >= job.bytes.len() {
                return Err(fail("the file ends inside the header, before DATA; copy it again".into()));
            }
            // A longer line is refused, whatever follows.
            let end = line_end(&job.bytes[..job.bytes.len().min(at + MAX_HEADER_LINE + 1)], at);
            if end - at > MAX_HEADER_LINE {
                return Err(fail(format!("a header line of more than {MAX_HEADER_LINE} bytes")));
            }
            let words = words(&job.bytes[at..end]);
            at = after_line_end(job.bytes, at);
            let Some((keyword, values)) = words.split_first() else { continue };
            let begun = seen;
            seen |= !keyword.starts_with('#');
            let number = || {
                let value = values.first().map_or("", String::as_str);
                value
                    .parse::<usize>()
                    .map_err(|_| fail(format!("{keyword} '{}' is invalid", excerpt(value.as_bytes()))))
            };
            match keyword.to_ascii_uppercase().as_str() {
                "VERSION" => {}
                "FIELDS" | "COLUMNS" => names = Some(values.to_vec()),
                "SIZE" => sizes = Some(values.to_vec()),
                "TYPE" => types = Some(values.to_vec()),
                "COUNT" => counts = Some(values.to_vec()),
                "WIDTH" => width = Some(number()?),
                "HEIGHT" => height = Some(number()?),
                "POINTS" => points = Some(number()?),
                "VIEWPOINT" => viewpoint = Viewpoint::of(values),
                "DATA" => match values.first().map(|value| value.to_ascii_lowercase()).as_deref() {
                    Some("ascii") => break (Encoding::Ascii, place),
                    Some("binary") => break (Encoding::Binary, place),
                    Some("binary_compressed") => break (Encoding::Compressed, place),
                    other => {
                        return Err(fail(format!("unknown DATA '{}'", excerpt(other.unwrap_or_default().as_bytes()))));
                    }
                },
                "#" if values.first().is_some_and(|word| word == "axes") => {
                    axes = values.get(1).and_then(|word| Axes::from_name(word)).or(axes);
                }
                "#" if values == ["sensor", "at", "VIEWPOINT"] => knows_sensor = true,
                word if word.starts_with('#') => {}
                word if begun && word.starts_with(char::is_alphabetic) => {
                    let what = || format!("'{}' is not a PCD header keyword; skipped", excerpt(keyword.as_bytes()));
                    odd.get_or_insert_with(|| (place.clone(), what()));
                }
                word => {
                    let word = excerpt(word.as_bytes());
                    let what = format!("'{word}' is not a PCD header keyword; if the file is plain text, name it .xyz");
                    return Err(fail(what));
                }
            }
        };
        let fail = |what: String| job.malformed(line.clone(), what);
        let Some(names) = names else { return Err(fail("the header lacks FIELDS".into())) };
        let (sizes, types) = match (sizes, types) {
            (Some(sizes), Some(types)) => (sizes, types),
            (None, None) => {
                // Files of version 0.5 hold floats.
                let what = "SIZE and TYPE are missing, as in version 0.5; taken for 32-bit floats";
                odd.get_or_insert_with(|| (line.clone(), what.to_owned()));
                (vec!["4".to_owned(); names.len()], vec!["F".to_owned(); names.len()])
            }
            _ => return Err(fail("the header lacks SIZE or TYPE".into())),
        };
        let counts = counts.unwrap_or_else(|| vec!["1".into(); names.len()]);
        if [sizes.len(), types.len(), counts.len()] != [names.len(); 3] {
            return Err(fail("FIELDS, SIZE, TYPE and COUNT differ in length".into()));
        }
        let fields =
            names.into_iter().zip(sizes.iter().zip(&types)).zip(&counts).map(|((name, (size, kind)), count)| {
                let scalar = scalar_of(kind, size).ok_or_else(|| {
                    fail(format!("no type {} of {} bytes", excerpt(kind.as_bytes()), excerpt(size.as_bytes())))
                })?;
                let count =
                    count.parse().map_err(|_| fail(format!("COUNT '{}' is invalid", excerpt(count.as_bytes()))))?;
                Ok(Field { name, scalar, count })
            });
        let fields = fields.collect::<Result<_, Error>>()?;
        let height = height.unwrap_or(1);
        let points = points
            .or_else(|| width?.checked_mul(height))
            .ok_or_else(|| fail("the header lacks POINTS, or WIDTH and HEIGHT".into()))?;
        let end = after_extension(job.bytes, at, encoding == Encoding::Ascii);
        if end > at {
            odd.get_or_insert_with(|| (line, "lines between the header and the points are skipped".into()));
        }
        Ok(Self { fields, width, height, points, encoding, viewpoint, axes, knows_sensor, odd, end })
    }

    /// Tells what the header has that the format does not know. What is skipped may be a misspelt keyword, so a binary
    /// file has to be as long as the rest says.
    pub(super) fn tell_odd(&self, job: &Job<'_>) -> Result<(), Error> {
        let Some((place, what)) = &self.odd else { return Ok(()) };
        let len = self.stride().and_then(|stride| stride.checked_mul(self.points)?.checked_add(self.end));
        if self.encoding == Encoding::Binary && len != Some(job.bytes.len()) {
            return Err(job.malformed(place, format!("{what}; the file is not as long as its header then says")));
        }
        job.note(format!("{place}: {what}"));
        Ok(())
    }

    /// Bytes of a point.
    pub(super) fn stride(&self) -> Option<usize> {
        self.fields
            .iter()
            .try_fold(0_usize, |sum, field| sum.checked_add(field.scalar.size().checked_mul(field.count)?))
    }
}

/// The first byte after lines that some programs put between header and points: a block between HEADER_EXT_START and
/// HEADER_EXT_END, or in text any lines that begin with a word.
fn after_extension(bytes: &[u8], start: usize, text: bool) -> usize {
    let mut at = start;
    let mut inside = false;
    while at < bytes.len() {
        let line = bytes[at..line_end(bytes, at)].trim_ascii();
        inside |= line.starts_with(b"HEADER_EXT_START");
        let word = text && line.first().is_some_and(u8::is_ascii_alphabetic) && !starts_with_number(line);
        if !inside && !word {
            break;
        }
        at = after_line_end(bytes, at);
        inside &= !line.starts_with(b"HEADER_EXT_END");
    }
    // A block without an end is none.
    if inside { start } else { at }
}

/// Whether a line begins with `nan` or `inf`.
fn starts_with_number(line: &[u8]) -> bool {
    text::values(line).next().is_some_and(|value| text::number(value).is_ok())
}

fn scalar_of(kind: &str, size: &str) -> Option<Scalar> {
    Some(match (kind.to_ascii_uppercase().as_str(), size) {
        ("I", "1") => Scalar::I8,
        ("U", "1") => Scalar::U8,
        ("I", "2") => Scalar::I16,
        ("U", "2") => Scalar::U16,
        ("I", "4") => Scalar::I32,
        ("U", "4") => Scalar::U32,
        ("I", "8") => Scalar::I64,
        ("U", "8") => Scalar::U64,
        ("F", "4") => Scalar::F32,
        ("F", "8") => Scalar::F64,
        _ => return None,
    })
}

/// Whether the file begins with a PCD header; comments are skipped.
pub(super) fn recognised(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(1 << 12)];
    let first = start.split(|&byte| byte == b'\n').map(words).find(|words| {
        let first = words.first().map_or("#", String::as_str);
        !first.starts_with('#')
    });
    let Some(first) = first else { return start.starts_with(b"# .PCD") };
    matches!(first[0].as_str(), "VERSION" | "FIELDS" | "COLUMNS")
}
