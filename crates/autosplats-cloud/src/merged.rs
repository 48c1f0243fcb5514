//! Several inputs as one, whose points come in parts.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};

use crate::{
    Clouds, Error, Field, Part, PointCloud, Progress, Unit,
    merge::GREY,
    precision::{degree_origin, residual, storage_origin},
};

/// The points of several inputs, joined as [`PointCloud::merge`] joins clouds without poses.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Clouds, Held, Merged, PointCloud, glam::DVec3};
///
/// let dark = PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; 2]);
/// let red = PointCloud::new(DVec3::ZERO, vec![[1.0; 3]]).with_colors(vec![[255, 0, 0]])?;
/// let held = |cloud| Box::new(Held { name: "memory".as_ref(), cloud }) as Box<dyn Clouds>;
/// let merged = Merged::new("both".into(), vec![held(&dark), held(&red)], &())?;
/// let mut all = PointCloud::default();
/// merged.read(&(), &mut |part| Ok(all.append(part.clone())))?;
/// assert_eq!(all.colors(), Some(&[[200; 3], [200; 3], [255, 0, 0]][..]), "points without colours are grey");
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
pub struct Merged<'a> {
    name: PathBuf,
    inputs: Vec<Box<dyn Clouds + 'a>>,
    heads: Vec<PointCloud>,
    /// What all points share, with a point of each input.
    like: PointCloud,
}

impl<'a> Merged<'a> {
    /// Looks at the first points of each input.
    ///
    /// # Errors
    /// Those of reading.
    pub fn new(name: PathBuf, inputs: Vec<Box<dyn Clouds + 'a>>, progress: &dyn Progress) -> Result<Self, Error> {
        let len = 1.0 / inputs.len().max(1) as f32;
        let part = |index| Part { whole: progress, start: index as f32 * len, len };
        let heads = inputs.iter().enumerate().map(|(index, input)| head(&**input, &part(index)));
        let heads = heads.collect::<Result<Vec<_>, Error>>()?;
        let mut like = PointCloud::merged(&heads.iter().map(|head| (head, DMat4::IDENTITY)).collect::<Vec<_>>());
        // One point of an input does not tell whether its points lie near zero, but the middle of them all does, which
        // is their origin.
        let far = |head: &&PointCloud| {
            let middle = |_| head.origin;
            let degrees = head.crs.unit == Some(Unit::Degree);
            (if degrees { degree_origin(1, middle) } else { storage_origin(1, middle) }) != DVec3::ZERO
        };
        let mut filled = heads.iter().filter(|head| !head.is_empty());
        if filled.clone().any(|head| head.origin != like.origin) {
            like.origin = filled.find(far).map(PointCloud::origin).unwrap_or_default();
        }
        Ok(Self { name, inputs, heads, like })
    }

    /// The first point of each input, with all it has; no point of an input without points.
    pub fn heads(&self) -> &[PointCloud] {
        &self.heads
    }

    /// Points of an input as points of all.
    fn shared(&self, part: &PointCloud) -> PointCloud {
        let Self { like, .. } = self;
        let mut shared = like.clone_without_points();
        let exact = like.residuals.is_some();
        if part.origin == like.origin {
            shared.positions.clone_from(&part.positions);
            let none = || vec![[0.0; 3]; part.len()];
            shared.residuals = exact.then(|| part.residuals.clone().unwrap_or_else(none));
        } else {
            let moved = |i| part.world_position(i) - like.origin;
            shared.positions = (0..part.len()).map(|i| moved(i).as_vec3().to_array()).collect();
            shared.residuals = exact.then(|| (0..part.len()).map(|i| residual(moved(i))).collect());
        }
        let grey = || vec![GREY; part.len()];
        shared.colors = like.colors.is_some().then(|| part.colors.clone().unwrap_or_else(grey));
        shared.scans.clone_from(&part.scans);
        shared.fields = like.fields.iter().map(Field::without_values).collect();
        for Field { name, values } in &mut shared.fields {
            // Parts of an input have the fields of its first point.
            if let Some(column) = part.column(name) {
                column.append_to(values, part.len());
            }
        }
        shared
    }
}

/// The first point of an input.
fn head(input: &dyn Clouds, progress: &dyn Progress) -> Result<PointCloud, Error> {
    let mut head = None;
    let outcome = input.read(progress, &mut |part| {
        if part.is_empty() {
            return Ok(());
        }
        head = Some(part.pick(&[0]));
        // Ends the reading.
        Err(Error::Cancelled)
    });
    head.map_or_else(|| outcome.map(|()| PointCloud::default()), Ok)
}

impl Clouds for Merged<'_> {
    fn name(&self) -> &Path {
        &self.name
    }

    fn points(&self) -> Option<u64> {
        self.inputs.iter().map(|input| input.points()).sum()
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let len = 1.0 / self.inputs.len().max(1) as f32;
        for (index, input) in self.inputs.iter().enumerate() {
            let part = Part { whole: progress, start: index as f32 * len, len };
            input.read(&part, &mut |cloud| take(&self.shared(cloud)))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Axes, FieldValues, Held, Scan};

    /// Clouds that come in parts of three points.
    struct Threes(PointCloud);

    impl Clouds for Threes {
        fn name(&self) -> &Path {
            Path::new("threes")
        }

        fn read(
            &self,
            _progress: &dyn Progress,
            take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
        ) -> Result<(), Error> {
            (0..self.0.len()).step_by(3).try_for_each(|start| {
                let mut part = self.0.clone();
                part.retain(|index| (start..start + 3).contains(&index));
                take(&part)
            })
        }
    }

    #[test]
    fn parts_are_those_of_the_merged_cloud() {
        let cloud = |origin: f64, count: usize| {
            let places = (0..count).map(|i| [i as f32, 0.125, -(i as f32)]).collect();
            PointCloud::new(DVec3::splat(origin), places)
        };
        let numbers = |count: usize| FieldValues::U16((0..count).map(|i| i as u16).collect());
        let near = cloud(0.0, 7).with_field("A", numbers(7)).expect("seven");
        let far = cloud(512_000.0, 5).with_colors(vec![[1, 2, 3]; 5]).expect("five").with_axes(Axes::ZUp);
        let far = far.with_field("A", FieldValues::F32(vec![0.5; 5])).expect("five").with_field("B", numbers(5));
        let further = cloud(600_000.25, 4).with_field("A", numbers(4)).expect("four");
        let scan = Scan { name: None, world_from_sensor: DMat4::IDENTITY, points: 0..4 };
        let further = further.with_scans(vec![scan]);
        let exact = PointCloud::from_world(3, |i| DVec3::splat(512_000.1 + i as f64 / 7.0), true);
        let exact = exact.with_field("A", numbers(3)).expect("three");
        let far = far.expect("five");
        for clouds in [vec![&near], vec![&near, &far], vec![&far, &further], vec![&further, &near, &exact, &far]] {
            let inputs = clouds.iter().map(|&cloud| Box::new(Threes(cloud.clone())) as Box<dyn Clouds>).collect();
            let merged = Merged::new("all".into(), inputs, &()).expect("merged");
            let mut all = PointCloud::default();
            let mut add = |part: &PointCloud| {
                all.append(part.clone());
                Ok(())
            };
            merged.read(&(), &mut add).expect("read");
            let expected = PointCloud::merge(clouds.iter().map(|&cloud| (cloud.clone(), DMat4::IDENTITY)).collect());
            assert!(all.residuals() == expected.residuals() && all.origin() == expected.origin(), "{clouds:?}");
            all.scans.clear();
            let scans = PointCloud { scans: Vec::new(), ..expected };
            assert_eq!(all, scans);
        }
    }

    #[test]
    fn an_input_without_points_has_no_head() {
        let (none, some) = (PointCloud::default(), PointCloud::new(DVec3::ONE, vec![[0.0; 3]; 4]));
        let held = |cloud| Box::new(Held { name: "memory".as_ref(), cloud }) as Box<dyn Clouds>;
        let merged = Merged::new("all".into(), vec![held(&none), held(&some)], &()).expect("merged");
        assert_eq!(merged.heads().iter().map(PointCloud::len).collect::<Vec<_>>(), [0, 1]);
        assert_eq!(merged.points(), Some(4));
    }
}
