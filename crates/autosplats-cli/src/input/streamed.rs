//! Inputs whose points are read in parts, for what needs no more memory than a part.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;
use std::sync::OnceLock;
use std::time::SystemTime;

use autosplats_cloud::glam::DMat4;
use autosplats_cloud::{Clouds, Error, Merged, Outline, Part, PointCloud, Progress};
use autosplats_formats::{Parts, TreeInput, Unpacking, describe, is_tree_file, open_parts, open_parts_unpacked};
use autosplats_scenes::Scene;
use autosplats_sources::{Input, Source};

use super::{Inputs, differences, failure, is_made, read_whole};
use crate::console::Console;
use crate::exit::{Exit, Failure};

/// Points of a scene that are generated at a time.
const SCENE_PART: usize = 1 << 20;

impl Inputs {
    /// The inputs, read in parts as far as their formats allow.
    pub(crate) fn streamed(&self) -> Vec<TreeInput<'_>> {
        self.list.iter().map(streamed).collect()
    }

    /// Number of points of all inputs, or more of them, if they may be read in parts.
    pub(crate) fn points_at_most(&self) -> Option<u64> {
        if self.list.len() > MOST_INPUTS {
            return None;
        }
        self.list.iter().map(points_at_most).sum()
    }

    /// The inputs, to be read in parts soon, joined as whole ones are. `None` if they have to be read whole.
    pub(crate) fn in_parts(
        &self,
        unpacking: Unpacking<'_>,
        progress: &dyn Progress,
        console: &Console,
    ) -> Result<Option<Box<dyn Clouds + '_>>, Failure> {
        let len = 1.0 / self.list.len() as f32;
        let several = self.list.len() > 1;
        let unpacking = Some(unpacking).filter(|_| self.list.len() <= MOST_UNPACKED);
        let (mut kept, mut all) = (Vec::new(), Vec::new());
        for (index, input) in self.list.iter().enumerate() {
            match parts_of(input, unpacking, &Part { whole: progress, start: index as f32 * len, len }) {
                Ok(None) => return Ok(None),
                Ok(Some(clouds)) => {
                    kept.push(input);
                    all.push(clouds);
                }
                // Of the tiles of a survey, some may have no point of a class.
                Err(Error::NothingKept { filter, points, .. }) if several => {
                    console.note(format!("{}: --keep {filter} leaves none of its {points} points", input.name));
                }
                Err(Error::Io { path, source }) if unpacking.is_some_and(|to| to.folder == path) => {
                    return Err(Failure::temporary(&path, &source));
                }
                Err(error) => return Err(failure(input, error)),
            }
        }
        if !several {
            return Ok(all.pop());
        }
        if all.is_empty() {
            return Err(Failure::new(Exit::Input, format!("{}: --keep leaves none of their points", self.names())));
        }
        let merged = Merged::new(self.names().into(), all, &()).map_err(Failure::from)?;
        if let Some(empty) = merged.heads().iter().position(PointCloud::is_empty) {
            return Err(Failure::new(Exit::Input, format!("{}: there are no points in it", kept[empty].name)));
        }
        for (index, note) in differences(&merged.heads().iter().collect::<Vec<_>>()) {
            console.note(format!("{}: {note}", kept[index].name));
        }
        Ok(Some(Box::new(merged)))
    }
}

/// Most inputs that are read in parts: each stays open.
const MOST_INPUTS: usize = 1000;

/// Most inputs of which decompressed points wait on the disk: each has a file there, which stays open.
const MOST_UNPACKED: usize = 500;

/// Number of points of an input, or more of them. `None` if it has to be read whole.
fn points_at_most(input: &Input) -> Option<u64> {
    match &input.source {
        _ if !is_plain(input) => None,
        // What comes through a pipe can be read only once.
        Source::File(path) if !path.is_file() => None,
        Source::File(path) => match describe(path, &input.options) {
            Ok(description) if description.points.is_some() => description.points,
            // Text does not state it. No row is shorter than three digits, each with a byte behind it.
            _ => path.metadata().ok().map(|metadata| metadata.len() / 6),
        },
        Source::Scene(_, count) if !input.moves() => Some(*count as u64),
        _ => None,
    }
}

/// An input, to be read in parts. `None` if it has to be read whole.
fn parts_of<'a>(
    input: &'a Input,
    unpacking: Option<Unpacking<'_>>,
    progress: &dyn Progress,
) -> Result<Option<Box<dyn Clouds + 'a>>, Error> {
    match &input.source {
        Source::File(path) if is_plain(input) => {
            let parts = match unpacking {
                Some(unpacking) => open_parts_unpacked(path, &input.options, unpacking, progress)?,
                None => open_parts(path, &input.options, progress)?,
            };
            Ok(parts.map(|parts| Box::new(parts) as Box<dyn Clouds>))
        }
        Source::Scene(scene, count) if is_plain(input) && !input.moves() => {
            Ok(Some(Box::new(SceneClouds { name: &input.name, scene, count: *count })))
        }
        _ => Ok(None),
    }
}

/// Whether the input has no pose, is not sampled, and is no octree of many files.
fn is_plain(input: &Input) -> bool {
    let is_folder = matches!(&input.source, Source::File(path) if is_tree_file(path));
    input.world_from_input == DMat4::IDENTITY && !is_made(input) && !is_folder
}

fn streamed(input: &Input) -> TreeInput<'_> {
    let plain = is_plain(input);
    match &input.source {
        Source::File(path) if plain && is_las(path) => TreeInput::Las(path.clone()),
        Source::File(path) if plain && !input.moves() => {
            TreeInput::Clouds(Box::new(FileClouds { whole: Whole::new(input), path, parts: OnceLock::new() }))
        }
        Source::Scene(scene, count) if plain && !input.moves() => {
            TreeInput::Clouds(Box::new(SceneClouds { name: &input.name, scene, count: *count }))
        }
        _ => TreeInput::Clouds(Box::new(Whole::new(input))),
    }
}

/// Whether a file begins as LAS files do.
fn is_las(path: &Path) -> bool {
    let mut start = [0; 4];
    path.is_file() && File::open(path).and_then(|mut file| file.read_exact(&mut start)).is_ok() && start == *b"LASF"
}

/// Share of reading a file for the first time that settling takes what all its points tell.
const SETTLING: f32 = 0.5;

/// A file that is read in parts if its format allows it.
struct FileClouds<'a> {
    whole: Whole<'a>,
    path: &'a Path,
    /// Set once the file is opened: `None` if it is read whole.
    parts: OnceLock<Option<Parts>>,
}

impl Clouds for FileClouds<'_> {
    fn name(&self) -> &Path {
        self.whole.name()
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let mut start = 0.0;
        let parts = match self.parts.get() {
            Some(parts) => parts,
            None => {
                let settling = Part { whole: progress, start, len: SETTLING };
                let parts = open_parts(self.path, &self.whole.input.options, &settling)?;
                start = if parts.is_some() { SETTLING } else { 0.0 };
                self.parts.get_or_init(|| parts)
            }
        };
        match parts {
            Some(parts) => Clouds::read(parts, &Part { whole: progress, start, len: 1.0 - start }, take),
            None => self.whole.read(progress, take),
        }
    }
}

/// An input that is read whole.
struct Whole<'a> {
    input: &'a Input,
    /// Size and time of the last change of the file, as read first.
    stamp: OnceLock<Stamp>,
}

/// Size and time of the last change, if the input is a file.
type Stamp = Option<(u64, Option<SystemTime>)>;

impl<'a> Whole<'a> {
    fn new(input: &'a Input) -> Self {
        Self { input, stamp: OnceLock::new() }
    }

    fn stamp(&self) -> Stamp {
        let metadata = self.input.source.path().filter(|path| path.is_file())?.metadata().ok()?;
        Some((metadata.len(), metadata.modified().ok()))
    }

    /// Fails if the file is not as it was.
    fn check(&self) -> Result<(), Error> {
        let now = self.stamp();
        if *self.stamp.get_or_init(|| now) == now {
            return Ok(());
        }
        let what = "the file changed while it was read; start again";
        Err(Error::malformed(self.name(), "size or time", what))
    }
}

impl Clouds for Whole<'_> {
    fn name(&self) -> &Path {
        Path::new(&self.input.name)
    }

    fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.check()?;
        let cloud = read_whole(self.input, progress)?;
        self.check()?;
        let pose = self.input.world_from_input;
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

    /// A scene is costly to make, and known beforehand.
    fn outline(&self, progress: &dyn Progress) -> Result<Option<Outline>, Error> {
        let some = self.scene.sampler(self.count)?.part(0..self.count.min(Scene::BLOCK), progress)?;
        Ok(Some(Outline { points: self.count as u64, bounds: self.scene.bounds(), some }))
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
