//! Inputs whose points are read in parts, for what needs no more memory than a part.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use autosplats_cloud::glam::DMat4;
use autosplats_cloud::{Error, PointCloud, Progress};
use autosplats_formats::{Clouds, Outline, TreeInput};
use autosplats_scenes::Scene;
use autosplats_sources::{Input, Source};

use super::{Inputs, is_made, read_whole};

/// Points of a scene that are generated at a time.
const SCENE_PART: usize = 1 << 20;

impl Inputs {
    /// The inputs, read in parts as far as their formats allow.
    pub(crate) fn streamed(&self) -> Vec<TreeInput<'_>> {
        self.list.iter().map(streamed).collect()
    }
}

fn streamed(input: &Input) -> TreeInput<'_> {
    let plain = input.world_from_input == DMat4::IDENTITY && !is_made(input);
    match &input.source {
        Source::File(path) if plain && is_las(path) => TreeInput::Las(path.clone()),
        Source::Scene(scene, count) if plain && !input.moves() => {
            TreeInput::Clouds(Box::new(SceneClouds { name: &input.name, scene, count: *count }))
        }
        _ => TreeInput::Clouds(Box::new(Whole(input))),
    }
}

/// Whether a file begins as LAS files do.
fn is_las(path: &Path) -> bool {
    let mut start = [0; 4];
    File::open(path).and_then(|mut file| file.read_exact(&mut start)).is_ok() && start == *b"LASF"
}

/// An input that is read whole.
struct Whole<'a>(&'a Input);

impl Clouds for Whole<'_> {
    fn name(&self) -> &Path {
        Path::new(&self.0.name)
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &(dyn Fn(&PointCloud) -> Result<(), Error> + Sync),
    ) -> Result<(), Error> {
        let cloud = read_whole(self.0, progress)?;
        let pose = self.0.world_from_input;
        if pose == DMat4::IDENTITY { take(&cloud) } else { take(&PointCloud::merge(vec![(cloud, pose)])) }
    }
}

/// A generated scene.
struct SceneClouds<'a> {
    name: &'a str,
    scene: &'a Scene,
    count: usize,
}

impl Clouds for SceneClouds<'_> {
    fn name(&self) -> &Path {
        Path::new(self.name)
    }

    /// A scene is costly to make, and known beforehand.
    fn outline(&self, progress: &dyn Progress) -> Result<Option<Outline>, Error> {
        let some = self.scene.sampler(self.count)?.part(0..self.count.min(Scene::BLOCK), progress)?;
        Ok(Some(Outline { points: self.count as u64, bounds: self.scene.bounds(), some }))
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &(dyn Fn(&PointCloud) -> Result<(), Error> + Sync),
    ) -> Result<(), Error> {
        let sampler = self.scene.sampler(self.count)?;
        for first in (0..self.count).step_by(SCENE_PART) {
            progress.tick(first as f32 / self.count as f32)?;
            take(&sampler.part(first..self.count.min(first + SCENE_PART), progress)?)?;
        }
        Ok(())
    }
}
