//! The length of a PLY, from its header and the lengths of its lists.

use autosplats_cloud::Error;

use super::{
    super::{
        Job,
        body::{Body, Records},
    },
    header::{Element, Encoding, Header, Property},
    walk::list_len,
};

/// Binary elements, some of which have lists.
struct ListRecords {
    elements: Vec<Element>,
    big_endian: bool,
    /// Index of the element that contains the next byte, and the number of its records before that byte.
    element: usize,
    record: usize,
}

/// The body after the header, its first byte, and its least number of bytes; `None` if that number overflows.
pub(in super::super) fn body(job: &Job<'_>) -> Result<(Body, usize, Option<usize>), Error> {
    let Header { encoding, elements, end, .. } = Header::parse(job)?;
    if encoding == Encoding::Ascii {
        let lines = elements.iter().try_fold(0_usize, |sum, element| sum.checked_add(element.count));
        // A value and a line end.
        return Ok((Body::Lines(lines.unwrap_or(usize::MAX)), end, lines.and_then(|lines| lines.checked_mul(2))));
    }
    let size = |property: &Property| property.list.unwrap_or(property.scalar).size();
    let least = elements.iter().try_fold(0_usize, |sum, element| {
        sum.checked_add(element.count.checked_mul(element.properties.iter().map(size).sum())?)
    });
    let body = match elements.iter().all(|element| element.stride().is_some()) {
        true => Body::Bytes(least.unwrap_or(usize::MAX)),
        false => {
            let big_endian = encoding == Encoding::Big;
            Body::Records(Box::new(ListRecords { elements, big_endian, element: 0, record: 0 }))
        }
    };
    Ok((body, end, least))
}

/// Whether a binary file is exactly as long as its header and lists say.
pub(super) fn fits(job: &Job<'_>) -> Result<bool, Error> {
    let len = job.bytes.len();
    let (body, mut at, _) = body(job)?;
    Ok(match body {
        Body::Bytes(body) => at.checked_add(body) == Some(len),
        Body::Records(mut records) => records.end(job.bytes, &mut at) == Ok(Some(len)),
        Body::Lines(_) | Body::Sized => true,
    })
}

impl Records for ListRecords {
    fn end(&mut self, bytes: &[u8], at: &mut usize) -> Result<Option<usize>, String> {
        while let Some(element) = self.elements.get(self.element) {
            if let Some(stride) = element.stride() {
                let end = at.saturating_add(element.count.saturating_mul(stride));
                if end > bytes.len() {
                    return Ok(None);
                }
                (self.element, *at) = (self.element + 1, end);
                continue;
            }
            while self.record < element.count {
                match self.record(element, bytes, *at)? {
                    Some(next) => *at = next,
                    None => return Ok(None),
                }
                self.record += 1;
            }
            (self.element, self.record) = (self.element + 1, 0);
        }
        Ok(Some(*at))
    }
}

impl ListRecords {
    /// The first byte after a record, once the record has arrived.
    fn record(&self, element: &Element, bytes: &[u8], mut at: usize) -> Result<Option<usize>, String> {
        for property in &element.properties {
            let size = property.scalar.size();
            let Some(count) = property.list else {
                at += size;
                continue;
            };
            let Some(raw) = bytes.get(at..at + count.size()) else { return Ok(None) };
            let len = list_len(raw, self.big_endian, count).and_then(|len| len.checked_mul(size));
            let end = len.and_then(|len| at.checked_add(count.size())?.checked_add(len));
            at = end.ok_or_else(|| format!("record {} has a list of an impossible length", self.record + 1))?;
        }
        Ok((at <= bytes.len()).then_some(at))
    }
}
