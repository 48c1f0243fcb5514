//! PCD, but the compressed ones, in pieces.

use std::collections::HashMap;

use autosplats_cloud::{Crs, Error, PointCloud};
use glam::DVec3;

use super::{
    super::{
        Job,
        opened::Reader,
        pieces::{Opening, Pieces},
        records::SettledRecords,
        xyz,
    },
    NO_HEADER, check,
    frame::{Frame, InFront, image_from_origin, may_be_seen_from_origin, ray, sampled_pairs},
    header::{Encoding, Header},
    records, without_header,
};

/// The points of a file.
struct PcdPieces {
    records: SettledRecords,
    frame: Frame,
}

/// Settles what all points tell. `None` for compressed data, which hold all values of a field before those of the next.
pub(in super::super) fn open(job: &Job<'_>, file: &Reader<'_>) -> Result<Option<Opening>, Error> {
    if without_header(job) {
        job.note(NO_HEADER);
        return xyz::parts::open(job, file);
    }
    let header = Header::parse(job)?;
    if header.encoding == Encoding::Compressed {
        return Ok(None);
    }
    let stride = check(job, &header)?;
    let records = records(job, &header, stride)?.planned(job, file)?;
    let starts = sampled_pairs(&header, records.count());
    let mut rays: HashMap<usize, DVec3> = HashMap::new();
    let mut wanted = starts.iter().flat_map(|&i| [i, i + 1]).peekable();
    let (mut at, mut front) = (0, None);
    let (records, seen) = records.settled(job, file, &mut |placed| {
        let end = at + placed.len();
        while let Some(index) = wanted.next_if(|&index| index < end) {
            if let Some(ray) = ray(placed.world_position(index - at)) {
                rays.insert(index, ray);
            }
        }
        if may_be_seen_from_origin(&header, placed.origin()) {
            front = Some(front.unwrap_or(InFront::default()).with(placed.positions()));
        }
        at = end;
        Ok(())
    })?;
    let from_origin = image_from_origin(&starts, |i| rays.get(&i).copied());
    let frame = Frame::of(&header, from_origin, records.settled.colored(), front);
    let scans = frame.world_from_sensor.map(|_| seen).into_iter().collect();
    Ok(Some(Opening { pieces: Box::new(PcdPieces { records, frame }), seen, scans, crs: Crs::default() }))
}

impl Pieces for PcdPieces {
    fn read(
        &self,
        job: &Job<'_>,
        file: &Reader<'_>,
        take: &mut dyn FnMut(PointCloud, Option<usize>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let scan = self.frame.world_from_sensor.map(|_| 0);
        self.records.each(job, file, &mut |cloud| take(self.frame.set(cloud), scan))
    }
}
