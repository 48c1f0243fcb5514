//! Points that come in parts, since memory need not hold them all.

use std::path::Path;

use glam::DVec3;

use crate::{Error, PointCloud, Progress, Scan};

/// Points that come as clouds, one after another. Whoever works on them needs memory for a cloud, and not for all.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Clouds, Held, PointCloud, glam::DVec3};
///
/// let cloud = PointCloud::new(DVec3::ZERO, vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
/// let mut high = 0.0_f64;
/// Held { name: "memory".as_ref(), cloud: &cloud }.read(&(), &mut |part| {
///     high = (0..part.len()).map(|i| part.world_position(i).z).fold(high, f64::max);
///     Ok(())
/// })?;
/// assert_eq!(high, 6.0);
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
pub trait Clouds: Sync + Send {
    /// Name of the input.
    fn name(&self) -> &Path;

    /// Number of points, if it is known before they are read.
    fn points(&self) -> Option<u64> {
        None
    }

    /// What all points hold, if that is known beforehand. Otherwise they are read once more to find out.
    ///
    /// # Errors
    /// Those of reading.
    fn outline(&self, _progress: &dyn Progress) -> Result<Option<Outline>, Error> {
        Ok(None)
    }

    /// All points, if memory holds them anyway.
    fn whole(&self) -> Option<&PointCloud> {
        None
    }

    /// Passes on all points in the input's order, in clouds that have the same fields. Points may be asked for several
    /// times, and are the same each time.
    ///
    /// # Errors
    /// Those of `take` and of reading.
    fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error>;
}

impl<C: Clouds + ?Sized> Clouds for &C {
    fn name(&self) -> &Path {
        (**self).name()
    }

    fn points(&self) -> Option<u64> {
        (**self).points()
    }

    fn outline(&self, progress: &dyn Progress) -> Result<Option<Outline>, Error> {
        (**self).outline(progress)
    }

    fn whole(&self) -> Option<&PointCloud> {
        (**self).whole()
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        (**self).read(progress, take)
    }
}

/// What the points of an input hold, known before they are read.
#[derive(Clone, Debug)]
pub struct Outline {
    /// Number of points. Other numbers change no point, but how the work is divided.
    pub points: u64,
    /// Corners of a box around all points, in world coordinates. Points outside of it, or a box four times too large,
    /// have the points read once more.
    pub bounds: [DVec3; 2],
    /// Some of the points, with all fields that the others have.
    pub some: PointCloud,
}

/// A cloud that is in memory.
pub struct Held<'a> {
    /// Name of the input.
    pub name: &'a Path,
    /// The points.
    pub cloud: &'a PointCloud,
}

impl Clouds for Held<'_> {
    fn name(&self) -> &Path {
        self.name
    }

    fn points(&self) -> Option<u64> {
        Some(self.cloud.len() as u64)
    }

    fn whole(&self) -> Option<&PointCloud> {
        Some(self.cloud)
    }

    fn read(
        &self,
        _progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        take(self.cloud)
    }
}

/// Points that are changed as they come.
pub struct Changed<'a> {
    /// The points before.
    pub clouds: &'a dyn Clouds,
    /// Changes each cloud, which keeps the number of its points.
    pub change: Box<dyn Fn(&mut PointCloud) + Sync + Send + 'a>,
}

impl Clouds for Changed<'_> {
    fn name(&self) -> &Path {
        self.clouds.name()
    }

    fn points(&self) -> Option<u64> {
        self.clouds.points()
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.clouds.read(progress, &mut |cloud| {
            let mut cloud = cloud.clone();
            (self.change)(&mut cloud);
            take(&cloud)
        })
    }
}

/// Adds the scans of a part of [`Clouds`], before which there are `before` points. A scan that goes on from the part
/// before stays one.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Scan, add_scans, glam::DMat4};
///
/// let scan = |points| Scan { name: Some("hall".into()), world_from_sensor: DMat4::IDENTITY, points };
/// let mut all = Vec::new();
/// add_scans(&mut all, &[scan(0..10)], 0);
/// add_scans(&mut all, &[scan(0..5)], 10);
/// assert_eq!(all, [scan(0..15)]);
/// ```
pub fn add_scans(all: &mut Vec<Scan>, part: &[Scan], before: usize) {
    for scan in part {
        let points = scan.points.start + before..scan.points.end + before;
        match all.last_mut() {
            Some(last)
                if last.points.end == points.start
                    && (&last.name, last.world_from_sensor) == (&scan.name, scan.world_from_sensor) =>
            {
                last.points.end = points.end;
            }
            _ => all.push(Scan { points, ..scan.clone() }),
        }
    }
}
