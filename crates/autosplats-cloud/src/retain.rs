//! Removing points from a cloud.

use glam::DVec3;
use rayon::prelude::*;

use crate::{PointCloud, each_type, identity::Identity};

/// Points checked for zeros as one piece of parallel work.
const BLOCK: usize = 1 << 14;

impl PointCloud {
    /// Keeps the points for which `keep`, called with their index, is true. Order and attributes are kept.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_cloud::{PointCloud, glam::DVec3};
    ///
    /// let mut cloud = PointCloud::new(DVec3::ZERO, vec![[0.0, 0.0, 1.0], [0.0, 0.0, 3.0]]);
    /// let high: Vec<bool> = (0..cloud.len()).map(|i| cloud.world_position(i).z > 2.0).collect();
    /// cloud.retain(|i| high[i]);
    /// assert_eq!(cloud.positions(), [[0.0, 0.0, 3.0]]);
    /// ```
    pub fn retain(&mut self, keep: impl Fn(usize) -> bool + Sync + Send) {
        let keep: Vec<bool> = (0..self.len()).into_par_iter().map(keep).collect();
        if keep.iter().all(|&keep| keep) {
            return;
        }
        self.identity = Identity::default();
        self.move_scans(&keep);
        compact(&mut self.positions, &keep);
        if let Some(residuals) = &mut self.residuals {
            compact(residuals, &keep);
        }
        if let Some(colors) = &mut self.colors {
            compact(colors, &keep);
        }
        for field in &mut self.fields {
            each_type!(&mut field.values, v => compact(v, &keep));
        }
    }

    /// Removes the points at (0, 0, 0), which scanners write for missing returns, if `accepts` is true of their number.
    /// Returns the number of removed points.
    pub fn drop_no_returns(&mut self, accepts: impl Fn(usize) -> bool) -> usize {
        let count = self.no_returns();
        if count == 0 || !accepts(count) {
            return 0;
        }
        let keep: Vec<bool> = (0..self.len()).into_par_iter().map(|i| !self.is_no_return(i)).collect();
        self.retain(|i| keep[i]);
        count
    }

    /// Number of points at (0, 0, 0), which scanners write for missing returns.
    pub fn no_returns(&self) -> usize {
        if !self.is_world() {
            return (0..self.len()).into_par_iter().filter(|&i| self.is_no_return(i)).count();
        }
        let zeros = |points: &[[f32; 3]]| points.iter().map(|point| usize::from(is_zero(point))).sum::<usize>();
        self.positions.par_chunks(BLOCK).map(zeros).sum()
    }

    fn is_no_return(&self, index: usize) -> bool {
        if self.is_world() { is_zero(&self.positions[index]) } else { self.world_position(index) == DVec3::ZERO }
    }

    /// Whether positions are world coordinates.
    fn is_world(&self) -> bool {
        self.origin == DVec3::ZERO && self.residuals.is_none()
    }

    /// Updates the ranges of the scans in one pass over the points: there may be as many scans as points.
    fn move_scans(&mut self, keep: &[bool]) {
        let mut ends: Vec<usize> = self.scans.iter().flat_map(|scan| [scan.points.start, scan.points.end]).collect();
        ends.sort_unstable();
        ends.dedup();
        let (mut before, mut at) = (0, 0);
        let kept: Vec<usize> = ends
            .iter()
            .map(|&end| {
                before += keep[at..end].iter().filter(|&&keep| keep).count();
                at = end;
                before
            })
            .collect();
        for scan in &mut self.scans {
            let moved = |end: usize| ends.binary_search(&end).map_or(0, |index| kept[index]);
            scan.points = moved(scan.points.start)..moved(scan.points.end);
        }
    }
}

/// Whether a position is zero: no bit is set but the signs.
fn is_zero([x, y, z]: &[f32; 3]) -> bool {
    (x.to_bits() | y.to_bits() | z.to_bits()) << 1 == 0
}

fn compact<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut index = 0;
    values.retain(|_| {
        index += 1;
        keep[index - 1]
    });
}
