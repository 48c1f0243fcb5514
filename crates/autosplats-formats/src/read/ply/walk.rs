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
            None => Some(walk(job, header, element, at, ProgressRange { start: 0.0, len: 0.0 }, |_| Ok(()))?),
        }
        .filter(|&end| end <= job.bytes.len())
        .ok_or_else(|| cut_off(job, wanted))?;
    }
    Ok(at)
}

/// Walks through the records of an element with lists. `keep` receives the bytes of each value that is no list. Returns
/// the first byte after the element.
pub(super) fn walk(
    job: &Job<'_>,
    header: &Header,
    element: &Element,
    start: usize,
    part: ProgressRange,
    mut keep: impl FnMut(&[u8]) -> Result<(), Error>,
) -> Result<usize, Error> {
    let mut at = start;
    for record in 0..element.count {
        if record % (1 << 14) == 0 {
            job.tick(part.start + part.len * record as f32 / element.count as f32)?;
        }
        let fail = |what: &str| {
            let name = excerpt(element.name.as_bytes());
            job.malformed(format!("byte {at}"), format!("{what} in {name} {} of {}", record + 1, element.count))
        };
        let cut = || fail("cut off or damaged, copy the file again: the file ends");
        let mut next = at;
        for property in &element.properties {
            let size = property.scalar.size();
            let Some(count) = property.list else {
                keep(job.bytes.get(next..next + size).ok_or_else(cut)?)?;
                next += size;
                continue;
            };
            let raw = job.bytes.get(next..next + count.size()).ok_or_else(cut)?;
            let len = list_len(raw, header.encoding == Encoding::Big, count).ok_or_else(|| fail("a negative count"))?;
            next = len
                .checked_mul(size)
                .and_then(|len| (next + count.size()).checked_add(len))
                .filter(|&end| end <= job.bytes.len())
                .ok_or_else(cut)?;
        }
        at = next;
    }
    Ok(at)
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
