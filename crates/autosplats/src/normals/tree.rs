//! A balanced kd-tree with sixteen points to a leaf and sixteen children to a node.
//!
//! # How it works
//! Points are halved by the median along the widest side of their box until sixteen are left, so that a leaf is small
//! where points are dense, and clusters of any size and distance get leaves of their own; a grid would be sized by the
//! outermost points. Coinciding points are halved as any others. What is kept is the order of the leaves and, per sixteen
//! of them, per sixteen of those and so on, their boxes.
//!
//! A binary tree with a box per node took 253 ms of processor time where this takes 220 (all of it, a million points, k = 10).

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use pulp::Simd;
use rayon::prelude::*;

use crate::Error;
use crate::search::select::vectors;
use crate::search::{LANES, Lanes};
use crate::simd::F32s;

/// Nodes of no more leaves are built by one thread.
const TASK_LEAVES: usize = 256;

/// A finite point of the cloud: its position, and its place in the cloud as the bits of a number.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(super) struct Point([f32; 4]);

impl Point {
    pub(super) fn new([x, y, z]: [f32; 3], index: u32) -> Self {
        Self([x, y, z, f32::from_bits(index)])
    }

    fn index(&self) -> u32 {
        self.0[3].to_bits()
    }
}

/// A box with its faces parallel to the axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) low: [f32; 3],
    pub(super) high: [f32; 3],
}

impl Bounds {
    /// Contains nothing.
    pub(super) const EMPTY: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    fn of(points: &[Point]) -> Self {
        // Four boxes grow at once, as one would wait for itself, and with the index as a fourth coordinate: a whole vector.
        let mut low = [[f32::INFINITY; 4]; 4];
        let mut high = [[f32::NEG_INFINITY; 4]; 4];
        let (fours, rest) = points.as_chunks::<4>();
        for four in fours {
            for (Point(at), (low, high)) in four.iter().zip(low.iter_mut().zip(&mut high)) {
                for axis in 0..4 {
                    low[axis] = lesser(at[axis], low[axis]);
                    high[axis] = larger(at[axis], high[axis]);
                }
            }
        }
        let mut bounds = Self::EMPTY;
        for axis in 0..3 {
            bounds.low[axis] = low.iter().map(|low| low[axis]).fold(f32::INFINITY, lesser);
            bounds.high[axis] = high.iter().map(|high| high[axis]).fold(f32::NEG_INFINITY, larger);
        }
        for &Point([x, y, z, _]) in rest {
            bounds.include([x, y, z]);
        }
        bounds
    }

    #[inline(always)]
    pub(super) fn include(&mut self, position: [f32; 3]) {
        for axis in 0..3 {
            self.low[axis] = lesser(position[axis], self.low[axis]);
            self.high[axis] = larger(position[axis], self.high[axis]);
        }
    }

    #[inline(always)]
    pub(super) fn at(position: [f32; 3]) -> Self {
        Self { low: position, high: position }
    }

    #[inline(always)]
    pub(super) fn extent(&self) -> [f32; 3] {
        [0, 1, 2].map(|axis: usize| self.high[axis] - self.low[axis])
    }

    fn widest_axis(&self) -> usize {
        let [x, y, z] = self.extent();
        if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        }
    }

    /// Squared distance between two boxes.
    #[inline(always)]
    pub(super) fn squared_distance(&self, other: &Self) -> f32 {
        let mut sum = 0.0;
        for axis in 0..3 {
            let gap = larger(self.low[axis] - other.high[axis], other.low[axis] - self.high[axis]);
            let gap = larger(gap, 0.0);
            sum += gap * gap;
        }
        sum
    }
}

// Without f32::max's care for NaN, which is two instructions more: no coordinate is NaN.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Sixteen points that lie close together, side by side for SIMD.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct Leaf {
    /// Infinite where the cloud's last leaf has no points left.
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

/// Boxes of sixteen nodes side by side, side by side for SIMD; empty where there are fewer.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct Boxes {
    low: [Lanes; 3],
    high: [Lanes; 3],
}

impl Boxes {
    fn of(boxes: impl Iterator<Item = Bounds>) -> Self {
        let mut all = Self { low: [Lanes([f32::INFINITY; LANES]); 3], high: [Lanes([f32::NEG_INFINITY; LANES]); 3] };
        for (lane, bounds) in boxes.enumerate() {
            for axis in 0..3 {
                all.low[axis].0[lane] = bounds.low[axis];
                all.high[axis].0[lane] = bounds.high[axis];
            }
        }
        all
    }

    /// The box around all of them.
    fn union(&self) -> Bounds {
        let least = |lanes: &Lanes| lanes.0.iter().copied().fold(f32::INFINITY, f32::min);
        let most = |lanes: &Lanes| lanes.0.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        Bounds { low: self.low.each_ref().map(least), high: self.high.each_ref().map(most) }
    }

    /// The `lane`-th box.
    pub(super) fn bounds(&self, lane: usize) -> Bounds {
        Bounds { low: self.low.map(|low| low.0[lane]), high: self.high.map(|high| high.0[lane]) }
    }

    /// Squared distance of each to a box.
    #[inline(always)]
    pub(super) fn squared_distances<S: Simd>(&self, simd: S, to: &Bounds) -> Lanes {
        squared_distances(simd, &self.low, &self.high, to)
    }
}

/// Squared distances between sixteen boxes and one.
#[inline(always)]
fn squared_distances<S: Simd>(simd: S, low: &[Lanes; 3], high: &[Lanes; 3], to: &Bounds) -> Lanes {
    let mut out = Lanes::default();
    let zero = F32s::splat(simd, 0.0);
    for vector in 0..vectors::<S>() {
        let mut sum = zero;
        for axis in 0..3 {
            let below = F32s::load(simd, &low[axis].0, vector) - F32s::splat(simd, to.high[axis]);
            let above = F32s::splat(simd, to.low[axis]) - F32s::load(simd, &high[axis].0, vector);
            let gap = below.max(above).max(zero);
            sum += gap * gap;
        }
        sum.store(&mut out.0, vector);
    }
    out
}

/// The points of the cloud in leaves, and the boxes of the leaves and of the nodes above them, sixteen to a node.
#[derive(Debug)]
pub(super) struct Tree {
    /// Number of points.
    pub(super) len: usize,
    pub(super) leaves: Vec<Leaf>,
    /// Boxes by level: of the leaves first, of the root's children last. Node i's children are 16·i to 16·i + 15.
    pub(super) levels: Vec<Vec<Boxes>>,
}

/// Told what part is done, 0 to 1; an error stops the work.
type Tick<'a> = dyn Fn(f32) -> Result<(), Error> + Sync + 'a;
/// Told of so many more leaves that are done; an error stops the work.
type Built<'a> = dyn Fn(usize) -> Result<(), Error> + Sync + 'a;

/// Level, 0 for leaves, and number in it.
pub(super) type Node = (usize, usize);

impl Tree {
    /// `tick` is told what part is done, 0 to 1, and may stop the work.
    pub(super) fn build(mut points: Vec<Point>, tick: &Tick) -> Result<Self, Error> {
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

    /// The median of each coordinate of one point per leaf; the origin if there is none.
    pub(super) fn middle(&self) -> [f32; 3] {
        [0, 1, 2].map(|axis: usize| {
            let mut coordinates: Vec<f32> = self.leaves.iter().map(|leaf| leaf.position[axis].0[0]).collect();
            let half = coordinates.len() / 2;
            if coordinates.is_empty() { 0.0 } else { *coordinates.select_nth_unstable_by(half, f32::total_cmp).1 }
        })
    }

    pub(super) fn root(&self) -> Node {
        (self.levels.len(), 0)
    }

    /// The boxes of a node's children, their level and the number of the first; of a leaf none.
    pub(super) fn children(&self, (level, number): Node) -> Option<(&Boxes, usize, usize)> {
        let level = level.checked_sub(1)?;
        Some((&self.levels[level][number], level, number * LANES))
    }

    /// Points in a leaf: sixteen, but for the last.
    #[inline(always)]
    pub(super) fn lanes(&self, leaf: usize) -> usize {
        LANES.min(self.len - leaf * LANES)
    }

    pub(super) fn bounds(&self, leaf: usize) -> Bounds {
        self.levels[0][leaf / LANES].bounds(leaf % LANES)
    }
}

/// Sorts points into leaves. `built` is told of leaves done, and asked whether to go on.
fn split(points: &mut [Point], leaves: &mut [Leaf], built: &Built) -> Result<(), Error> {
    let count = leaves.len();
    if count == 1 {
        leaves[0] = Leaf::of(points);
        return Ok(());
    }
    // A node has sixteen children: halves begin where a node of the highest level below this one does.
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
            // What is larger is told of by its parts.
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
