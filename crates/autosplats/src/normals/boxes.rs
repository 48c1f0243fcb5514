//! Axis-aligned boxes of points, single and in groups of sixteen, and the distances between them.

use pulp::Simd;

use crate::search::select::vectors;
use crate::search::{LANES, Lanes};
use crate::simd::F32s;

/// A finite point of the cloud: its position, and the bits of its index as a fourth number.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(super) struct Point(pub(super) [f32; 4]);

impl Point {
    pub(super) fn new([x, y, z]: [f32; 3], index: u32) -> Self {
        Self([x, y, z, f32::from_bits(index)])
    }

    pub(super) fn index(&self) -> u32 {
        self.0[3].to_bits()
    }
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) low: [f32; 3],
    pub(super) high: [f32; 3],
}

impl Bounds {
    /// Contains no point.
    pub(super) const EMPTY: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    pub(super) fn of(points: &[Point]) -> Self {
        // Four boxes grow at once, to shorten the chain of dependent steps. The index as a fourth coordinate fills a
        // vector.
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

    pub(super) fn widest_axis(&self) -> usize {
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

// `f32::max` would spend two instructions more on NaN, which no coordinate is.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The boxes of sixteen nodes, in lanes for SIMD; empty boxes fill the rest.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct Boxes {
    low: [Lanes; 3],
    high: [Lanes; 3],
}

impl Boxes {
    pub(super) fn of(boxes: impl Iterator<Item = Bounds>) -> Self {
        let mut all = Self { low: [Lanes([f32::INFINITY; LANES]); 3], high: [Lanes([f32::NEG_INFINITY; LANES]); 3] };
        for (lane, bounds) in boxes.enumerate() {
            for axis in 0..3 {
                all.low[axis].0[lane] = bounds.low[axis];
                all.high[axis].0[lane] = bounds.high[axis];
            }
        }
        all
    }

    /// The box around all boxes.
    pub(super) fn union(&self) -> Bounds {
        let least = |lanes: &Lanes| lanes.0.iter().copied().fold(f32::INFINITY, f32::min);
        let most = |lanes: &Lanes| lanes.0.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        Bounds { low: self.low.each_ref().map(least), high: self.high.each_ref().map(most) }
    }

    /// The `lane`-th box.
    pub(super) fn bounds(&self, lane: usize) -> Bounds {
        Bounds { low: self.low.map(|low| low.0[lane]), high: self.high.map(|high| high.0[lane]) }
    }

    /// Squared distance of each box to another.
    #[inline(always)]
    pub(super) fn squared_distances<S: Simd>(&self, simd: S, to: &Bounds) -> Lanes {
        squared_distances(simd, &self.low, &self.high, to)
    }
}

/// Squared distances between sixteen boxes and one.
#[inline(always)]
pub(super) fn squared_distances<S: Simd>(simd: S, low: &[Lanes; 3], high: &[Lanes; 3], to: &Bounds) -> Lanes {
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
