//! The faces of a PLY file: polygons in an element `face`, triangle strips in an element `tristrips`.

use std::ops::Range;

use autosplats_cloud::{Error, excerpt, reserving};

use super::super::{
    Job, lines,
    mesh::Faces,
    table::{ProgressRange, Scalar},
    text,
};
use super::{
    header::{Element, Encoding, Header},
    walk::{integer, list_len, skip, skip_rows},
};

/// Progress of reading faces, which is not shown: points come first.
const PART: ProgressRange = ProgressRange { start: 1.0, len: 0.0 };

/// The triangles between `points` points.
pub(super) fn triangles(job: &Job<'_>, header: &Header, points: usize) -> Result<Vec<[u32; 3]>, Error> {
    let mut faces = Faces::new(points);
    for (index, element) in header.elements.iter().enumerate() {
        let strips = element.name == "tristrips";
        if !strips && element.name != "face" {
            continue;
        }
        let corners =
            |name: &str| ["vertex_indices", "vertex_index"].iter().any(|known| name.eq_ignore_ascii_case(known));
        let Some(list) = element.properties.iter().position(|p| p.list.is_some() && corners(&p.name)) else {
            if element.count > 0 {
                job.note(format!(
                    "the {} elements '{}' have no list vertex_indices; left out",
                    element.count, element.name
                ));
            }
            continue;
        };
        let before = &header.elements[..index];
        let reader = Reader { job, element, list, strips };
        if header.encoding == Encoding::Ascii {
            reader.ascii(skip_rows(job, header, before, element)?, &mut faces)?;
        } else {
            reader.binary(skip(job, header, before, element)?, header.encoding == Encoding::Big, &mut faces)?;
        }
    }
    Ok(faces.finish(job))
}

struct Reader<'a> {
    job: &'a Job<'a>,
    element: &'a Element,
    /// Index of the property that holds the corners.
    list: usize,
    strips: bool,
}

impl Reader<'_> {
    fn add(&self, corners: &[i64], faces: &mut Faces) -> Result<(), Error> {
        if self.strips { faces.strip(corners.iter().copied()) } else { faces.polygon(corners) }
    }

    /// Tells that the file ends in a face; `complete` is the number of complete faces.
    fn tell_cut_off(&self, complete: usize) -> Result<(), Error> {
        let count = self.element.count;
        let (lost, end) = (count - complete, format!("byte {}", self.job.bytes.len()));
        self.job.loss(&end, format!("the file is cut off: {lost} of {count} faces are lost; copy it again"))
    }

    fn binary(&self, start: usize, big_endian: bool, faces: &mut Faces) -> Result<(), Error> {
        let bytes = self.job.bytes;
        // A face takes at least one byte of the file; a triangle takes twelve bytes of memory.
        self.job.check_memory(self.element.count.min(bytes.len() - start), 12)?;
        let mut corners = Vec::new();
        let mut at = start;
        for face in 0..self.element.count {
            if face % (1 << 14) == 0 {
                self.job.tick(PART.start)?;
            }
            for (index, property) in self.element.properties.iter().enumerate() {
                let size = property.scalar.size();
                let Some(count) = property.list else {
                    at = at.saturating_add(size);
                    continue;
                };
                let raw = bytes.get(at..).and_then(|rest| rest.get(..count.size()));
                let Some(raw) = raw else {
                    return self.tell_cut_off(face);
                };
                let Some(len) = list_len(raw, big_endian, count) else {
                    return Err(self
                        .job
                        .malformed(format!("byte {at}"), format!("a negative count in face {}", face + 1)));
                };
                at += count.size();
                let end = len.checked_mul(size).and_then(|len| at.checked_add(len)).filter(|&end| end <= bytes.len());
                let Some(end) = end else {
                    return self.tell_cut_off(face);
                };
                if index == self.list {
                    let corner = |raw| corner(raw, big_endian, property.scalar);
                    corners.clear();
                    reserving(|| corners.try_reserve(len)).map_err(|_| Error::OutOfMemory {
                        what: "the corners of a face".into(),
                        bytes: len.saturating_mul(8),
                    })?;
                    corners.extend(bytes[at..end].chunks_exact(size).map(corner));
                    self.add(&corners, faces)?;
                }
                at = end;
            }
            if at > bytes.len() {
                return self.tell_cut_off(face);
            }
        }
        Ok(())
    }

    fn ascii(&self, start: usize, faces: &mut Faces) -> Result<(), Error> {
        let job = self.job;
        let end = lines::skip_lines(job, start, self.element.count)?;
        let last = job.bytes.iter().rposition(|&byte| byte == b'\n').map_or(start, |at| start.max(at + 1));
        let unfinished = || self.row(&job.bytes[last..], &mut Vec::new()).is_err();
        let end = match end {
            Some(end) if end < job.bytes.len() || last == end || !unfinished() => end,
            _ => {
                // Digits of an unfinished last line may be missing.
                self.tell_cut_off(lines::lines(job.bytes, &(start..last)).count())?;
                last
            }
        };
        job.check_memory(self.element.count, 12)?;
        let points = faces.points();
        let parse = |range: Range<usize>| {
            let mut faces = Faces::new(points);
            let mut corners = Vec::new();
            for (at, line) in lines::lines(job.bytes, &range) {
                self.row(line, &mut corners).map_err(|what| job.malformed(job.line(at), what))?;
                self.add(&corners, &mut faces)?;
            }
            Ok(faces)
        };
        lines::in_pieces(job, start..end, PART, parse, |piece: Result<Faces, Error>| faces.append(piece?))
    }

    fn row(&self, line: &[u8], corners: &mut Vec<i64>) -> Result<(), String> {
        let mut values = text::values(line);
        corners.clear();
        for (index, property) in self.element.properties.iter().enumerate() {
            let missing =
                || format!("a face without all of its values in '{}'; complete or remove the line", excerpt(line));
            let value = values.next().ok_or_else(missing)?;
            if property.list.is_none() {
                continue;
            }
            let len = text::number(value)?;
            for _ in 0..len as usize {
                let value = values.next().ok_or_else(missing)?;
                if index == self.list {
                    corners.push(whole(text::number(value)?));
                }
            }
        }
        Ok(())
    }
}

fn corner(raw: &[u8], big_endian: bool, scalar: Scalar) -> i64 {
    let float = |bits: Option<i64>| bits.unwrap_or_default() as u64;
    match scalar {
        Scalar::F32 => whole(f32::from_bits(float(integer(raw, big_endian, Scalar::U32)) as u32).into()),
        Scalar::F64 => whole(f64::from_bits(float(integer(raw, big_endian, Scalar::I64)))),
        // A number out of range is a corner that does not exist.
        scalar => integer(raw, big_endian, scalar).unwrap_or(i64::MIN),
    }
}

/// Converts a whole number; any other number becomes a corner that does not exist.
fn whole(value: f64) -> i64 {
    if value.fract() == 0.0 { value as i64 } else { i64::MIN }
}
