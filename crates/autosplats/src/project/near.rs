//! Points near the eye: those on surfaces that the eye is closer to than a few of their distances.
//!
//! # How it works
//! Space is cut into cells by direction from the eye and by octave of distance. Each cell looks about equally large
//! from the eye. A cell with few points is *sparse*: its points are far apart, measured by their distance from the eye.
//! The screen serves such points badly. Their neighbours lie beside the screen or behind the eye, and their discs reach
//! into the picture from there. A density per pixel counts hardly one of them.
//!
//! So the points of sparse cells are listed once more, after the screen points, wherever they lie. Those of the
//! sparsest cells are *near* if their neighbours are in that list: going away from them in all directions, as many
//! points are met as they have neighbours before a cell that is not listed. Near points seek their neighbours in the
//! list, in space. Their entries among the screen points are silent, which means that they serve as neighbours only.
//! See docs/decisions/0067-neighbours-that-are-listed.md.
// Differs from the paper: the paper knows no points outside the picture.

use std::sync::atomic::{AtomicU32, Ordering};

use super::{SlotTable, whole};
use crate::camera::View;

/// Cells along the side of a face of the cube of directions.
pub(super) const FACE_CELLS: usize = 8;
/// Octaves of distance; nearer and more distant points share the cells of the first and last.
pub(super) const OCTAVES: usize = 20;
/// The first octave ends this many octaves beyond the near plane, at a thousandth of the way to where the eye looks.
pub(super) const FIRST_OCTAVE: u32 = 6;
/// Cells of an octave.
pub(super) const OCTAVE_CELLS: u32 = (6 * FACE_CELLS * FACE_CELLS) as u32;
/// Number of cells.
pub(crate) const NEAR_CELLS: usize = OCTAVES * OCTAVE_CELLS as usize;
/// Most points of a sparse cell.
pub(crate) const SPARSE_POINTS: u32 = 32;
/// Most points of a cell whose points are near. A surface then is nearer than about twelve of its points' distances.
pub(crate) const NEAR_POINTS: u32 = 16;
/// Reach, as a share of the distance from the eye, within which a near point has listed cells only.
pub(crate) const NEAR_REACH: f32 = 0.15;
/// Growth of the reach until the neighbours are met.
pub(super) const NEAR_REACH_GROWTH: f32 = 1.5;
/// Most reaches of a point; the last is 300 times as far as the eye.
pub(super) const NEAR_REACHES: u32 = 20;
/// Most points in the list of sparse cells, as the work per neighbourhood is the list. Octaves beyond are not listed.
pub(crate) const MOST_NEAR: usize = 4096;

/// The points of a frame per cell.
#[derive(Debug, Default)]
pub(super) struct NearCells {
    counts: Vec<AtomicU32>,
    /// [`SPARSE_POINTS`] ordinals of points for each cell; as many as counted are valid, in any order.
    entries: Vec<AtomicU32>,
    /// Number of octaves whose sparse cells are listed.
    listed_octaves: u32,
    /// Number of other points that a near point meets in listed cells.
    neighbors: u32,
    /// Number of the first octave.
    first_octave: u32,
    /// Indices of the points of sparse cells, cell by cell, by the bits of their positions in each.
    pub(super) listed: Vec<u32>,
}

/// Number of the first octave for a near plane.
pub(super) fn first_octave(near: f32) -> u32 {
    (near.to_bits() >> 23) + FIRST_OCTAVE
}

/// Cell of a position in view space, without branches; some cell if the position is not finite.
#[inline(always)]
pub(super) fn cell([x, y, z]: [f32; 3], first_octave: u32) -> u32 {
    // `f32::max` treats NaN specially, which takes four instructions instead of one.
    let either = |is_first: bool, first: f32, second: f32| if is_first { first } else { second };
    let greater = |a: f32, b: f32| either(a > b, a, b);
    let most = greater(greater(x.abs(), y.abs()), z.abs());
    let is_x = x.abs() == most;
    let is_y = !is_x & (y.abs() == most);
    let [along, u, v] = [either(is_x, x, either(is_y, y, z)), either(is_x, y, x), either(is_x | is_y, z, y)];
    let face = 4 - 4 * u32::from(is_x) - 2 * u32::from(is_y) + u32::from(along < 0.0);
    let half = 0.5 * FACE_CELLS as f32;
    let scale = half / most;
    let last = (FACE_CELLS - 1) as f32;
    // A point at the eye has a cell as well.
    let [column, row] = [u, v].map(|c| {
        let place = greater(c * scale + half, 0.0);
        whole(either(place < last, place, last))
    });
    // Signed, because baseline processors compare only such numbers several at a time.
    let octave = (most.to_bits() >> 23) as i32 - first_octave as i32;
    let octave = octave.clamp(0, OCTAVES as i32 - 1) as u32;
    ((octave * 6 + face) * FACE_CELLS as u32 + row) * FACE_CELLS as u32 + column
}

fn octave_of(cell: u32) -> u32 {
    cell / OCTAVE_CELLS
}

impl NearCells {
    /// Empties all cells for a frame.
    pub(super) fn clear(&mut self, view: &View) {
        self.first_octave = first_octave(view.near);
        self.counts.resize_with(NEAR_CELLS, AtomicU32::default);
        self.entries.resize_with(NEAR_CELLS * SPARSE_POINTS as usize, AtomicU32::default);
        self.counts.iter_mut().for_each(|count| *count.get_mut() = 0);
        self.listed.clear();
    }

    /// Counts the point with an ordinal.
    #[inline(always)]
    pub(super) fn add(&self, cell: u32, ordinal: u32) {
        let count = &self.counts[cell as usize];
        // Most cells are crowded: a load takes no cache line from other threads.
        if count.load(Ordering::Relaxed) <= SPARSE_POINTS {
            let at = count.fetch_add(1, Ordering::Relaxed);
            if at < SPARSE_POINTS {
                self.entries[(cell * SPARSE_POINTS + at) as usize].store(ordinal, Ordering::Relaxed);
            }
        }
    }

    fn count(&self, cell: u32) -> u32 {
        self.counts[cell as usize].load(Ordering::Relaxed)
    }

    /// Whether a cell misses no point in the list.
    fn is_listed(&self, cell: u32) -> bool {
        let count = self.count(cell);
        count == 0 || count <= SPARSE_POINTS && octave_of(cell) < self.listed_octaves
    }

    /// Lists the points of the sparse cells; none if no more than `k` or if no point is near. The order of the points
    /// does not matter, unless they are at the same place.
    pub(super) fn list(&mut self, cloud: &SlotTable<'_>, view: &View, k: u32) {
        let len = |octave: u32| {
            let cells = (octave * OCTAVE_CELLS..(octave + 1) * OCTAVE_CELLS).map(|cell| self.count(cell));
            cells.filter(|&count| count <= SPARSE_POINTS).sum::<u32>() as usize
        };
        let (mut octaves, mut total) = (0, 0);
        while octaves < OCTAVES as u32 && total + len(octaves) <= MOST_NEAR {
            total += len(octaves);
            octaves += 1;
        }
        (self.listed_octaves, self.neighbors) = (octaves, k.min(NEAR_POINTS));
        if total <= k as usize {
            return;
        }
        let place = |index: u32| cloud.to_view(index, view).to_array();
        let mut listed = Vec::with_capacity(total);
        for cell in (0..octaves * OCTAVE_CELLS).filter(|&cell| self.is_listed(cell)) {
            let first = listed.len();
            let entries = &self.entries[(cell * SPARSE_POINTS) as usize..][..self.count(cell) as usize];
            listed.extend(entries.iter().map(|entry| cloud.names.index(entry.load(Ordering::Relaxed))));
            let name = |index: u32| cloud.names.of(index);
            listed[first..].sort_unstable_by_key(|&index| (place(index).map(f32::to_bits), name(index)));
        }
        if listed.iter().any(|&index| self.is_near(place(index))) {
            self.listed = listed;
        }
    }

    /// Whether a point at a position in view space is near.
    pub(super) fn is_near(&self, position: [f32; 3]) -> bool {
        let at = |position: [f32; 3]| cell(position, self.first_octave);
        let own = at(position);
        if self.count(own) > NEAR_POINTS || !self.is_listed(own) {
            return false;
        }
        let [x, y, z] = position;
        let mut reach = NEAR_REACH * x.abs().max(y.abs()).max(z.abs());
        // Cells with points, so that there are no more of them than points met.
        let mut met = [0; NEAR_POINTS as usize + 1];
        let (mut cells, mut points) = (0, 0);
        for _ in 0..NEAR_REACHES {
            for side in 0..27 {
                let [a, b, c] = [side % 3, side / 3 % 3, side / 9].map(|step| (step as f32 - 1.0) * reach);
                let cell = at([x + a, y + b, z + c]);
                if !self.is_listed(cell) {
                    return false;
                }
                let count = self.count(cell);
                if count > 0 && points <= self.neighbors && !met[..cells].contains(&cell) {
                    met[cells] = cell;
                    cells += 1;
                    points += count;
                }
            }
            // The point itself is one of them.
            if points > self.neighbors {
                return true;
            }
            reach *= NEAR_REACH_GROWTH;
        }
        true
    }
}

/// The pixel of a listed point: its own, or the one at the screen's edge in its direction.
pub(super) fn clamped_pixel(position: [f32; 3], view: &View) -> u32 {
    let [x, y, z] = position;
    let depth = z.max(1e-3 * x.abs().max(y.abs()).max(z.abs())).max(f32::MIN_POSITIVE);
    let [x, y] = view.to_pixel([x, y, depth].into());
    // The casts saturate below.
    let [x, y] = [(x as u32).min(view.width - 1), (y as u32).min(view.height - 1)];
    y << 16 | x
}

#[cfg(test)]
mod tests;
