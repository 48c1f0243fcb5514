//! A copy of clouds on the disk, for points that are read several times but are slow to read.

use std::{
    fs::File,
    path::{Path, PathBuf},
};

use crate::{
    Clouds, Crs, Error, Field, PointCloud, Progress, Scan, each_type,
    files::{read_exact_at, temporary_failed, temporary_unnamed, write_all_at},
    identity::Identity,
};

/// Points of [`Clouds`], kept in a temporary file without a name, so that nothing is left whatever ends the program.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Clouds, Held, PointCloud, Spool, glam::DVec3};
///
/// # let folder = tempfile::tempdir()?;
/// let cloud = PointCloud::new(DVec3::ZERO, vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
/// let spool = Spool::of(&Held { name: "memory".as_ref(), cloud: &cloud }, folder.path(), &())?;
/// spool.read(&(), &mut |part| Ok(assert_eq!(part.positions(), cloud.positions())))?;
/// assert_eq!(spool.points(), Some(2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Spool {
    name: PathBuf,
    folder: PathBuf,
    file: File,
    /// A cloud without points, with all else that the parts share.
    like: PointCloud,
    parts: Vec<Stored>,
    points: u64,
    bytes: u64,
}

/// A cloud in the file.
struct Stored {
    at: u64,
    len: usize,
    residuals: bool,
    colors: bool,
    scans: Vec<Scan>,
}

impl Spool {
    /// Reads all points once and keeps them in a file in `folder`.
    ///
    /// # Errors
    /// Those of reading and of the operating system; [`Error::Unsupported`] if parts have unlike fields; and
    /// [`Error::Cancelled`] if `progress` says so.
    pub fn of(clouds: &dyn Clouds, folder: &Path, progress: &dyn Progress) -> Result<Self, Error> {
        let file = temporary_unnamed(folder).map_err(|source| temporary_failed(folder, &source))?;
        let mut spool = Self {
            name: clouds.name().into(),
            folder: folder.into(),
            file,
            like: PointCloud::default(),
            parts: Vec::new(),
            points: 0,
            bytes: 0,
        };
        clouds.read(progress, &mut |cloud| spool.add(cloud))?;
        Ok(spool)
    }

    /// The coordinate system.
    pub fn crs(&self) -> &Crs {
        &self.like.crs
    }

    fn add(&mut self, cloud: &PointCloud) -> Result<(), Error> {
        if self.parts.is_empty() {
            self.like = PointCloud {
                positions: Vec::new(),
                residuals: None,
                colors: None,
                scans: Vec::new(),
                fields: cloud.fields.iter().map(Field::without_values).collect(),
                ..cloud.clone_without_points()
            };
        }
        let same = |(a, b): (&Field, &Field)| {
            a.name == b.name && std::mem::discriminant(&a.values) == std::mem::discriminant(&b.values)
        };
        let alike = self.like.fields.len() == cloud.fields.len()
            && self.like.fields.iter().zip(&cloud.fields).all(same)
            && self.like.origin == cloud.origin;
        if !alike {
            return Err(Error::unsupported(&self.name, "its points do not all have the same values"));
        }
        self.parts.push(Stored {
            at: self.bytes,
            len: cloud.len(),
            residuals: cloud.residuals.is_some(),
            colors: cloud.colors.is_some(),
            scans: cloud.scans.clone(),
        });
        self.points += cloud.len() as u64;
        self.put(bytemuck::cast_slice(&cloud.positions))?;
        if let Some(residuals) = &cloud.residuals {
            self.put(bytemuck::cast_slice(residuals))?;
        }
        if let Some(colors) = &cloud.colors {
            self.put(bytemuck::cast_slice(colors))?;
        }
        cloud.fields.iter().try_for_each(|field| each_type!(&field.values, v => self.put(bytemuck::cast_slice(v))))
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), Error> {
        write_all_at(&self.file, bytes, self.bytes).map_err(|source| temporary_failed(&self.folder, &source))?;
        self.bytes += bytes.len() as u64;
        Ok(())
    }

    fn get(&self, at: &mut u64, bytes: &mut [u8]) -> Result<(), Error> {
        read_exact_at(&self.file, bytes, *at).map_err(|source| temporary_failed(&self.folder, &source))?;
        *at += bytes.len() as u64;
        Ok(())
    }

    /// Reads what is stored into `part`, and uses its memory again.
    fn load(&self, stored: &Stored, part: &mut PointCloud) -> Result<(), Error> {
        fn sized<T: Copy + Default + bytemuck::Pod>(values: &mut Vec<T>, len: usize) -> &mut [u8] {
            values.resize(len, T::default());
            bytemuck::cast_slice_mut(values)
        }
        let (mut at, len) = (stored.at, stored.len);
        let (residuals, colors) = (part.residuals.take(), part.colors.take());
        part.residuals = stored.residuals.then(|| residuals.unwrap_or_default());
        part.colors = stored.colors.then(|| colors.unwrap_or_default());
        self.get(&mut at, sized(&mut part.positions, len))?;
        part.residuals.iter_mut().try_for_each(|values| self.get(&mut at, sized(values, len)))?;
        part.colors.iter_mut().try_for_each(|values| self.get(&mut at, sized(values, len)))?;
        for field in &mut part.fields {
            each_type!(&mut field.values, v => self.get(&mut at, sized(v, len))?);
        }
        part.scans.clone_from(&stored.scans);
        part.identity = Identity::default();
        Ok(())
    }
}

impl PointCloud {
    /// All that is not a value per point.
    pub(crate) fn clone_without_points(&self) -> Self {
        Self {
            origin: self.origin,
            zeros: self.zeros.clone(),
            axes: self.axes,
            crs: self.crs.clone(),
            resolution: self.resolution,
            ..Self::default()
        }
    }
}

impl Clouds for Spool {
    fn name(&self) -> &Path {
        &self.name
    }

    fn points(&self) -> Option<u64> {
        Some(self.points)
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let mut done = 0;
        let mut part = self.like.slice(0..0);
        for stored in &self.parts {
            progress.tick(done as f32 / self.points.max(1) as f32)?;
            self.load(stored, &mut part)?;
            take(&part)?;
            done += stored.len as u64;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, DVec3};

    use super::*;
    use crate::{Axes, FieldValues, Held};

    struct Two(PointCloud, PointCloud);

    impl Clouds for Two {
        fn name(&self) -> &Path {
            Path::new("two")
        }

        fn read(
            &self,
            _progress: &dyn Progress,
            take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
        ) -> Result<(), Error> {
            take(&self.0)?;
            take(&self.1)
        }
    }

    fn cloud(count: usize) -> Result<PointCloud, Error> {
        let positions = (0..count).map(|i| [i as f32, 0.5, -1.0]).collect();
        let scan = Scan { name: Some("hall".into()), world_from_sensor: DMat4::IDENTITY, points: 0..count };
        PointCloud::new(DVec3::new(5e5, 5e6, 0.0), positions)
            .with_axes(Axes::ZUp)
            .with_resolution(DVec3::splat(0.001))
            .with_residuals((0..count).map(|i| [1e-6 * i as f32, 0.0, 0.0]).collect())?
            .with_field("Intensity", FieldValues::U16((0..count).map(|i| i as u16).collect()))?
            .with_field("GpsTime", FieldValues::F64((0..count).map(|i| i as f64).collect()))?
            .with_scans(vec![scan])
            .with_colors(vec![[1, 2, 3]; count])
    }

    #[test]
    fn everything_comes_back() -> Result<(), Error> {
        let folder = std::env::temp_dir();
        let two = Two(cloud(100)?, cloud(3)?);
        let spool = Spool::of(&two, &folder, &())?;
        assert_eq!(spool.points(), Some(103));
        for time in ["first", "second"] {
            let mut parts = Vec::new();
            spool.read(&(), &mut |part| {
                parts.push(part.clone());
                Ok(())
            })?;
            assert_eq!(parts, [two.0.clone(), two.1.clone()], "{time}");
        }
        let none = Spool::of(&Held { name: "none".as_ref(), cloud: &PointCloud::default() }, &folder, &())?;
        assert_eq!(none.points(), Some(0), "no points");
        Ok(())
    }

    #[test]
    fn unlike_parts_are_refused() -> Result<(), Error> {
        let other = cloud(2)?.with_field("Curvature", FieldValues::F32(vec![0.0; 2]))?;
        let refused = Spool::of(&Two(cloud(2)?, other), &std::env::temp_dir(), &());
        assert!(matches!(refused, Err(Error::Unsupported { .. })));
        Ok(())
    }
}
