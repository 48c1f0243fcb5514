//! Walking over the records of elements.

use autosplats_cloud::{Error, excerpt};

use super::{
    super::{
        Job, lines,
        table::{ProgressRange, Scalar},
    },
    header::{Element, Encoding, Header},
};

/// The first byte after the text of the elements before `element`.
pub(super) fn skip_rows(job: &Job<'_>, header: &Header, before: &[Element], element: &Element) -> Result<usize, Error> {
    let rows = before.iter().fold(0, |rows: usize, element| rows.saturating_add(element.count));
    lines::skip_lines(job, header.end, rows)?.ok_or_else(|| cut_off(job, element))
}

/// The first byte after the binary elements before `wanted`.
pub(super) fn skip(job: &Job<'_>, header: &Header, before: &[Element], wanted: &Element) -> Result<usize, Error> {
    let mut at = header.end;
    for element in before {
        at = match element.stride() {
            Some(stride) => element.count.checked_mul(stride).and_then(|len| at.checked_add(len)),
            None => {
                let walked = walk(job, header, element, at, ProgressRange { start: 0.0, len: 0.0 }, |_| Ok(()))?;
                (walked.count == element.count).then_some(walked.end)
            }
        }
        .filter(|&end| end <= job.bytes.len())
        .ok_or_else(|| cut_off(job, wanted))?;
    }
    Ok(at)
}

/// Where a walk ended: after `count` complete records, at byte `end`.
pub(super) struct Walked {
    pub(super) count: usize,
    pub(super) end: usize,
}

/// Walks through the records of an element with lists, as far as the file holds them. `keep` receives the bytes of each
/// value that is no list, also in a record that is incomplete.
pub(super) fn walk(
    job: &Job<'_>,
    header: &Header,
    element: &Element,
    start: usize,
    part: ProgressRange,
    mut keep: impl FnMut(&[u8]) -> Result<(), Error>,
) -> Result<Walked, Error> {
    let mut at = start;
    for record in 0..element.count {
        if record % (1 << 14) == 0 {
            job.tick(part.start + part.len * record as f32 / element.count as f32)?;
        }
        let fail = |what: &str| {
            let name = excerpt(element.name.as_bytes());
            job.malformed(format!("byte {at}"), format!("{what} in {name} {} of {}", record + 1, element.count))
        };
        let cut = Ok(Walked { count: record, end: at });
        let mut next = at;
        for property in &element.properties {
            let size = property.scalar.size();
            let Some(count) = property.list else {
                let Some(value) = job.bytes.get(next..next + size) else { return cut };
                keep(value)?;
                next += size;
                continue;
            };
            let Some(raw) = job.bytes.get(next..next + count.size()) else { return cut };
            let len = list_len(raw, header.encoding == Encoding::Big, count).ok_or_else(|| fail("a negative count"))?;
            let end = len.checked_mul(size).and_then(|len| (next + count.size()).checked_add(len));
            match end.filter(|&end| end <= job.bytes.len()) {
                Some(end) => next = end,
                None => return cut,
            }
        }
        at = next;
    }
    Ok(Walked { count: element.count, end: at })
}

pub(super) fn list_len(raw: &[u8], big_endian: bool, scalar: Scalar) -> Option<usize> {
    usize::try_from(integer(raw, big_endian, scalar)?).ok()
}

/// An integer of any width; `None` if the type is a float or the value does not fit.
pub(super) fn integer(raw: &[u8], big_endian: bool, scalar: Scalar) -> Option<i64> {
    let mut bytes = [0; 8];
    let len = raw.len();
    bytes[..len].copy_from_slice(raw);
    if big_endian {
        bytes[..len].reverse();
    }
    let value = u64::from_le_bytes(bytes);
    match scalar {
        Scalar::I8 | Scalar::I16 | Scalar::I32 | Scalar::I64 => {
            let unused = 64 - 8 * len as u32;
            Some((value << unused) as i64 >> unused)
        }
        Scalar::U8 | Scalar::U16 | Scalar::U32 | Scalar::U64 => i64::try_from(value).ok(),
        Scalar::F32 | Scalar::F64 => None,
    }
}

fn cut_off(job: &Job<'_>, element: &Element) -> Error {
    let what = match &*element.name {
        "vertex" => "points".into(),
        "face" => "faces".into(),
        name => format!("records of '{}'", excerpt(name.as_bytes())),
    };
    job.malformed(
        format!("byte {}", job.bytes.len()),
        format!("the file ends before the first of {} {what}; it is cut off, copy it again", element.count),
    )
}
