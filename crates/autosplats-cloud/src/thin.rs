//! Fewer points, and noisier points.

use glam::DVec3;
use rayon::prelude::*;

use crate::{Error, PointCloud, Progress, identity::Identity, precision::residual, random::Random};

/// Points processed between two checks for cancellation.
const BLOCK: usize = 1 << 20;

impl PointCloud {
    /// Keeps the points inside a box of world coordinates, faces included. Points without a finite position go.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_cloud::{PointCloud, glam::DVec3};
    ///
    /// let line = (0..10).map(|x| [x as f32, 0.0, 0.0]).collect();
    /// let mut cloud = PointCloud::new(DVec3::ZERO, line);
    /// cloud.crop(DVec3::ZERO, DVec3::new(3.5, 1.0, 1.0));
    /// assert_eq!(cloud.len(), 4);
    /// ```
    pub fn crop(&mut self, min: DVec3, max: DVec3) {
        let inside: Vec<bool> = (0..self.len())
            .into_par_iter()
            .map(|i| {
                let point = self.world_position(i);
                point.cmpge(min).all() && point.cmple(max).all()
            })
            .collect();
        self.retain(|i| inside[i]);
    }

    /// Keeps the first of every `step` points, in the file's order.
    ///
    /// # Panics
    /// If `step` is 0.
    pub fn keep_every(&mut self, step: usize) {
        assert!(step > 0, "every 0th point");
        self.retain(|i| i.is_multiple_of(step));
    }

    /// Keeps one point per occupied cube of edge length `size`, in the file's unit: the point nearest to the mean of
    /// the cube's points. Position and attributes of that point stay unchanged. Cubes are aligned with world coordinate
    /// zero, so clouds of the same place are thinned alike. Points without a finite position are removed.
    ///
    /// # Errors
    /// [`Error::BadValue`] if `size` is not above zero, or so small that cube indices overflow; [`Error::Cancelled`] if
    /// `progress` says so.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_cloud::{PointCloud, glam::DVec3};
    ///
    /// let line = (0..40).map(|i| [0.25 * i as f32, 0.0, 0.0]).collect();
    /// let mut cloud = PointCloud::new(DVec3::ZERO, line);
    /// cloud.thin_by_voxel(1.0, &())?;
    /// assert_eq!(cloud.len(), 10);
    /// # Ok::<(), autosplats_cloud::Error>(())
    /// ```
    pub fn thin_by_voxel(&mut self, size: f64, progress: &dyn Progress) -> Result<(), Error> {
        check_voxel(size)?;
        progress.tick(0.0)?;
        let mut cells: Vec<([i64; 3], u32)> = (0..self.len())
            .into_par_iter()
            .filter_map(|i| match cube(self.world_position(i), size) {
                Ok(cell) => cell.map(|cell| Ok((cell, i as u32))),
                Err(error) => Some(Err(error)),
            })
            .collect::<Result<_, Error>>()?;
        progress.tick(0.2)?;
        // Sorting puts the points of a cube side by side, in the file's order.
        cells.par_sort_unstable();
        progress.tick(0.8)?;
        let mut keep = vec![false; self.len()];
        for cube in cells.chunk_by(|(a, _), (b, _)| a == b) {
            let point = |i: usize| self.world_position(cube[i].1 as usize) - self.origin;
            keep[cube[nearest_to_mean(cube.len(), point)].1 as usize] = true;
        }
        drop(cells);
        self.retain(|i| keep[i]);
        progress.tick(1.0)
    }

    /// Adds normally distributed noise of standard deviation `sigma` to every point, along each axis, in the file's
    /// unit. The same `seed` gives the same noise.
    ///
    /// # Errors
    /// [`Error::BadValue`] if `sigma` is not zero or above; [`Error::Cancelled`] if `progress` says so.
    pub fn add_noise(&mut self, sigma: f64, seed: u64, progress: &dyn Progress) -> Result<(), Error> {
        self.add_noise_from(0, sigma, seed, progress)
    }

    /// Like [`add_noise`](Self::add_noise), of a part of a cloud, before which there are `before` points.
    pub(crate) fn add_noise_from(
        &mut self,
        before: u64,
        sigma: f64,
        seed: u64,
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        if !(sigma >= 0.0 && sigma.is_finite()) {
            return Err(Error::BadValue { name: "noise", value: sigma, rule: "0 or above" });
        }
        self.resolution = None;
        self.identity = Identity::default();
        for start in (0..self.len()).step_by(BLOCK) {
            progress.tick(start as f32 / self.len() as f32)?;
            let end = self.len().min(start + BLOCK);
            let moved = |i: usize| self.world_position(i) - self.origin + sigma * normal(seed, before + i as u64);
            let moved: Vec<DVec3> = (start..end).into_par_iter().map(moved).collect();
            for (position, moved) in self.positions[start..end].iter_mut().zip(&moved) {
                *position = moved.as_vec3().to_array();
            }
            if let Some(residuals) = &mut self.residuals {
                residuals[start..end].iter_mut().zip(&moved).for_each(|(lost, moved)| *lost = residual(*moved));
            }
        }
        progress.tick(1.0)
    }
}

/// Fails for sizes that cannot be.
pub(crate) fn check_voxel(size: f64) -> Result<(), Error> {
    if size > 0.0 && size.is_finite() {
        return Ok(());
    }
    Err(Error::BadValue { name: "voxel size", value: size, rule: "above 0" })
}

/// The cube that a place lies in; `None` if it is not finite.
pub(crate) fn cube(place: DVec3, size: f64) -> Result<Option<[i64; 3]>, Error> {
    let cell = (place / size).floor();
    if !cell.is_finite() {
        return Ok(None);
    }
    let cell = cell.to_array().map(|value| value as i64);
    if cell.iter().any(|&value| value.unsigned_abs() > 1 << 52) {
        return Err(Error::BadValue { name: "voxel size", value: size, rule: "larger for these coordinates" });
    }
    Ok(Some(cell))
}

/// Which of some points, at least one, is nearest to their mean; the first of several.
pub(crate) fn nearest_to_mean(count: usize, point: impl Fn(usize) -> DVec3) -> usize {
    let mean = (0..count).map(&point).sum::<DVec3>() / count as f64;
    let distance = |i: &usize| point(*i).distance_squared(mean);
    (0..count).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
}

/// Three normally distributed numbers, by the Box-Muller method.
fn normal(seed: u64, index: u64) -> DVec3 {
    let mut random = Random::numbered(seed, index);
    // Above 0 and at most 1.
    let mut unit = || ((random.bits() >> 11) + 1) as f64 / (1_u64 << 53) as f64;
    let mut pair = || {
        let (radius, angle) = ((-2.0 * unit().ln()).sqrt(), std::f64::consts::TAU * unit());
        [radius * angle.cos(), radius * angle.sin()]
    };
    let ([x, y], [z, _]) = (pair(), pair());
    DVec3::new(x, y, z)
}
