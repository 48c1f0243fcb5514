//! STL: triangles in text or binary, whose equal corners are welded to points.

use std::ops::Range;

use autosplats_cloud::{Contents, Error, excerpt};

use super::{
    Attribute, Description, Format, Job, lines,
    mesh::{self, Faces, Welded},
    table::{ProgressRange, collect, reserve},
    text,
};

pub(super) const FORMAT: Format = Format {
    name: "STL",
    extensions: &["stl"],
    recognised: |bytes| claimed(bytes).is_some_and(|count| count > 0 && fits(bytes, count)),
    sensor_frame: false,
    describe,
    read,
};

/// Bytes before the first triangle of a binary file: a text and the count of triangles.
const HEADER: usize = 84;

/// Bytes of a binary triangle: a normal, three corners and two unspecified bytes.
const FACET: usize = 50;

/// Shares of the work of parsing and of welding.
const PARSING: ProgressRange = ProgressRange { start: 0.0, len: 0.4 };
const WELDING: ProgressRange = ProgressRange { start: 0.4, len: 0.4 };

/// Largest file, in bytes, that a description counts through; counting then takes milliseconds.
const MAX_COUNTED_BYTES: usize = 4 << 20;

/// The count of triangles in the header of a binary file.
fn claimed(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER - 4..HEADER)?;
    usize::try_from(u32::from_le_bytes([count[0], count[1], count[2], count[3]])).ok()
}

/// Whether `count` triangles fill the file exactly. This test tells binary from text, because a binary file may begin
/// with the word that begins a text file.
fn fits(bytes: &[u8], count: usize) -> bool {
    count.checked_mul(FACET).and_then(|len| len.checked_add(HEADER)) == Some(bytes.len())
}

fn is_text(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(1024)];
    let begins = |word: &[u8]| {
        let start = start.trim_ascii_start();
        start.get(..word.len()).is_some_and(|found| found.eq_ignore_ascii_case(word))
    };
    let text = !start.contains(&0) && (begins(b"solid") || begins(b"facet") || begins(b"#"));
    text && !claimed(bytes).is_some_and(|count| fits(bytes, count))
}

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let attributes = |stored: &str| ["x", "y", "z"].map(|axis| Attribute::new(axis, stored)).to_vec();
    if !is_text(job.bytes) {
        let (count, note) = facets(job)?;
        return Ok(Description {
            format: "STL, binary".into(),
            faces: Some(count as u64),
            attributes: attributes("float32"),
            notes: note.into_iter().collect(),
            ..Description::default()
        });
    }
    let all = 0..job.bytes.len();
    let loops = || lines::lines(job.bytes, &all).filter(|(_, line)| is(line, b"endloop")).count();
    Ok(Description {
        format: "STL, text".into(),
        faces: (all.end <= MAX_COUNTED_BYTES).then(|| loops() as u64),
        attributes: attributes("text"),
        ..Description::default()
    })
}

fn is(line: &[u8], word: &[u8]) -> bool {
    line.split(u8::is_ascii_whitespace).next().is_some_and(|first| first.eq_ignore_ascii_case(word))
}

/// The number of triangles in the file, and a note for the user if the header differs.
fn facets(job: &Job<'_>) -> Result<(usize, Option<String>), Error> {
    let len = job.bytes.len();
    let Some(count) = claimed(job.bytes) else {
        return Err(
            job.malformed(format!("byte {len}"), "the file ends inside the header of a binary STL; copy it again")
        );
    };
    let there = (len - HEADER) / FACET;
    if fits(job.bytes, count) {
        return Ok((count, None));
    }
    // Programs that write without knowing the count leave it empty.
    if (count == 0 || count == u32::MAX as usize) && there > 0 && (len - HEADER).is_multiple_of(FACET) {
        return Ok((there, Some(format!("the header states {count} triangles, but there are {there}; all are read"))));
    }
    if count > there {
        let what = format!("the file ends after {there} of {count} triangles; it is cut off, copy it again");
        return Err(job.malformed(format!("byte {len}"), what));
    }
    let more = len - HEADER - count * FACET;
    Ok((count, Some(format!("{more} bytes after the last of {count} triangles; left out"))))
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    if job.bytes.is_empty() {
        return Err(job.malformed("byte 0", "the file is empty; copy it again"));
    }
    if is_text(job.bytes) { read_text(job) } else { read_binary(job) }
}

fn read_binary(job: &Job<'_>) -> Result<Contents, Error> {
    let (count, note) = facets(job)?;
    if let Some(note) = note {
        job.note(note);
    }
    // Memory: two indices per corner, and the hash table, which is half empty, of about half a point per triangle.
    job.check_memory(count, 3 * 8 + 32)?;
    let corner = |index: usize| {
        let at = HEADER + index / 3 * FACET + 12 * (1 + index % 3);
        let mut raw = [0; 12];
        raw.copy_from_slice(&job.bytes[at..at + 12]);
        bytemuck::cast::<[u8; 12], [[u8; 4]; 3]>(raw).map(f32::from_le_bytes)
    };
    let key = |index| corner(index).map(|value| (value + 0.0).to_bits());
    let Welded { firsts, points } = mesh::weld(job, 3 * count, ProgressRange { start: 0.0, len: 0.8 }, key)?;
    let part = ProgressRange { start: 0.8, len: 0.1 };
    let positions = collect("positions", firsts.len(), job, part, |i| corner(firsts[i] as usize))?;
    let cloud = mesh::cloud_f32(job, &positions, 0.9)?;
    let triangles = if job.triangles {
        collect("triangles", count, job, part, |i| [points[3 * i], points[3 * i + 1], points[3 * i + 2]])?
    } else {
        Vec::new()
    };
    Ok(Contents { cloud, triangles })
}

fn read_text(job: &Job<'_>) -> Result<Contents, Error> {
    let mut whole = Piece::default();
    lines::in_pieces(
        job,
        0..job.bytes.len(),
        PARSING,
        |range| Piece::parse(job, range),
        |piece| {
            if let Some((at, what)) = piece.error {
                return Err(job.malformed(job.line(at), what));
            }
            reserve(&mut whole.corners, piece.corners.len(), "the corners of an STL file")?;
            reserve(&mut whole.ends, piece.ends.len(), "the triangles of an STL file")?;
            let before = whole.corners.len();
            whole.corners.extend(piece.corners);
            whole.ends.extend(piece.ends.into_iter().map(|end| before + end));
            whole.closed = piece.closed.or(whole.closed);
            Ok(())
        },
    )?;
    let Piece { corners, ends, closed, .. } = whole;
    if ends.last().copied().unwrap_or(0) != corners.len() {
        let what = format!("the file ends inside triangle {}; it is cut off, copy it again", ends.len() + 1);
        return Err(job.malformed(job.line(job.bytes.len()), what));
    }
    if closed != Some(true) && ends.is_empty() {
        let what = "the file ends before the first triangle; it is cut off, copy it again";
        return Err(job.malformed(job.line(job.bytes.len()), what));
    }
    if closed != Some(true) {
        job.loss(&job.line(job.bytes.len()), "the file does not end with 'endsolid'; it may be cut off")?;
    }
    let Welded { firsts, points } = mesh::weld(job, corners.len(), WELDING, |i| corners[i].map(mesh::bits))?;
    let part = ProgressRange { start: 0.8, len: 0.1 };
    let positions = collect("positions", firsts.len(), job, part, |i| corners[firsts[i] as usize])?;
    let cloud = mesh::cloud(job, &positions, 0.9)?;
    let mut faces = Faces::new(cloud.len());
    if job.triangles {
        let mut start = 0;
        let mut polygon = Vec::new();
        for end in ends {
            polygon.clear();
            polygon.extend(points[start..end].iter().map(|&point| i64::from(point)));
            faces.polygon(&polygon)?;
            start = end;
        }
    }
    Ok(Contents { cloud, triangles: faces.finish(job) })
}

/// Result of parsing one piece of text, or all of it.
#[derive(Default)]
struct Piece {
    corners: Vec<[f64; 3]>,
    /// End of each face among the corners.
    ends: Vec<usize>,
    /// Whether the last solid mentioned has ended.
    closed: Option<bool>,
    error: Option<(usize, String)>,
}

impl Piece {
    fn parse(job: &Job<'_>, range: Range<usize>) -> Self {
        let mut piece = Self::default();
        for (at, line) in lines::lines(job.bytes, &range) {
            if let Err(what) = piece.line(line) {
                piece.error = Some((at, what));
                break;
            }
        }
        piece
    }

    fn line(&mut self, line: &[u8]) -> Result<(), String> {
        if is(line, b"vertex") {
            let mut values = text::values(line).skip(1);
            let mut position = [0.0; 3];
            for value in &mut position {
                let word = values.next().ok_or("a vertex needs x, y and z; complete the line")?;
                *value = text::number(word)?;
            }
            self.corners.push(position);
        } else if is(line, b"endloop") {
            self.ends.push(self.corners.len());
        } else if is(line, b"solid") || is(line, b"endsolid") {
            self.closed = Some(is(line, b"endsolid"));
        } else if ![&b"facet"[..], b"outer", b"endfacet", b"color"].iter().any(|word| is(line, word)) {
            let word = line.split(u8::is_ascii_whitespace).next().unwrap_or_default();
            return Err(format!("'{}' is not an STL keyword; remove the line or copy the file again", excerpt(word)));
        }
        Ok(())
    }
}
