//! The variable length records before the points, and the extended ones after them.

use super::header::{Header, text};
use crate::las::{EVLR_HEADER, VLR_HEADER};

/// One record: user id, record id and data.
pub(super) struct Record<'a> {
    pub(super) user: String,
    pub(super) id: u16,
    pub(super) data: &'a [u8],
    /// First byte of the record in the file.
    pub(super) at: usize,
}

/// All records of a file that are present.
pub(super) struct Records<'a> {
    pub(super) all: Vec<Record<'a>>,
    /// Faults of the records.
    pub(super) notes: Vec<String>,
}

impl<'a> Records<'a> {
    /// Walks through the records; an impossible count or length ends the walk.
    pub(super) fn read(bytes: &'a [u8], header: &Header) -> Self {
        let mut all = Vec::new();
        let mut notes = Vec::new();
        let (start, claimed) = header.records;
        let before_points = &bytes[..header.point_data];
        walk(before_points, start, claimed, VLR_HEADER, &mut all);
        if (all.len() as u64) < u64::from(claimed) {
            let are = if all.len() == 1 { "is" } else { "are" };
            notes.push(format!("the header states {claimed} records before the points; there {are} {}", all.len()));
        }
        let before = all.len();
        let (start, claimed) = header.extended;
        let start = usize::try_from(start).unwrap_or(usize::MAX);
        walk(bytes, start, claimed, EVLR_HEADER, &mut all);
        if ((all.len() - before) as u64) < u64::from(claimed) {
            let found = all.len() - before;
            notes.push(format!("the header states {claimed} records after the points; there are {found}"));
        }
        Self { all, notes }
    }

    /// Adds an extended record, which begins with its header.
    pub(super) fn add_extended(&mut self, bytes: &'a [u8]) {
        walk(bytes, 0, 1, EVLR_HEADER, &mut self.all);
    }

    pub(super) fn find(&self, user: &str, id: u16) -> Option<&Record<'a>> {
        self.all.iter().find(|record| record.id == id && record.user == user)
    }
}

fn walk<'a>(bytes: &'a [u8], start: usize, count: u32, header_len: usize, all: &mut Vec<Record<'a>>) {
    let mut at = start;
    for _ in 0..count {
        let Some(header) = at.checked_add(header_len).and_then(|end| bytes.get(at..end)) else { return };
        let len = if header_len == EVLR_HEADER {
            let mut raw = [0; 8];
            raw.copy_from_slice(&header[20..28]);
            usize::try_from(u64::from_le_bytes(raw)).unwrap_or(usize::MAX)
        } else {
            usize::from(u16::from_le_bytes([header[20], header[21]]))
        };
        let data = at + header_len;
        let Some(content) = data.checked_add(len).and_then(|end| bytes.get(data..end)) else { return };
        let id = u16::from_le_bytes([header[18], header[19]]);
        all.push(Record { user: text(&header[2..18]), id, data: content, at });
        at = data + len;
    }
}
