//! Chooses the size of a picture and the share of its points from its time limit.

use autosplats::cloud::PointCloud;

use crate::session::ShownCloud;

/// Smallest scale of a picture with a time limit, by its sides.
const LEAST_SCALE: f64 = 0.25;
/// Share of the time limit that projecting all points may take before points are left out.
const MAX_PROJECT_SHARE: f64 = 0.4;
/// Margin, in halvings, before more points are used again.
const HALVING_MARGIN: f64 = 0.6;
/// Smallest change of the scale's logarithm that is applied, so that the picture's size does not flicker.
const MIN_SCALE_CHANGE: f64 = 0.08;

/// Scale and share of points of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reduction {
    /// Sides relative to the window's picture, 0.25 to 1.
    pub(super) scale: f64,
    /// Number of times the points are halved.
    pub(super) halvings: u32,
}

impl Reduction {
    pub(super) const WHOLE: Self = Self { scale: 1.0, halvings: 0 };
}

/// Cost estimates, averaged over the last pictures.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Costs {
    /// Milliseconds per million points; 0 while unknown.
    points: f64,
    /// Milliseconds per million pixels; 0 while unknown.
    pixels: f64,
    last: Option<Reduction>,
}

impl Costs {
    /// Updates the estimates from a picture: numbers of points and pixels, and milliseconds spent on each.
    pub(super) fn learn(&mut self, points: usize, pixels: usize, point_ms: f64, pixel_ms: f64) {
        let blend = |old: f64, new: f64| if old > 0.0 { 0.6 * old + 0.4 * new } else { new };
        self.points = blend(self.points, point_ms / (points.max(1) as f64 * 1e-6));
        self.pixels = blend(self.pixels, pixel_ms / (pixels.max(1) as f64 * 1e-6));
    }

    /// Number of points that a picture of `budget_ms` can have, rounded down to a power of two so that it seldom
    /// changes; `None` while that is unknown.
    pub(super) fn most_points(&self, budget_ms: f64) -> Option<usize> {
        let millions = MAX_PROJECT_SHARE * budget_ms / self.points;
        (self.points > 0.0 && millions.is_finite()).then(|| 1 << ((millions * 1e6).max(1.0) as usize).ilog2())
    }

    /// The scale and share of points at which a picture of all `points` and `pixels` should take `budget_ms`.
    pub(super) fn pace(&mut self, points: usize, pixels: usize, budget_ms: f64) -> Reduction {
        let all_points = self.points * points as f64 * 1e-6;
        let all_pixels = self.pixels * pixels as f64 * 1e-6;
        let needed = (all_points / (MAX_PROJECT_SHARE * budget_ms)).log2();
        let mut halvings = needed.ceil().clamp(0.0, 16.0) as u32;
        if let Some(last) = self.last
            && halvings < last.halvings
            && needed > f64::from(last.halvings) - 1.0 - HALVING_MARGIN
        {
            // A new subset has to be picked from all points, which must be worth its cost.
            halvings = last.halvings;
        }
        let left = budget_ms - all_points / f64::from(1 << halvings);
        let mut scale = (left / all_pixels.max(1e-9)).sqrt().clamp(LEAST_SCALE, 1.0);
        if let Some(last) = self.last
            && (last.scale / scale).ln().abs() < MIN_SCALE_CHANGE
        {
            scale = last.scale;
        }
        let pace = Reduction { scale, halvings };
        self.last = Some(pace);
        pace
    }
}

/// A part of the points, for pictures with a time limit.
pub(super) struct PointSubset {
    /// Identity of the full cloud.
    pub(super) identity: u64,
    pub(super) halvings: u32,
    pub(super) cloud: PointCloud,
    /// Index of each point in the full cloud.
    pub(super) indices: Vec<u32>,
}

impl PointSubset {
    /// Picks the [part](ShownCloud::thinned) that a number of halvings leaves.
    pub(super) fn new(shown: &ShownCloud, halvings: u32) -> Self {
        let indices = shown.thinned(halvings);
        Self { identity: shown.cloud.identity(), halvings, cloud: shown.cloud.pick(&indices), indices }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_that_are_fast_enough_stay_whole() {
        let mut costs = Costs::default();
        costs.learn(100_000, 1_000_000, 2.0, 10.0);
        assert_eq!(costs.pace(100_000, 1_000_000, 33.0), Reduction::WHOLE, "12 of 33 ms");
    }

    #[test]
    fn the_points_of_a_moving_picture_seldom_change_in_number() {
        let mut costs = Costs::default();
        assert_eq!(costs.most_points(33.0), None, "nothing is known");
        for point_ms in [10.0, 11.0, 12.0] {
            costs.learn(1_000_000, 1_000_000, point_ms, 90.0);
            assert_eq!(costs.most_points(33.0), Some(1 << 20), "13 ms for points of about 11 ms a million");
        }
    }

    #[test]
    fn slow_pictures_shrink_until_they_fit() {
        let mut costs = Costs::default();
        costs.learn(1_000_000, 1_000_000, 10.0, 90.0);
        let pace = costs.pace(1_000_000, 1_000_000, 33.0);
        assert_eq!(pace.halvings, 0, "10 of 33 ms for the points are well");
        let predicted = 10.0 + 90.0 * pace.scale * pace.scale;
        assert!((predicted - 33.0).abs() < 1.0, "{predicted} ms at {pace:?}");
    }

    #[test]
    fn huge_clouds_lose_points() {
        let mut costs = Costs::default();
        costs.learn(100_000_000, 1_000_000, 1500.0, 90.0);
        let pace = costs.pace(100_000_000, 1_000_000, 33.0);
        assert!(1500.0 / f64::from(1 << pace.halvings) <= 0.4 * 33.0, "{pace:?}");
        assert!(pace.scale >= LEAST_SCALE, "{pace:?}");
    }

    #[test]
    fn the_part_of_the_points_does_not_flicker() {
        let mut costs = Costs::default();
        costs.learn(1_000_000, 1_000_000, 30.0, 20.0);
        let first = costs.pace(1_000_000, 1_000_000, 33.0).halvings;
        assert_eq!(first, 2, "a quarter of 30 ms is below 13");
        let mut cheaper = costs;
        cheaper.points = 25.0;
        assert_eq!(cheaper.pace(1_000_000, 1_000_000, 33.0).halvings, 2, "half would hardly fit: it stays");
        cheaper.points = 15.0;
        assert_eq!(cheaper.pace(1_000_000, 1_000_000, 33.0).halvings, 1, "half fits easily");
    }

    #[test]
    fn the_size_does_not_breathe() {
        let mut costs = Costs::default();
        costs.learn(1_000_000, 1_000_000, 10.0, 90.0);
        let first = costs.pace(1_000_000, 1_000_000, 33.0);
        costs.learn(1_000_000, 1_000_000, 10.0, 94.0);
        assert_eq!(costs.pace(1_000_000, 1_000_000, 33.0), first, "a little slower is no reason");
    }
}
