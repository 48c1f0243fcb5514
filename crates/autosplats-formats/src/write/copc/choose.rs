//! Which records are kept.

use std::sync::{
    Mutex,
    atomic::{AtomicU64, Ordering},
};

use autosplats_cloud::{FieldValues, PointCloud, PointFilter, lock};
use glam::DVec3;

use super::{
    frame::{Lattice, steps_of},
    schema::Schema,
};
use crate::las::{self, Place};

/// Leaves records out, and counts them.
pub(super) struct Chosen {
    bounds: Option<[DVec3; 2]>,
    keep: Option<PointFilter>,
    lattice: Lattice,
    record_len: usize,
    /// Values that the filter looks at.
    places: Vec<(&'static str, Place)>,
    /// Number of records inside the box, and of those that the filter left out.
    inside: AtomicU64,
    left_out: AtomicU64,
    /// Points at (0, 0, 0), if they are left out: their number, and one of them.
    nowhere: Option<Mutex<(u64, Vec<u8>)>>,
}

impl Chosen {
    pub(super) fn new(
        bounds: Option<[DVec3; 2]>,
        keep: Option<PointFilter>,
        drops_nowhere: bool,
        schema: &Schema,
    ) -> Self {
        let keep = keep.filter(|filter| !filter.is_all());
        let mut places = las::places(schema.format);
        places.retain(|(name, _)| keep.as_ref().is_some_and(|filter| filter.needs(name)));
        let Schema { lattice, record_len, .. } = *schema;
        let (inside, left_out) = (AtomicU64::new(0), AtomicU64::new(0));
        let nowhere = drops_nowhere.then(Mutex::default);
        Self { bounds, keep, lattice, record_len, places, inside, left_out, nowhere }
    }

    /// Removes the records that are left out.
    pub(super) fn retain(&self, records: &mut Vec<u8>) {
        if let Some(nowhere) = &self.nowhere {
            let (lattice, len) = (self.lattice, self.record_len);
            let half = lattice.scale / 2.0;
            let is_nowhere = |record: &[u8]| lattice.world(steps_of(record).map(i64::from)).abs().cmplt(half).all();
            if records.chunks_exact(len).any(is_nowhere) {
                let mut nowhere = lock(nowhere);
                let (count, one) = &mut *nowhere;
                for record in records.chunks_exact(len).filter(|record| is_nowhere(record)) {
                    *count += 1;
                    one.clear();
                    one.extend_from_slice(record);
                }
                retain(records, len, |_, record| !is_nowhere(record));
            }
        }
        self.retain_chosen(records);
    }

    /// Number of points at (0, 0, 0) that were left out.
    pub(super) fn nowhere(&self) -> u64 {
        self.nowhere.as_ref().map_or(0, |nowhere| lock(nowhere).0)
    }

    /// Takes the only point at (0, 0, 0) back, which may be real.
    pub(super) fn only_nowhere(&self) -> Option<Vec<u8>> {
        let mut nowhere = lock(self.nowhere.as_ref()?);
        let (count, one) = &mut *nowhere;
        (*count == 1).then(|| {
            *count = 0;
            let mut one = std::mem::take(one);
            self.retain_chosen(&mut one);
            one
        })
    }

    /// Removes the records that are outside of the box or that the filter leaves out.
    pub(super) fn retain_chosen(&self, records: &mut Vec<u8>) {
        if let Some([min, max]) = self.bounds {
            let (lattice, len) = (self.lattice, self.record_len);
            let inside = |record: &[u8]| {
                let world = lattice.world(steps_of(record).map(i64::from));
                world.cmpge(min).all() && world.cmple(max).all()
            };
            retain(records, len, |_, record| inside(record));
        }
        let Some(filter) = &self.keep else { return };
        let count = records.len() / self.record_len;
        let mut cloud = PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; count]);
        for &(name, place) in &self.places {
            let Place::Bits { at, shift, mask } = place else { continue };
            let values = records.chunks_exact(self.record_len).map(|record| record[at] >> shift & mask).collect();
            cloud = cloud.with_field(name, FieldValues::U8(values)).expect("a value for each record");
        }
        let left = filter.left_out(&cloud);
        self.inside.fetch_add(count as u64, Ordering::Relaxed);
        self.left_out.fetch_add(left.count() as u64, Ordering::Relaxed);
        if left.count() > 0 {
            retain(records, self.record_len, |index, _| !left.has(index));
        }
    }

    /// Tells how many points the filter left out.
    pub(super) fn note(&self) -> Option<String> {
        let [left, all] = [&self.left_out, &self.inside].map(|count| count.load(Ordering::Relaxed));
        self.keep.as_ref().filter(|_| left > 0).map(|filter| filter.left_out_note(left, all))
    }

    pub(super) fn forget(&self) {
        self.nowhere.iter().for_each(|nowhere| lock(nowhere).0 = 0);
        [&self.left_out, &self.inside].iter().for_each(|count| count.store(0, Ordering::Relaxed));
    }
}

/// Keeps some of the records, in their order.
fn retain(records: &mut Vec<u8>, len: usize, keep: impl Fn(usize, &[u8]) -> bool) {
    let mut kept = 0;
    for index in 0..records.len() / len {
        let start = index * len;
        if keep(index, &records[start..start + len]) {
            records.copy_within(start..start + len, kept);
            kept += len;
        }
    }
    records.truncate(kept);
}
