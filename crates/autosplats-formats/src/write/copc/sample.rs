//! Which points of a node's children stand for them in the node: of each cell the one nearest to the mean.
//!
//! # How it works
//!
//! The candidates of a cell follow each other, since all are in Morton order. The mean is of all points of the tree
//! that lie in the cell, which candidates carry as counts and sums. A point that is alone in its cell, with fewer than
//! [`FEW`] others in the 26 cells around, is *lone*: most likely an outlier, which coarse levels shall not show. It
//! stays where it is, and stays a candidate, since the cells of coarser levels are larger. Neighbouring nodes are not
//! looked at, so that a node depends on its own points alone.
//!
//! All numbers are integers: the result does not depend on the order of summation.

use super::frame::CELL_BITS;

/// A point is lone if fewer others are around it.
const FEW: u32 = 3;

/// Cells along an edge of a node, with a border of empty cells.
const EDGE: usize = (1 << CELL_BITS) + 2;

/// A point that may stand for others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    /// Place of the point.
    pub(super) place: [u32; 3],
    /// Mean place of the points that it stands for.
    pub(super) mean: [u32; 3],
    /// Number of these points.
    pub(super) count: u32,
}

/// A candidate that was chosen for its cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Choice {
    /// Index among the candidates.
    pub(super) index: u32,
    /// Mean place and number of the points of the cell.
    pub(super) mean: [u32; 3],
    pub(super) count: u32,
    pub(super) lone: bool,
}

/// Chooses points for nodes, one after another.
pub(super) struct Sampler {
    /// Number of points in each cell, at most 255; zero between two calls.
    counts: Vec<u8>,
}

impl Sampler {
    pub(super) fn new() -> Self {
        Self { counts: vec![0; EDGE * EDGE * EDGE] }
    }

    /// Chooses one of the candidates in each cell of a node, whose cells are `2^shift` places wide. If all were lone,
    /// none is.
    pub(super) fn choose(&mut self, count: usize, shift: u32, get: impl Fn(usize) -> Candidate) -> Vec<Choice> {
        let mut choices = Vec::with_capacity(count / 3);
        let mut cells = Vec::new();
        let mut start = 0;
        while start < count {
            let first = get(start);
            let cell = first.place.map(|place| place >> shift);
            let mut end = start + 1;
            while end < count && get(end).place.map(|place| place >> shift) == cell {
                end += 1;
            }
            let (index, mean, points) = if end == start + 1 {
                (start, first.mean, first.count)
            } else {
                nearest(start..end, cell.map(|at| at << shift), &get)
            };
            let local = cell.map(|at| (at as usize & ((1 << CELL_BITS) - 1)) + 1);
            let at = (local[2] * EDGE + local[1]) * EDGE + local[0];
            self.counts[at] = points.min(255) as u8;
            cells.push(at as u32);
            choices.push(Choice { index: index as u32, mean, count: points, lone: false });
            start = end;
        }
        let mut all = true;
        for (choice, &at) in choices.iter_mut().zip(&cells) {
            choice.lone = choice.count == 1 && self.is_lone(at as usize);
            all &= choice.lone;
        }
        if all {
            choices.iter_mut().for_each(|choice| choice.lone = false);
        }
        cells.iter().for_each(|&at| self.counts[at as usize] = 0);
        choices
    }

    /// Whether fewer than [`FEW`] points are in the cells around one.
    fn is_lone(&self, at: usize) -> bool {
        let mut others = 0;
        for z in [at - EDGE * EDGE, at, at + EDGE * EDGE] {
            for y in [z - EDGE, z, z + EDGE] {
                others += self.counts[y - 1..y + 2].iter().map(|&count| u32::from(count)).sum::<u32>();
            }
            // The point itself is counted in the middle.
            if others > FEW {
                return false;
            }
        }
        true
    }
}

/// The candidate nearest to the mean of a cell, the mean, and the number of points. Of equally near ones the first
/// wins.
fn nearest(
    range: std::ops::Range<usize>,
    corner: [u32; 3],
    get: &impl Fn(usize) -> Candidate,
) -> (usize, [u32; 3], u32) {
    let (mut points, mut sums) = (0_u64, [0_u64; 3]);
    for index in range.clone() {
        let Candidate { mean, count, .. } = get(index);
        points += u64::from(count);
        for axis in 0..3 {
            sums[axis] += u64::from(mean[axis] - corner[axis]) * u64::from(count);
        }
    }
    let mean = [0, 1, 2].map(|axis| corner[axis] + (sums[axis] / points) as u32);
    let distance = |index: &usize| {
        let place = get(*index).place;
        let square = |axis: usize| u64::from(place[axis].abs_diff(mean[axis])).pow(2);
        square(0) + square(1) + square(2)
    };
    let index = range.clone().min_by_key(distance).unwrap_or(range.start);
    (index, mean, u32::try_from(points).unwrap_or(u32::MAX))
}
