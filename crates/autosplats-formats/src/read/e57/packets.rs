//! The packets that hold the points of a scan.
//!
//! Each packet has a piece of every element's values. The pieces of an element, joined, are its values bit by bit. They
//! are joined first, so that any value can be accessed by index.

use std::ops::Range;

use autosplats_cloud::Error;
use rayon::prelude::*;

use super::{
    super::{Job, table::reserve},
    element::Stream,
    pages::Pages,
    xml::ScanHeader,
};

/// Bytes of the header of a compressed vector.
const SECTION_HEADER: usize = 32;

/// Bytes of packets that one thread copies at a time.
const GROUP: usize = 1 << 20;

/// Groups copied between two checks for cancellation.
const BATCH: usize = 16;

/// The values of a scan.
pub(super) struct Values {
    /// Number of points; lower than claimed if the data end early.
    pub(super) count: usize,
    pub(super) streams: Vec<Stream>,
}

/// Consecutive packets, and the bytes in each stream before the first of them.
struct Group {
    range: Range<usize>,
    filled: Vec<usize>,
}

/// Where the values of a scan are.
pub(super) struct Packets {
    /// Number of points; lower than claimed if the data end early.
    pub(super) count: usize,
    groups: Vec<Group>,
    /// Bytes in each stream.
    filled: Vec<usize>,
}

/// Finds the packets of a scan and verifies them. `left` is the number of the file's bytes that earlier scans have not
/// used. No byte belongs to two scans, so memory stays within the file's size.
pub(super) fn find(job: &Job<'_>, pages: &Pages<'_>, scan: &ScanHeader, left: &mut usize) -> Result<Packets, Error> {
    if scan.points == 0 {
        return Ok(Packets { count: 0, groups: Vec::new(), filled: vec![0; scan.elements.len()] });
    }
    let stored = || scan.elements.iter().map(|element| element.stored);
    let section = section(job, pages, scan)?;
    let needed: Vec<u128> =
        stored().map(|stored| (u128::from(scan.points) * u128::from(stored.bits())).div_ceil(8)).collect();
    let (groups, filled) = survey(job, pages, section.clone(), &needed, left)?;
    let end = groups.last().map_or(section.start, |group| group.range.end);
    pages.check(job, section.start..end)?;

    let available = filled.iter().zip(stored()).filter(|(_, stored)| stored.bits() > 0);
    let available = available.map(|(&bytes, stored)| (bytes as u64).saturating_mul(8) / u64::from(stored.bits())).min();
    // Constants take no space, so only a bound limits the claimed number. Real points take several bytes.
    let count = available.unwrap_or(0).min(scan.points);
    if count > (end - section.start) as u64 || available.is_none() {
        let bytes = end - section.start;
        let what = format!("{} points in {bytes} bytes, less than a byte each; that is implausible", scan.points);
        return Err(job.malformed(format!("byte {}", scan.offset), what));
    }
    Ok(Packets { count: count as usize, groups, filled })
}

impl Packets {
    /// Joins the values of a range of points. `part` is the range of the work.
    pub(super) fn values(
        &self,
        job: &Job<'_>,
        pages: &Pages<'_>,
        scan: &ScanHeader,
        points: Range<usize>,
        part: Range<f32>,
    ) -> Result<Values, Error> {
        let bits: Vec<usize> = scan.elements.iter().map(|element| element.stored.bits() as usize).collect();
        let groups = self.groups_of(&bits, &points);
        let before = |group: usize| self.groups.get(group).map_or(&self.filled, |group| &group.filled);
        let (start, end) = (before(groups.start), before(groups.end));
        let mut buffers = Vec::new();
        for ((start, end), element) in start.iter().zip(end).zip(&scan.elements) {
            let mut buffer = Vec::new();
            reserve(&mut buffer, end - start + Stream::PADDING, &element.name)?;
            buffer.resize(end - start + Stream::PADDING, 0);
            buffers.push(buffer);
        }
        copy(job, pages, &self.groups[groups], end, &mut buffers, part)?;
        let streams = buffers.into_iter().zip(&scan.elements).zip(bits.iter().zip(start));
        let streams = streams.map(|((buffer, element), (&bits, &start))| {
            // Constants take no bits, and are wherever one looks for them.
            let skipped = (points.start * bits).saturating_sub(8 * start);
            Stream::new(buffer, element.stored).skipping(if bits > 0 { skipped } else { 0 })
        });
        Ok(Values { count: points.len(), streams: streams.collect() })
    }

    /// The groups that hold values of a range of points; all for all points.
    fn groups_of(&self, bits: &[usize], points: &Range<usize>) -> Range<usize> {
        if *points == (0..self.count) {
            return 0..self.groups.len();
        }
        let (mut first, mut end) = (self.groups.len(), 0);
        for (stream, &bits) in bits.iter().enumerate().filter(|(_, bits)| **bits > 0) {
            let (low, high) = (points.start * bits / 8, (points.end * bits).div_ceil(8));
            let starts = |limit: usize| self.groups.partition_point(|group| group.filled[stream] <= limit);
            first = first.min(starts(low).saturating_sub(1));
            end = end.max(starts(high.saturating_sub(1)));
        }
        first.min(end)..end
    }
}

/// The byte range of the packets of a scan.
fn section(job: &Job<'_>, pages: &Pages<'_>, scan: &ScanHeader) -> Result<Range<usize>, Error> {
    let start = pages.logical(job, "the points", scan.offset)?;
    let fail = |what: &str| job.malformed(format!("byte {}", scan.offset), what);
    if pages.len() - start < SECTION_HEADER {
        return Err(fail("the file ends in the header of the points; it is cut off, copy it again"));
    }
    pages.check(job, start..start + SECTION_HEADER)?;
    let mut header = [0; SECTION_HEADER];
    pages.copy(start, &mut header)?;
    if header[0] != 1 {
        return Err(fail("there is no compressed vector, where the points should be; write the file again"));
    }
    let u64_at = |at: usize| {
        let mut raw = [0; 8];
        raw.copy_from_slice(&header[at..at + 8]);
        u64::from_le_bytes(raw)
    };
    let data = pages.logical(job, "the packets", u64_at(16))?;
    let length = usize::try_from(u64_at(8)).unwrap_or(usize::MAX);
    // An impossible length is ignored: reading stops when the packets have enough values.
    let end = start.checked_add(length).filter(|&end| end > data && end <= pages.len());
    Ok(data..end.unwrap_or(pages.len()))
}

/// Walks the packets until they hold enough values. Returns the packets in groups, and the bytes of each stream.
fn survey(
    job: &Job<'_>,
    pages: &Pages<'_>,
    section: Range<usize>,
    needed: &[u128],
    left: &mut usize,
) -> Result<(Vec<Group>, Vec<usize>), Error> {
    let mut filled = vec![0; needed.len()];
    let mut groups: Vec<Group> = Vec::new();
    let mut lengths = Vec::new();
    let mut at = section.start;
    let mut enough = false;
    while at < section.end && !enough {
        if groups.last().is_none_or(|group| at - group.range.start >= pages.step(GROUP)) {
            job.go_on()?;
            groups.push(Group { range: at..at, filled: filled.clone() });
        }
        let packet = match packet(job, pages, at..section.end, needed.len(), &mut lengths) {
            Ok(packet) => packet,
            Err(error) => {
                // Damage is the likeliest cause of an invalid packet.
                pages.check(job, section.start..at + 1)?;
                return Err(error);
            }
        };
        for (filled, &length) in filled.iter_mut().zip(&lengths) {
            *filled += usize::from(length);
        }
        if !lengths.is_empty() {
            enough = filled.iter().zip(needed).all(|(&filled, &needed)| filled as u128 >= needed);
        }
        let next = after(at, &packet);
        *left = left.checked_sub(next - at).ok_or_else(|| {
            let place = format!("byte {}", pages.physical(at));
            job.malformed(place, "the data of scans overlap; write the file again")
        })?;
        at = next;
        if let Some(group) = groups.last_mut() {
            group.range.end = at.min(section.end);
        }
    }
    Ok((groups, filled))
}

/// The start of the packet after the one at `at`. Lengths are multiples of four, or meant to be.
fn after(at: usize, packet: &Range<usize>) -> usize {
    at + (packet.end - at).next_multiple_of(4)
}

/// Parses the packet at the start of `range`. Returns the byte range of its streams' pieces, and stores their lengths
/// in `lengths`, which is empty if the packet has no data.
fn packet(
    job: &Job<'_>,
    pages: &Pages<'_>,
    range: Range<usize>,
    streams: usize,
    lengths: &mut Vec<u16>,
) -> Result<Range<usize>, Error> {
    let at = range.start;
    let fail = |what: String| job.malformed(format!("byte {}", pages.physical(at)), what);
    let mut header = [0; 6];
    let short = range.len() < header.len();
    pages.copy(at, &mut header[..range.len().min(6)])?;
    let end = at + usize::from(u16::from_le_bytes([header[2], header[3]])) + 1;
    lengths.clear();
    if header[0] > 2 || end - at < 4 {
        return Err(fail(format!("there is no packet of kind {}; copy the file again", header[0])));
    }
    if end > range.end || short {
        return Err(fail("a packet reaches beyond the points; copy the file again".into()));
    }
    if header[0] != 1 {
        return Ok(at..end);
    }
    let count = usize::from(u16::from_le_bytes([header[4], header[5]]));
    let data = at + 6 + 2 * count;
    if count != streams || data > end {
        return Err(fail(format!("a packet of {count} values where points have {streams}; copy the file again")));
    }
    lengths.resize(count, 0);
    pages.copy(at + 6, bytemuck::cast_slice_mut(lengths))?;
    lengths.iter_mut().for_each(|length| *length = u16::from_le(*length));
    if lengths.iter().map(|&length| usize::from(length)).sum::<usize>() > end - data {
        return Err(fail("a packet is too short for what it should hold; copy the file again".into()));
    }
    Ok(data..end)
}

/// Copies the pieces of all streams to their places, group by group in parallel.
fn copy(
    job: &Job<'_>,
    pages: &Pages<'_>,
    groups: &[Group],
    filled: &[usize],
    buffers: &mut [Vec<u8>],
    part: Range<f32>,
) -> Result<(), Error> {
    let mut rest: Vec<&mut [u8]> = buffers.iter_mut().map(Vec::as_mut_slice).collect();
    for (batch, first) in groups.chunks(BATCH).zip((0..).step_by(BATCH)) {
        job.tick(part.start + (part.end - part.start) * first as f32 / groups.len() as f32)?;
        let places = batch.iter().enumerate().map(|(index, group)| {
            let after = groups.get(first + index + 1).map_or(filled, |next| &next.filled);
            let slices = rest.iter_mut().enumerate().map(|(stream, rest)| {
                let (now, later) = std::mem::take(rest).split_at_mut(after[stream] - group.filled[stream]);
                *rest = later;
                now
            });
            (group, slices.collect::<Vec<_>>())
        });
        let places: Vec<_> = places.collect();
        places.into_par_iter().try_for_each(|(group, mut slices)| {
            let (mut lengths, mut space) = (Vec::new(), Vec::new());
            let near = pages.near(group.range.clone(), &mut space)?;
            let mut at = group.range.start;
            while at < group.range.end {
                let packet = packet(job, &near, at..pages.len(), slices.len(), &mut lengths)?;
                let mut from = packet.start;
                for (slice, &length) in slices.iter_mut().zip(&lengths) {
                    let (now, later) = std::mem::take(slice).split_at_mut(length.into());
                    near.copy(from, now)?;
                    *slice = later;
                    from += now.len();
                }
                at = after(at, &packet);
            }
            Ok::<(), Error>(())
        })?;
    }
    Ok(())
}
