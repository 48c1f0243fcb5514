//! Opening a COPC file: its header, its records, and the first page of the hierarchy.

use std::ops::Range;
use std::sync::Arc;

use autosplats_cloud::{Axes, Error, Key, Progress, Ranges, TreeInfo, shown_number};
use glam::DVec3;

use super::{
    Copc, Limits,
    hierarchy::{ENTRY, entries},
};
use crate::{
    las,
    read::{Description, las::Head},
    tree::{
        directory::{Directory, Entry},
        octree::Octree,
        paged::{MAX_PAGES, Page, take_page},
    },
};

/// Bytes that are read first: the header and the records of nearly all files.
const START: u64 = 64 << 10;

/// Place of the info record's data, which the first variable length record has.
const INFO: Range<usize> = 429..589;

/// Most extended records that are looked at, and most bytes of one that is read.
const MAX_EXTENDED: u32 = 64;
const MAX_EXTENDED_BYTES: u64 = 4 << 20;

/// The info record.
struct Info {
    center: DVec3,
    half: f64,
    spacing: f64,
    root: Range<u64>,
}

/// Whether a file that begins so is a COPC file.
fn is_copc(start: &[u8]) -> bool {
    let record = &start[..start.len().min(INFO.start)];
    let named = |bytes: &[u8]| bytes[377..393].starts_with(b"copc\0") && bytes[393..395] == [1, 0];
    start.starts_with(b"LASF") && start.len() >= INFO.end && named(record)
}

impl Info {
    fn of(start: &[u8]) -> Self {
        let word = |at: usize| {
            let mut raw = [0; 8];
            raw.copy_from_slice(&start[INFO.start + 8 * at..INFO.start + 8 * at + 8]);
            u64::from_le_bytes(raw)
        };
        let number = |at: usize| f64::from_bits(word(at));
        Self {
            center: DVec3::new(number(0), number(1), number(2)),
            half: number(3),
            spacing: number(4),
            root: word(5)..word(5).saturating_add(word(6)),
        }
    }

    fn cube(&self) -> [DVec3; 2] {
        [self.center - self.half, self.center + self.half]
    }

    /// The fault of what the record states, if there is one.
    fn fault(&self, head: &Head) -> Option<String> {
        let [low, high] = head.reach();
        let shown = shown_number;
        if !(self.half > 0.0 && self.half.is_finite() && self.center.is_finite()) {
            let center = self.center.to_array().map(shown).join(", ");
            return Some(format!("the root's cube is {} wide about {center}", shown(2.0 * self.half)));
        }
        if !(self.spacing > 0.0 && self.spacing.is_finite()) {
            return Some(format!("the spacing is {}", shown(self.spacing)));
        }
        let [cube_low, cube_high] = self.cube();
        let apart = cube_low.cmpgt(high).any() || cube_high.cmplt(low).any();
        let wider = 2.0 * self.half > 4.0 * (high - low).max_element();
        (apart || wider).then(|| "the root's cube is where no coordinates can be".into())
    }
}

/// Opens a COPC file. `None` if it is another.
pub(crate) fn open(ranges: Arc<dyn Ranges>, progress: &dyn Progress) -> Result<Option<Copc>, Error> {
    let size = ranges.size();
    let one = |range: Range<u64>| ranges.read(&[range], progress).map(|read| read.concat());
    let mut start = one(0..size.min(START))?;
    if !is_copc(&start) {
        return Ok(None);
    }
    let fail = |at: usize, what: String| Error::malformed(ranges.name(), format!("byte {at}"), what);
    let word = |at: usize| u64::from(u32::from_le_bytes([start[at], start[at + 1], start[at + 2], start[at + 3]]));
    let points = word(96);
    let info = Info::of(&start);
    if points > size || points > MAX_PAGES || points < INFO.end as u64 {
        return Err(fail(96, format!("the points cannot begin at byte {points}; copy the file again")));
    }
    let root = Page { offset: info.root.start, bytes: info.root.end - info.root.start };
    root.check(size, ENTRY).map_err(|what| fail(INFO.start + 40, format!("hierarchy: {what}")))?;
    if points > start.len() as u64 {
        let more = one(start.len() as u64..points)?;
        start.extend(more);
    }
    let beginning = &start[..points as usize];
    let extended = Extended::of(beginning);
    let first = extended.start..extended.start.saturating_add(las::EVLR_HEADER as u64);
    let with_record = extended.count > 0 && first.start >= points && first.end <= size;
    let mut wanted = vec![info.root.clone()];
    wanted.extend(with_record.then(|| first.clone()));
    let mut read = ranges.read(&wanted, progress)?;
    let mut notes = Vec::new();
    let records = match (with_record, read.pop_if(|_| with_record)) {
        (true, Some(header)) => extended.read(&*ranges, header, progress, &mut notes)?,
        _ => Vec::new(),
    };
    if extended.count > 0 && !with_record {
        notes.push(format!("the header states {} records after the points; there are 0", extended.count));
    }
    let page = read.concat();
    let head = Head::read(ranges.name(), beginning, &records)?;
    if let Some(what) = info.fault(&head) {
        return Err(fail(INFO.start, format!("info record: {what}; build the file again")));
    }
    let limits = Limits { data: points..size, record_len: head.record_len() as u64 };
    let directory = Directory::new(Entry::Page { offset: info.root.start, bytes: page.len() as u32 });
    let parse = |_, page: &[u8]| entries(page, &limits, size);
    take_page(&directory, &*ranges, Key::ROOT, info.root.start, &page, parse)?;
    let octree = Octree::new(tree_info(&head, &info, notes), directory, head.height_scale);
    Ok(Some(Copc { ranges, head, limits, octree }))
}

fn tree_info(head: &Head, info: &Info, mut notes: Vec<String>) -> TreeInfo {
    let Description { format, points, bounds, attributes, crs, resolution, details, notes: own, .. } =
        head.description.clone();
    let scale = DVec3::new(1.0, 1.0, head.height_scale);
    let cube = info.cube().map(|corner| corner * scale);
    let slack = resolution.unwrap_or_default();
    let [low, high] = bounds.unwrap_or(cube);
    if !(low.cmpge(cube[0] - slack).all() && high.cmple(cube[1] + slack).all()) {
        notes.push("the bounds in the header are not inside the root's cube; parts of the scan may be missed".into());
    }
    notes.extend(own);
    TreeInfo {
        format,
        points: points.unwrap_or_default(),
        cube,
        bounds: [low, high],
        spacing: info.spacing,
        attributes: attributes.into_iter().map(|attribute| (attribute.name, attribute.stored)).collect(),
        colors: head.has_colors(),
        fields: head.fields(),
        axes: Some(Axes::ZUp),
        crs,
        resolution,
        details,
        notes,
    }
}

/// The extended records, which are behind the points.
struct Extended {
    start: u64,
    count: u32,
}

impl Extended {
    fn of(header: &[u8]) -> Self {
        let mut raw = [0; 8];
        raw.copy_from_slice(&header[235..243]);
        let count = u32::from_le_bytes([header[243], header[244], header[245], header[246]]);
        Self { start: u64::from_le_bytes(raw), count }
    }

    /// Reads the records, but for the hierarchy. `header` is that of the first one.
    fn read(
        &self,
        ranges: &dyn Ranges,
        mut header: Vec<u8>,
        progress: &dyn Progress,
        notes: &mut Vec<String>,
    ) -> Result<Vec<Vec<u8>>, Error> {
        let mut records = Vec::new();
        let mut at = self.start;
        for index in 0..self.count.min(MAX_EXTENDED) {
            let mut raw = [0; 8];
            raw.copy_from_slice(&header[20..28]);
            let end = (at + las::EVLR_HEADER as u64).checked_add(u64::from_le_bytes(raw));
            let Some(end) = end.filter(|&end| end <= ranges.size()) else {
                notes.push(format!("the header states {} records after the points; there are {index}", self.count));
                break;
            };
            // Only these say something about the points.
            let useful = [las::PROJECTION, las::SPEC].iter().any(|user| header[2..18].starts_with(user.as_bytes()));
            let next = end..end.saturating_add(las::EVLR_HEADER as u64).min(ranges.size());
            let mut wanted = Vec::new();
            wanted.extend((useful && end - at <= MAX_EXTENDED_BYTES).then_some(at..end));
            let more = index + 1 < self.count.min(MAX_EXTENDED) && next.end - next.start == las::EVLR_HEADER as u64;
            wanted.extend(more.then_some(next));
            let mut read = ranges.read(&wanted, progress)?;
            let following = read.pop_if(|_| more);
            records.append(&mut read);
            let Some(following) = following else { break };
            (header, at) = (following, end);
        }
        Ok(records)
    }
}
