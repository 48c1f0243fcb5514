//! Where the eye is, as seen from the origin of each point.
//!
//! Points have origins of their own in runs that lie in slots: powers of two of successive indices. A shift of an index
//! finds its slot. The eye about each slot's origin is found in `f64` once a frame; everything after projection is in
//! view space.

use autosplats_cloud::{PointRun, SLOT_SHIFT};
use glam::Vec3;
use rayon::prelude::*;

use crate::camera::View;
use crate::points::{Points, WHOLE_SHIFT};

/// The points of a frame by slots.
#[derive(Debug)]
pub(crate) struct SlotTable<'a> {
    positions: &'a [[f32; 3]],
    runs: Vec<PointRun>,
    shift: u32,
    /// Eye about the origin of each slot.
    eyes: Vec<Vec3>,
    pub(super) names: PointNames,
}

/// What points go by where their indices will not do, because the slots that nodes happen to lie in must make no
/// difference.
///
/// - Points are sampled by *names*: they count up in the order of runs, as the indices of a cloud do.
/// - Of points in the same place the one with the lowest *ordinal* is seen. An ordinal is an index as if runs lay in
///   slots one after the other. It orders points as names do, and leads back to the index. The ordinals of a cloud are
///   the indices.
#[derive(Clone, Debug)]
pub(crate) struct PointNames {
    shift: u32,
    /// Name of the first point of each slot.
    first: Vec<u32>,
    /// Index of the first point of each run.
    runs: Vec<u32>,
}

impl Default for PointNames {
    /// The names and ordinals of a cloud, which are the indices.
    fn default() -> Self {
        let first = vec![0, 1 << WHOLE_SHIFT];
        Self { shift: WHOLE_SHIFT, runs: first.clone(), first }
    }
}

impl PointNames {
    /// The name of the point at an index.
    #[inline(always)]
    pub(crate) fn of(&self, index: u32) -> u32 {
        self.first[(index >> self.shift) as usize].wrapping_add(index & ((1 << self.shift) - 1))
    }

    /// The index of the point with an ordinal.
    #[inline(always)]
    pub(super) fn index(&self, ordinal: u32) -> u32 {
        self.runs[(ordinal >> self.shift) as usize] + (ordinal & ((1 << self.shift) - 1))
    }

    /// The shift, then the first name of each slot beside the first index of each run, as `shared/names.wgsl` reads
    /// them.
    pub(crate) fn on_device(&self) -> Vec<u32> {
        let runs = self.runs.iter().copied().chain(std::iter::repeat(0));
        std::iter::once(self.shift).chain(self.first.iter().copied().zip(runs).flat_map(|(a, b)| [a, b])).collect()
    }
}

/// What the device knows of a slot: five numbers behind the positions, read in `shared/cloud_points.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct DeviceSlot {
    /// Eye about the slot's origin.
    eye: [f32; 3],
    /// Number of points to project, from the first on. In `f32`, because bits of small integers are no normal numbers.
    len: f32,
    /// Slots from here to where the ordinals of these points are.
    to_ordinal: f32,
}

impl DeviceSlot {
    /// A slot without points to project.
    pub(super) const EMPTY: Self = Self { eye: [0.0; 3], len: 0.0, to_ordinal: 0.0 };
}

impl<'a> SlotTable<'a> {
    /// The points, as the eye of `view` sees them.
    pub(crate) fn new(points: Points<'a>, view: &View) -> Self {
        let (shift, runs) = (points.slot_shift(), points.runs());
        let slots = runs.iter().map(|run| (run.first >> shift) as usize + 1).max().unwrap_or(0);
        let (mut eyes, mut first) = (vec![Vec3::ZERO; slots], vec![0; slots]);
        let mut named = 0u32;
        for run in &runs {
            let slot = (run.first >> shift) as usize;
            eyes[slot] = view.about(run.origin).eye_local;
            first[slot] = named;
            named = named.wrapping_add(run.len);
        }
        let names = PointNames { shift, first, runs: runs.iter().map(|run| run.first).collect() };
        Self { positions: points.positions(), runs, shift, eyes, names }
    }

    /// Position in view space of the point at an index.
    #[inline(always)]
    pub(super) fn to_view(&self, index: u32, view: &View) -> Vec3 {
        let eye = self.eyes[(index >> self.shift) as usize];
        view.view_from_world * (Vec3::from(self.positions[index as usize]) - eye)
    }

    /// The points in pieces of at most `most`: ordinal of the first, positions, and the view about their origin.
    pub(super) fn pieces(&self, view: &View, most: usize) -> impl ParallelIterator<Item = (u32, &'a [[f32; 3]], View)> {
        let pieces = self.runs.iter().enumerate().flat_map(|(number, run)| {
            let seen = view.about(run.origin);
            let (ordinal, first, len) = (number << self.shift, run.first as usize, run.len as usize);
            (0..len).step_by(most).map(move |at| (ordinal + at, first + at..first + len.min(at + most), seen))
        });
        let pieces: Vec<_> = pieces.collect();
        let positions = self.positions;
        pieces.into_par_iter().map(move |(ordinal, piece, seen)| (ordinal as u32, &positions[piece], seen))
    }

    /// The slots for the device.
    pub(super) fn on_device(&self) -> Vec<DeviceSlot> {
        let mut slots = vec![DeviceSlot::EMPTY; self.eyes.len()];
        for (number, run) in self.runs.iter().enumerate() {
            let slot = (run.first >> self.shift) as usize;
            // A whole cloud ends where its chunks do.
            let len = if self.shift == SLOT_SHIFT { run.len as f32 } else { f32::MAX };
            slots[slot] = DeviceSlot { eye: self.eyes[slot].to_array(), len, to_ordinal: number as f32 - slot as f32 };
        }
        slots
    }
}
