//! Inputs whose points are read in parts, for what needs no more memory than a part.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use autosplats_cloud::glam::DMat4;
use autosplats_cloud::{Clouds, Error, PointCloud, Progress};
use autosplats_formats::{TreeInput, describe, open_parts};
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

    /// Number of points that the only input states, if it can be read in parts.
    pub(crate) fn stated_points(&self) -> Option<u64> {
        match self.list.as_slice() {
            [input] if is_plain(input) => match &input.source {
                Source::File(path) if is_las(path) => describe(path, &input.options).ok()?.points,
                Source::Scene(_, count) if !input.moves() => Some(*count as u64),
                _ => None,
            },
            _ => None,
        }
    }

    /// The only input, to be read in parts. `None` if it has to be read whole.
    pub(crate) fn in_parts(&self, progress: &dyn Progress) -> Result<Option<Box<dyn Clouds + '_>>, Error> {
        let [input] = self.list.as_slice() else { return Ok(None) };
        match &input.source {
            Source::File(path) if is_plain(input) => {
                Ok(open_parts(path, &input.options, progress)?.map(|parts| Box::new(parts) as Box<dyn Clouds>))
            }
            Source::Scene(scene, count) if is_plain(input) && !input.moves() => {
                Ok(Some(Box::new(SceneClouds { name: &input.name, scene, count: *count })))
            }
            _ => Ok(None),
        }
    }
}

/// Whether the input has no pose and is not sampled.
fn is_plain(input: &Input) -> bool {
    input.world_from_input == DMat4::IDENTITY && !is_made(input)
}

fn streamed(input: &Input) -> TreeInput<'_> {
    let plain = is_plain(input);
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
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
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

    fn points(&self) -> Option<u64> {
        Some(self.count as u64)
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let sampler = self.scene.sampler(self.count)?;
        for first in (0..self.count).step_by(SCENE_PART) {
            progress.tick(first as f32 / self.count as f32)?;
            take(&sampler.part(first..self.count.min(first + SCENE_PART), progress)?)?;
        }
        Ok(())
    }
}
