//! Brings records that lie near each other together: cells of a coarse grid, then parts that fit in memory.
//!
//! # How it works
//!
//! Records are sorted into the cells of a grid as they are read, each batch by the thread that read it. Cells are
//! joined to the largest cubes of the octree with few enough points: the parts. A cell with too many is sorted again,
//! into a finer grid. Which parts there are depends on the points alone, and not on the memory: so the file does not
//! either.

use std::sync::{
    Mutex,
    atomic::{AtomicBool, Ordering},
};

use autosplats_cloud::{Error, Progress, Spill, SpillCell, lock};

use super::{
    frame::{Frame, morton, steps_of},
    key::Place,
};

/// Most bytes of records of a part, and fewest points that this may mean.
const PART_BYTES: usize = 32 << 20;
const LEAST_PART: usize = 1 << 17;

/// Points per cell of a grid that are wished for, as a part of the most points of a part.
const CELLS_PER_PART: u64 = 4;

/// Most levels of the first grid, and levels of the finer ones.
const MAX_DEPTH: u32 = 6;
const FINER: u32 = 3;

/// Most points of a part.
pub(super) fn most_points(record_len: usize) -> u64 {
    (PART_BYTES / record_len).max(LEAST_PART) as u64
}

/// Cells of a cube of the octree, in Morton order.
pub(super) struct Grid {
    root: Place,
    depth: u32,
    pub(super) cells: Vec<Mutex<SpillCell>>,
}

/// A cube of the octree with few enough points.
pub(super) struct Chunk {
    pub(super) place: Place,
    pub(super) points: u64,
    cells: Vec<SpillCell>,
}

impl Grid {
    /// A grid for this many points, on surfaces as most are.
    pub(super) fn new(frame: &Frame, points: u64, record_len: usize) -> Self {
        let wished = most_points(record_len) / CELLS_PER_PART;
        let depth = (0..MAX_DEPTH).find(|depth| points >> (2 * depth) <= wished || points <= CELLS_PER_PART * wished);
        Self::below(frame, Place::ROOT, depth.unwrap_or(MAX_DEPTH))
    }

    fn below(frame: &Frame, root: Place, depth: u32) -> Self {
        let depth = depth.min(frame.bits - root.level).min(Place::MAX_LEVEL - root.level);
        let mut cells = Vec::new();
        cells.resize_with(1 << (3 * depth), Mutex::default);
        Self { root, depth, cells }
    }

    #[inline]
    fn cell(&self, bits: u32, place: [u32; 3]) -> usize {
        let shift = bits - self.root.level - self.depth;
        // All 32 bits may be shifted out.
        let code = morton(place.map(|place| (u64::from(place) >> shift) as u32));
        code as usize & (self.cells.len() - 1)
    }
}

/// Buffers of a thread.
#[derive(Default)]
pub(super) struct Space {
    cells: Vec<u32>,
    ends: Vec<u32>,
    used: Vec<u32>,
    sorted: Vec<u8>,
}

/// Lowest and highest steps of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub(super) low: [i32; 3],
    pub(super) high: [i32; 3],
}

impl Bounds {
    pub(super) const NONE: Self = Self { low: [i32::MAX; 3], high: [i32::MIN; 3] };

    pub(super) fn add(&mut self, steps: [i32; 3]) {
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(steps[axis]);
            self.high[axis] = self.high[axis].max(steps[axis]);
        }
    }

    pub(super) fn join(&mut self, other: &Self) {
        self.add(other.low);
        self.add(other.high);
    }

    pub(super) fn corners(&self) -> [[i64; 3]; 2] {
        [self.low.map(i64::from), self.high.map(i64::from)]
    }
}

/// Sorts records into the cells of a grid. Returns false at a point outside of the frame.
pub(super) fn scatter(
    frame: &Frame,
    grid: &Grid,
    spill: &Spill,
    records: &[u8],
    space: &mut Space,
    bounds: &mut Bounds,
) -> Result<bool, Error> {
    let len = spill.record_len;
    let Space { cells, ends, used, sorted } = space;
    cells.clear();
    used.clear();
    ends.resize(grid.cells.len(), 0);
    for record in records.chunks_exact(len) {
        let steps = steps_of(record);
        bounds.add(steps);
        let Some(place) = frame.place(steps) else {
            ends.fill(0);
            return Ok(false);
        };
        let cell = grid.cell(frame.bits, place);
        if ends[cell] == 0 {
            used.push(cell as u32);
        }
        ends[cell] += 1;
        cells.push(cell as u32);
    }
    if let [cell] = used[..] {
        ends[cell as usize] = 0;
        spill.append(&grid.cells, cell as usize, records)?;
        return Ok(true);
    }
    let mut start = 0;
    for &cell in &*used {
        (ends[cell as usize], start) = (start, start + ends[cell as usize]);
    }
    sorted.resize(records.len(), 0);
    for (record, &cell) in records.chunks_exact(len).zip(&*cells) {
        let at = ends[cell as usize] as usize * len;
        sorted[at..at + len].copy_from_slice(record);
        ends[cell as usize] += 1;
    }
    let mut start = 0;
    for &cell in &*used {
        let end = std::mem::take(&mut ends[cell as usize]) as usize * len;
        spill.append(&grid.cells, cell as usize, &sorted[start..end])?;
        start = end;
    }
    Ok(true)
}

/// Joins cells to parts, in Morton order.
pub(super) fn parts(frame: &Frame, grid: Grid, spill: &Spill, progress: &dyn Progress) -> Result<Vec<Chunk>, Error> {
    let mut parts = Vec::new();
    let mut joining = Joining { frame, spill, progress, most: most_points(spill.record_len), parts: &mut parts };
    joining.join(grid)?;
    Ok(parts)
}

struct Joining<'a> {
    frame: &'a Frame,
    spill: &'a Spill,
    progress: &'a dyn Progress,
    most: u64,
    parts: &'a mut Vec<Chunk>,
}

impl Joining<'_> {
    fn join(&mut self, grid: Grid) -> Result<(), Error> {
        let Grid { root, depth, cells } = grid;
        // Written out, cells need no memory until they are read.
        self.spill.write_all(&cells)?;
        let mut cells: Vec<SpillCell> = cells.into_iter().map(|cell| std::mem::take(&mut *lock(&cell))).collect();
        self.visit(root, depth, &mut cells)
    }

    /// Joins the cells of a cube that is `depth` levels above them.
    fn visit(&mut self, place: Place, depth: u32, cells: &mut [SpillCell]) -> Result<(), Error> {
        if self.progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let points: u64 = cells.iter().map(|cell| cell.count).sum();
        if points == 0 {
            return Ok(());
        }
        if points <= self.most {
            let cells = cells.iter_mut().filter(|cell| cell.count > 0).map(std::mem::take).collect();
            self.parts.push(Chunk { place, points, cells });
        } else if depth > 0 {
            let size = cells.len() / 8;
            for (octant, cells) in cells.chunks_mut(size).enumerate() {
                let below = Place { level: place.level + 1, code: place.code << 3 | octant as u64 };
                self.visit(below, depth - 1, cells)?;
            }
        } else {
            let finer = Grid::below(self.frame, place, FINER);
            let cells: Vec<SpillCell> = cells.iter_mut().map(std::mem::take).collect();
            if finer.depth == 0 {
                // So many points are at one place.
                self.parts.push(Chunk { place, points, cells });
                return Ok(());
            }
            let (mut space, mut bounds) = (Space::default(), Bounds::NONE);
            for cell in cells {
                self.spill.take(cell, |records| {
                    scatter(self.frame, &finer, self.spill, records, &mut space, &mut bounds).map(drop)
                })?;
            }
            self.join(finer)?;
        }
        Ok(())
    }
}

impl Chunk {
    /// The records, whose memory and disk are free afterwards.
    pub(super) fn load(self, spill: &Spill) -> Result<Vec<u8>, Error> {
        let mut records = Vec::with_capacity(self.points as usize * spill.record_len);
        for cell in self.cells {
            spill.take(cell, |bytes| {
                records.extend_from_slice(bytes);
                Ok(())
            })?;
        }
        Ok(records)
    }
}

/// Whether some point was outside of the frame.
#[derive(Default)]
pub(super) struct Outside(AtomicBool);

impl Outside {
    pub(super) fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    pub(super) fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
