//! OBJ: vertices with optional colours, and faces. Groups, materials, texture coordinates and normals of face corners
//! are ignored, because they do not describe points.

use std::ops::Range;

use autosplats_cloud::{Contents, Error};

use super::{
    Attribute, Description, Format, Job, lines,
    mesh::{self, Faces},
    table::{ProgressRange, reserve},
    text,
};
use crate::color_scale::ColorScale;

pub(super) const FORMAT: Format =
    Format { name: "OBJ", extensions: &["obj"], recognised: |_| false, sensor_frame: false, describe, read };

const PARSING: ProgressRange = ProgressRange { start: 0.0, len: 0.8 };

/// Mark of a vertex without a colour, which becomes white if others have one.
const WHITE: [f32; 4] = [f32::NAN; 4];

/// Largest file, in bytes, that a description counts through; counting then takes milliseconds.
const MAX_COUNTED_BYTES: usize = 4 << 20;

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    check_text(job)?;
    let range = 0..job.bytes.len().min(MAX_COUNTED_BYTES);
    let (mut points, mut faces, mut width) = (0, 0, 0);
    for (_, line) in lines::lines(job.bytes, &range) {
        match split(line) {
            (b"v", rest) => {
                points += 1;
                width = width.max(text::values(rest).count());
            }
            (b"f", _) => faces += 1,
            _ => {}
        }
    }
    let names = ["x", "y", "z", "red", "green", "blue"];
    let all = range.end == job.bytes.len();
    Ok(Description {
        format: "OBJ".into(),
        points: all.then_some(points),
        faces: all.then_some(faces),
        attributes: names[..if width >= 6 { 6 } else { 3 }].iter().map(|&name| Attribute::new(name, "text")).collect(),
        ..Description::default()
    })
}

fn check_text(job: &Job<'_>) -> Result<(), Error> {
    if job.bytes.is_empty() {
        return Err(job.malformed("byte 0", "the file is empty; copy it again"));
    }
    match job.bytes[..job.bytes.len().min(1 << 16)].iter().position(|&byte| byte == 0) {
        Some(at) => Err(job.malformed(format!("byte {at}"), "this is not text, so not an OBJ mesh; save it as one")),
        None => Ok(()),
    }
}

/// The first word of a line, and the rest.
fn split(line: &[u8]) -> (&[u8], &[u8]) {
    line.split_at(line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len()))
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    check_text(job)?;
    let mut mesh = Mesh::default();
    let mut faces = Faces::new(0);
    let parse = |range: Range<usize>| Piece::parse(job, range);
    lines::in_pieces(job, 0..job.bytes.len(), PARSING, parse, |piece| mesh.append(job, piece, &mut faces))?;
    if mesh.positions.is_empty() {
        return Err(job.malformed(job.line(job.bytes.len()), "there is no vertex, a line 'v x y z', in this OBJ file"));
    }
    if mesh.curves > 0 {
        job.note(format!("{} curves and curved surfaces; left out", mesh.curves));
    }
    let mut cloud = mesh::cloud(job, &mesh.positions, PARSING.len)?;
    if !mesh.colors.is_empty() {
        if mesh.uncolored > 0 {
            job.note(format!("{} vertices have no colour, while others do; taken for white", mesh.uncolored));
        }
        let color = |i: usize| match mesh.colors[i] {
            [_, red, green, blue] if !mesh.unweighted && !blue.is_nan() => [red, green, blue],
            [red, green, blue, _] => [red, green, blue],
        };
        let scale = ColorScale::of(mesh.colors.len(), true, |i| color(i).map(f64::from));
        scale.note().iter().for_each(|note| job.note(note));
        let part = |value: f32| if value.is_nan() { 1.0 } else { value / scale.full() as f32 };
        cloud = mesh::with_colors(job, cloud, |i| color(i).map(part))?;
    }
    // Faces that precede their vertices.
    faces.set_points(mesh.positions.len());
    let mut start = 0;
    for end in mesh.ends {
        faces.polygon(&mesh.corners[start..end])?;
        start = end;
    }
    Ok(Contents { cloud, triangles: faces.finish(job) })
}

/// All pieces joined.
#[derive(Default)]
struct Mesh {
    positions: Vec<[f64; 3]>,
    /// Numbers of a colour, one per vertex, or empty.
    colors: Vec<[f32; 4]>,
    uncolored: usize,
    /// Whether the fourth number of a vertex of seven is a colour, not a weight of 1.
    unweighted: bool,
    curves: usize,
    /// Corners of the faces that precede their vertices, and the end of each such face among them.
    corners: Vec<i64>,
    ends: Vec<usize>,
}

impl Mesh {
    fn append(&mut self, job: &Job<'_>, piece: Piece, faces: &mut Faces) -> Result<(), Error> {
        if let Some((at, what)) = piece.error {
            return Err(job.malformed(job.line(at), what));
        }
        let before = self.positions.len();
        let known = before + piece.positions.len();
        reserve(&mut self.positions, piece.positions.len(), "the vertices of an OBJ file")?;
        self.positions.extend_from_slice(&piece.positions);
        self.curves += piece.curves;
        self.uncolored += piece.uncolored;
        self.unweighted |= piece.unweighted;
        if !(self.colors.is_empty() && piece.colors.is_empty()) {
            let missing = known - self.colors.len();
            reserve(&mut self.colors, missing, "the colours of an OBJ file")?;
            self.colors.resize(before, WHITE);
            self.colors.extend_from_slice(&piece.colors);
            self.colors.resize(known, WHITE);
        }
        faces.set_points(known);
        let mut corners = piece.corners;
        let mut start = 0;
        for end in piece.ends {
            let face = &mut corners[start..end];
            start = end;
            face.iter_mut().for_each(|corner| *corner = resolve(*corner, before));
            if face.iter().all(|corner| (0..=u32::MAX.into()).contains(corner))
                && face.iter().any(|&corner| corner >= known as i64)
            {
                reserve(&mut self.corners, face.len(), "the faces of an OBJ file")?;
                self.corners.extend_from_slice(face);
                self.ends.push(self.corners.len());
            } else {
                faces.polygon(face)?;
            }
        }
        Ok(())
    }
}

/// Offset that marks a corner counted from the piece's first vertex, whose index is unknown while the piece is parsed.
const RELATIVE: i64 = 1 << 60;

fn resolve(corner: i64, before: usize) -> i64 {
    // Marked corners are within 2^40 of the mark, others far below it.
    if corner > RELATIVE / 2 { corner - RELATIVE + before as i64 } else { corner }
}

/// Result of parsing one piece of text.
#[derive(Default)]
struct Piece {
    positions: Vec<[f64; 3]>,
    /// Numbers of a colour, one per vertex, up to the last vertex that has a colour.
    colors: Vec<[f32; 4]>,
    uncolored: usize,
    unweighted: bool,
    curves: usize,
    corners: Vec<i64>,
    /// End of each face among the corners.
    ends: Vec<usize>,
    error: Option<(usize, String)>,
}

impl Piece {
    fn parse(job: &Job<'_>, range: Range<usize>) -> Self {
        let mut piece = Self::default();
        let mut joined: Vec<u8> = Vec::new();
        for (at, line) in lines::lines(job.bytes, &range) {
            if let Some(continued) = line.strip_suffix(b"\\") {
                joined.extend_from_slice(continued);
                joined.push(b' ');
                continue;
            }
            let outcome = if joined.is_empty() {
                piece.line(line, job.triangles)
            } else {
                joined.extend_from_slice(line);
                let outcome = piece.line(&joined, job.triangles);
                joined.clear();
                outcome
            };
            if let Err(what) = outcome {
                piece.error = Some((at, what));
                break;
            }
        }
        piece
    }

    fn line(&mut self, line: &[u8], triangles: bool) -> Result<(), String> {
        match split(line) {
            (b"v", rest) => self.vertex(rest),
            (b"f" | b"fo", rest) => {
                if triangles {
                    self.face(rest);
                }
                Ok(())
            }
            (b"curv" | b"curv2" | b"surf", _) => {
                self.curves += 1;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn vertex(&mut self, rest: &[u8]) -> Result<(), String> {
        let mut numbers = [0.0; 7];
        let mut len = 0;
        for value in text::values(rest).take(7) {
            numbers[len] = text::number(value)?;
            len += 1;
        }
        let [x, y, z, a, b, c, d] = numbers;
        if len < 3 {
            return Err(format!("{len} values where a vertex has x, y and z; complete or remove the line"));
        }
        // The fourth of four numbers is a weight, which only curves use; of seven it is one if all are 1.
        if matches!(len, 6 | 7) {
            self.colors.resize(self.positions.len(), WHITE);
            self.colors.push([a, b, c, if len == 7 { d } else { f64::NAN }].map(|value| value as f32));
            self.unweighted |= len == 7 && a != 1.0;
        } else {
            self.uncolored += 1;
        }
        self.positions.push([x, y, z]);
        Ok(())
    }

    fn face(&mut self, rest: &[u8]) {
        let vertices = self.positions.len() as i64;
        let words = rest.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        self.corners.extend(words.map(|word| {
            let digits = word.split(|&byte| byte == b'/').next().unwrap_or_default();
            let index = std::str::from_utf8(digits).ok().and_then(|digits| digits.parse::<i64>().ok());
            match index {
                Some(index @ 1..=0xff_ffff_ffff) => index - 1,
                Some(index @ -0xff_ffff_ffff..=-1) => RELATIVE + vertices + index,
                _ => -1,
            }
        }));
        self.ends.push(self.corners.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_told_apart() {
        assert_eq!(resolve(0xff_ffff_fffe, 7), 0xff_ffff_fffe, "the largest counted from the start");
        assert_eq!(resolve(RELATIVE - 1, 7), 6, "the last vertex of the piece before");
        assert_eq!(resolve(RELATIVE - 8, 7), -1, "before the first vertex of all");
        assert_eq!(resolve(-1, 7), -1, "no corner");
    }
}
