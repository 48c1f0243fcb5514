//! A balanced kd-tree with sixteen points to a leaf and sixteen children to a node.
//!
//! # How it works
//! Points are split at the median along the widest side of their box until sixteen are left. So leaves are small where
//! points are dense, and clusters of any size and distance get leaves of their own. The outermost points would
//! determine the cell size of a grid. Coinciding points are split like any others. The tree stores the order of leaves,
//! and boxes for each sixteen leaves, each sixteen of those, and so on.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use pulp::Simd;
use rayon::prelude::*;

use super::boxes::{Bounds, Boxes, Point, squared_distances};
use crate::Error;
use crate::search::{LANES, Lanes};

/// Nodes with no more leaves than this are built by one thread.
const TASK_LEAVES: usize = 256;

/// Sixteen points that lie close together, in lanes for SIMD.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct Leaf {
    /// Infinite in unused lanes of the cloud's last leaf.
    pub(super) position: [Lanes; 3],
    pub(super) index: [u32; LANES],
}

impl Leaf {
    const EMPTY: Self = Self { position: [Lanes([f32::INFINITY; LANES]); 3], index: [0; LANES] };

    fn of(points: &[Point]) -> Self {
        let mut leaf = Self::EMPTY;
        for (lane, point) in points.iter().enumerate() {
            for axis in 0..3 {
                leaf.position[axis].0[lane] = point.0[axis];
            }
            leaf.index[lane] = point.index();
        }
        leaf
    }

    fn bounds(&self) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for lane in (0..LANES).filter(|&lane| self.position[0].0[lane] < f32::INFINITY) {
            bounds.include(self.point(lane));
        }
        bounds
    }

    /// Squared distance of each point to a box.
    #[inline(always)]
    pub(super) fn squared_distances<S: Simd>(&self, simd: S, to: &Bounds) -> Lanes {
        squared_distances(simd, &self.position, &self.position, to)
    }

    #[inline(always)]
    pub(super) fn point(&self, lane: usize) -> [f32; 3] {
        [self.position[0].0[lane], self.position[1].0[lane], self.position[2].0[lane]]
    }
}

/// The points of the cloud in leaves, and the boxes of leaves and nodes, sixteen to a node.
#[derive(Debug)]
pub(super) struct Tree {
    /// Number of points.
    pub(super) len: usize,
    pub(super) leaves: Vec<Leaf>,
    /// Boxes by level, from the leaves to the root's children. Node i has children 16·i to 16·i + 15.
    pub(super) levels: Vec<Vec<Boxes>>,
}

/// Receives progress, 0 to 1; an error stops the work.
type OnProgress<'a> = dyn Fn(f32) -> Result<(), Error> + Sync + 'a;
/// Receives the number of newly built leaves; an error stops the work.
type OnLeavesBuilt<'a> = dyn Fn(usize) -> Result<(), Error> + Sync + 'a;

/// Level, 0 for leaves, and number in that level.
pub(super) type Node = (usize, usize);

impl Tree {
    /// Builds the tree; `tick` receives progress.
    pub(super) fn build(mut points: Vec<Point>, tick: &OnProgress) -> Result<Self, Error> {
        let mut leaves = vec![Leaf::EMPTY; points.len().div_ceil(LANES)];
        if !points.is_empty() {
            let done = AtomicUsize::new(0);
            let all = leaves.len() as f32;
            split(&mut points, &mut leaves, &|leaves| tick((done.fetch_add(leaves, Relaxed) + leaves) as f32 / all))?;
        }
        let mut levels: Vec<Vec<Boxes>> =
            vec![leaves.par_chunks(LANES).map(|leaves| Boxes::of(leaves.iter().map(Leaf::bounds))).collect()];
        while let Some(last) = levels.last()
            && last.len() > 1
        {
            let level = last.chunks(LANES).map(|boxes| Boxes::of(boxes.iter().map(Boxes::union))).collect();
            levels.push(level);
        }
        Ok(Self { len: points.len(), leaves, levels })
    }

    pub(super) fn root(&self) -> Node {
        (self.levels.len(), 0)
    }

    /// The boxes of a node's children, their level and the number of the first; `None` for a leaf.
    pub(super) fn children(&self, (level, number): Node) -> Option<(&Boxes, usize, usize)> {
        let level = level.checked_sub(1)?;
        Some((&self.levels[level][number], level, number * LANES))
    }

    /// Points in a leaf: sixteen, except for the last leaf.
    #[inline(always)]
    pub(super) fn lanes(&self, leaf: usize) -> usize {
        LANES.min(self.len - leaf * LANES)
    }

    pub(super) fn bounds(&self, leaf: usize) -> Bounds {
        self.levels[0][leaf / LANES].bounds(leaf % LANES)
    }
}

/// Sorts points into leaves; `built` receives the leaves done.
fn split(points: &mut [Point], leaves: &mut [Leaf], built: &OnLeavesBuilt) -> Result<(), Error> {
    let count = leaves.len();
    if count == 1 {
        leaves[0] = Leaf::of(points);
        return Ok(());
    }
    // Nodes have sixteen children, so a half begins where a node of the highest level below this one does.
    let mut span = 1;
    while span * LANES < count {
        span *= LANES;
    }
    let middle = (count / 2 / span * span).max(span);
    match Bounds::of(points).widest_axis() {
        0 => part::<0>(points, middle * LANES),
        1 => part::<1>(points, middle * LANES),
        _ => part::<2>(points, middle * LANES),
    }
    let (left, right) = points.split_at_mut(middle * LANES);
    let (left_leaves, right_leaves) = leaves.split_at_mut(middle);
    if count > TASK_LEAVES {
        built(0)?;
        let half = |points: &mut [Point], leaves: &mut [Leaf]| {
            split(points, leaves, built)?;
            // The parts of a larger half have reported already.
            if leaves.len() > TASK_LEAVES { Ok(()) } else { built(leaves.len()) }
        };
        let (left, right) = rayon::join(|| half(left, left_leaves), || half(right, right_leaves));
        return left.and(right);
    }
    split(left, left_leaves, built)?;
    split(right, right_leaves, built)
}

/// Moves the points with the `at` least coordinates to the front.
fn part<const AXIS: usize>(points: &mut [Point], at: usize) {
    points.select_nth_unstable_by(at, |a, b| a.0[AXIS].total_cmp(&b.0[AXIS]));
}
