//! Inputs: files and generated scenes, each with an optional pose, read into one cloud.

mod pose;

use std::fs::metadata;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use autosplats_cloud::glam::{DMat4, DVec3};
use autosplats_cloud::{Error, PointCloud, Progress, check_memory, sample_surface};
use autosplats_formats::{ReadOptions, read_mesh};
use autosplats_scenes::{SCENE_PREFIX, Scene};
use autosplats_sources::{LatestOptions, Live, PlayOptions, Player, Source, beginnings};
use rayon::prelude::*;

use self::pose::read_pose;
use crate::args::{InputArgs, PlayingArgs, ReadingArgs};
use crate::exit::{Exit, Failure, suggest};
use crate::output::{ReadFiles, folder_of};
use crate::progress::{Bar, InputProgress};

/// Most fields and inputs that a message names.
const MAX_LISTED_NAMES: usize = 10;
/// Gap between two inputs, in sizes of the larger one, above which a picture of both shows each as a few pixels.
const MAX_GAP_SIZES: f64 = 200.0;

/// The inputs of one command. All files exist.
#[derive(Debug)]
pub(crate) struct Inputs {
    list: Vec<Input>,
    options: ReadOptions,
    play: PlayOptions,
}

impl PlayingArgs {
    /// The options for the library.
    pub(crate) fn options(&self) -> PlayOptions {
        let Self { fps, topics, fixed_frame, decay, accumulate, strew, scan } = self;
        PlayOptions {
            fps: *fps,
            topics: topics.clone(),
            frame: fixed_frame.clone(),
            sample: *strew,
            scanners: scan.map(usize::from),
            latest: LatestOptions { decay: *decay, accumulate: *accumulate, ..LatestOptions::default() },
            ..PlayOptions::default()
        }
    }
}

impl ReadingArgs {
    /// The options for the library.
    pub(crate) fn options(&self) -> ReadOptions {
        let Self { columns, depth_camera, keep_no_returns } = self;
        ReadOptions {
            columns: columns.clone(),
            depth_camera: *depth_camera,
            keep_no_returns: *keep_no_returns,
            ..ReadOptions::default()
        }
    }
}

/// One input and its pose in the world.
#[derive(Debug)]
struct Input {
    name: String,
    source: Source,
    world_from_input: DMat4,
    /// File of the pose.
    pose: Option<PathBuf>,
}

pub(crate) struct Playing {
    pub(crate) name: String,
    pub(crate) player: Player,
    /// Whether its points change over time.
    pub(crate) moves: bool,
    /// Time from the first of the inputs that were recorded at the same time. `None` if there are no others.
    pub(crate) begins: Option<Duration>,
    pub(crate) world_from_input: DMat4,
}

impl Inputs {
    /// Parses the command line's names without reading a point. Checks scene names, file existence and poses.
    pub(crate) fn new(names: &[String], args: &InputArgs) -> Result<Self, Failure> {
        let InputArgs { poses, reading, playing } = args;
        let mut list = names.iter().map(|name| Input::new(name)).collect::<Result<Vec<_>, _>>()?;
        if list.iter().filter(|input| matches!(input.source, Source::StandardInput)).count() > 1 {
            return Err(Failure::usage("-: standard input can be read only once; name it once"));
        }
        let generated = list.iter().map(|input| input.source.least_bytes()).sum();
        check_memory("the points of generated scenes", generated).map_err(read_failure)?;
        if reading.columns.is_some() && list.iter().all(|input| matches!(input.source, Source::Scene(..))) {
            return Err(Failure::usage("--columns: no input is a file; generated scenes have no columns"));
        }
        for pose in poses {
            let (place, file) = posed(names, pose).ok_or_else(|| {
                let names = names.join(", ");
                Failure::usage(format!("--pose {pose}: must be INPUT=FILE, where INPUT is one of: {names}"))
            })?;
            list[place].world_from_input = read_pose(file)?;
            list[place].pose = Some(file.into());
        }
        // A pipe's frames are read one by one, since its writer can wait and no frame comes twice.
        let play = PlayOptions { all: true, ..playing.options() };
        Ok(Self { list, options: reading.options(), play })
    }

    /// Parses the inputs and, as the last name, the output.
    pub(crate) fn with_output(paths: &[String], args: &InputArgs) -> Result<(Self, PathBuf), Failure> {
        match paths {
            [inputs @ .., output] if !inputs.is_empty() => Ok((Self::new(inputs, args)?.exactly(), output.into())),
            _ => Err(Failure::usage(format!("{}: the name of the file to write is missing", paths.join(" ")))),
        }
    }

    /// A built-in scene alone.
    pub(crate) fn scene(name: &str) -> Result<Self, Failure> {
        let input = Input::new(&format!("{SCENE_PREFIX}{name}"))?;
        Ok(Self { list: vec![input], options: ReadOptions::default(), play: PlayOptions::default() })
    }

    /// Reads all digits, for writing the points again.
    fn exactly(mut self) -> Self {
        self.options.exact = true;
        self
    }

    /// The inputs for the viewer.
    #[cfg(feature = "viewer")]
    pub(crate) fn for_viewer(mut self, watch: bool) -> Vec<autosplats_viewer::Input> {
        // The window shows the current state and skips older frames.
        (self.play.watch, self.play.all) = (watch, false);
        let Self { list, options, play } = self;
        // Sampling and scanning need a player, and so does a frame rate for scenes and glTF files.
        let made = play.scanners.is_some() || play.sample.is_some();
        let looked_at = |source: &Source| match source {
            Source::Scene(..) => true,
            Source::File(path) => {
                path.extension().is_some_and(|end| end.eq_ignore_ascii_case("glb") || end.eq_ignore_ascii_case("gltf"))
            }
            _ => false,
        };
        let input = |Input { name, source, world_from_input, .. }| {
            let played = made || play.fps.is_some() && looked_at(&source);
            let (options, play) = (options.clone(), play.clone());
            let name = source.short_name().unwrap_or(name);
            autosplats_viewer::Input { name, source, options, play, played, world_from_input }
        };
        list.into_iter().map(input).collect()
    }

    pub(crate) fn only(&self) -> &Source {
        &self.list[0].source
    }

    /// Files that are read, including those of sequences and poses, and `others`.
    pub(crate) fn files<'a>(&'a self, others: impl IntoIterator<Item = &'a Path>) -> ReadFiles {
        let own = self.list.iter().flat_map(|input| input.source.files().into_iter().chain(input.pose.clone()));
        ReadFiles::new(own.chain(others.into_iter().map(Path::to_owned)))
    }

    /// The names as typed, for messages.
    pub(crate) fn names(&self) -> String {
        let names: Vec<&str> = self.list.iter().take(MAX_LISTED_NAMES).map(|input| &*input.name).collect();
        let more = self.list.len() - names.len();
        names.join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
    }

    /// The scene, if it is the only input and has no pose.
    pub(crate) fn only_scene(&self) -> Option<&Scene> {
        match self.list.as_slice() {
            [Input { source: Source::Scene(scene, _), world_from_input, .. }]
                if *world_from_input == DMat4::IDENTITY =>
            {
                Some(scene)
            }
            _ => None,
        }
    }

    /// Reads all inputs into one cloud.
    pub(crate) fn read(&self, quiet: bool) -> Result<PointCloud, Failure> {
        let made = self.play.scanners.is_some() || self.play.sample.is_some();
        self.read_each(quiet, |input, progress| {
            if !made && !input.source.moves() {
                return input.source.read(&self.options, progress);
            }
            let mut player = input.source.play(&self.play, &self.options, progress)?;
            let frames = player.stream().timeline().map_or(0, |timeline| timeline.stamps().len());
            if frames > 1 {
                progress.note(&format!("this is the first of {frames} frames"));
            }
            player.first(Source::FIRST_POINTS_TIMEOUT, progress).map(Arc::unwrap_or_clone)
        })
    }

    /// Prepares the inputs for playing, with their poses. If `watched`, files and folders are followed as they change.
    pub(crate) fn play(&self, watched: bool, quiet: bool) -> Result<Vec<Playing>, Failure> {
        let open = |input: &Input| {
            let bar = Bar::on_file("opening", Path::new(&input.name), quiet);
            let player = match &input.source {
                Source::File(path) if watched => self.watch(path, &input.name),
                Source::Sequence(folder) if watched => self.watch(Path::new(folder), &input.name),
                source => source.play(&self.play, &self.options, &bar).map_err(|error| match error {
                    Error::NoSurface => Failure::new(Exit::Input, format!("{}: {error}", input.name)),
                    error => read_failure(error),
                }),
            }?;
            let Input { name, source, world_from_input, .. } = input;
            let (name, moves, world_from_input) = (name.clone(), source.moves(), *world_from_input);
            Ok(Playing { name, player, moves, begins: None, world_from_input })
        };
        let mut playing = self.list.iter().map(open).collect::<Result<Vec<_>, Failure>>()?;
        let span = |(input, playing): (&Input, &Playing)| input.source.clock_span(playing.player.stream().timeline()?);
        let spans: Vec<_> = self.list.iter().zip(&playing).map(span).collect();
        for (playing, begins) in playing.iter_mut().zip(beginnings(&spans)) {
            playing.begins = begins;
        }
        Ok(playing)
    }

    /// Whether frames come through a pipe and no input is a Zenoh stream.
    pub(crate) fn come_by_pipe(&self) -> bool {
        let is_pipe = |input: &Input| matches!(input.source, Source::StandardInput);
        let is_remote = |input: &Input| matches!(input.source, Source::Remote(_));
        self.list.iter().any(is_pipe) && !self.list.iter().any(is_remote)
    }

    /// Fails for inputs that cannot be watched. Fails for pictures that would be read as new files of a watched folder.
    pub(crate) fn check_watched(&self, picture: Option<&Path>) -> Result<(), Failure> {
        let watched: Vec<PathBuf> = self
            .list
            .iter()
            .filter_map(|input| match &input.source {
                Source::File(path) => Some(path.clone()),
                Source::Sequence(name) => Some(name.into()),
                _ => None,
            })
            .collect();
        if watched.is_empty() {
            return Err(Failure::usage(format!("--watch: {} is neither a file nor a folder", self.names())));
        }
        if let Some(pattern) = watched.iter().find(|path| !path.exists()) {
            return Err(Failure::usage(format!(
                "--watch: {} is a pattern; name a file or a folder",
                pattern.display()
            )));
        }
        let true_name = |path: &Path| path.canonicalize().ok();
        if let Some(picture) = picture
            && let folder = true_name(folder_of(picture))
            && let Some(folder) = watched.iter().find(|path| path.is_dir() && true_name(path) == folder)
        {
            let why = "pictures in a watched folder would be read as depth images; choose another folder";
            return Err(Failure::usage(format!("{}: {why} than {}", picture.display(), folder.display())));
        }
        Ok(())
    }

    /// Plays a file or a folder as it changes.
    fn watch(&self, path: &Path, name: &str) -> Result<Player, Failure> {
        if self.play.sample.is_some() || self.play.scanners.is_some() {
            return Err(Failure::usage(format!("--watch: {name} cannot be sampled; leave out --strew and --scan")));
        }
        let stream = Live::watch(path, &self.options).map_err(read_failure)?;
        Ok(Player::new(Box::new(stream), self.play.latest.clone()))
    }

    /// Reads meshes and samples `count` points on the surface of each, into one cloud.
    pub(crate) fn sample(&self, count: usize, seed: u64, quiet: bool) -> Result<PointCloud, Failure> {
        if let Some(input) = self.list.iter().find(|input| matches!(input.source, Source::Scene(..))) {
            let name = &input.name;
            return Err(Failure::usage(format!("--sample: {name} is not a mesh; set its point count as {name}:1M")));
        }
        self.read_each(quiet, |input, progress| match &input.source {
            Source::File(path) => sample_surface(&read_mesh(path, &self.options, progress)?, count, seed, &()),
            scene => scene.read(&self.options, progress),
        })
    }

    /// Reads the inputs in parallel, each by `read`, and merges them.
    fn read_each(
        &self,
        quiet: bool,
        read: impl Fn(&Input, &dyn Progress) -> Result<PointCloud, Error> + Sync,
    ) -> Result<PointCloud, Failure> {
        let title = match self.list.as_slice() {
            [input] => input.task(),
            several => format!("reading {} inputs", several.len()),
        };
        let bar = Bar::new(&title, quiet);
        let parts: Vec<_> = self.list.iter().map(|input| bar.part(self.list.len(), &input.name)).collect();
        let clouds = self.list.par_iter().zip(&parts).map(|(input, part)| {
            let cloud = read(input, part).map_err(|error| match error {
                Error::NoSurface => Failure::new(Exit::Input, format!("{}: {error}", input.name)),
                error => read_failure(error),
            })?;
            if cloud.is_empty() {
                return Err(Failure::new(Exit::Input, format!("{}: there are no points in it", input.name)));
            }
            Ok((cloud, input.world_from_input))
        });
        // Of several failures, the first input's is reported, independent of timing.
        let clouds: Vec<Result<_, Failure>> = clouds.collect();
        let clouds = clouds.into_iter().collect::<Result<Vec<_>, _>>()?;
        note_differences(&clouds, &parts);
        note_distant_inputs(&clouds, &parts);
        Ok(PointCloud::merge(clouds))
    }
}

/// Parses `INPUT=FILE` into the index of the input and the file. INPUT is an input's name, or the last part of the name
/// if unique.
fn posed<'a>(names: &[String], pose: &'a str) -> Option<(usize, &'a Path)> {
    // Of the inputs `a` and `a=b`, the longer name wins.
    pose.rmatch_indices('=').find_map(|(at, _)| {
        let (typed, file) = (Path::new(&pose[..at]), Path::new(&pose[at + 1..]));
        let mut ends =
            (0..names.len()).filter(|&place| Path::new(&names[place]).file_name() == Some(typed.as_os_str()));
        let only = ends.next().filter(|_| ends.next().is_none());
        let place = names.iter().rposition(|name| Path::new(name) == typed).or(only)?;
        Some((place, file))
    })
}

/// Notes the fields and coordinate systems that the merged cloud loses because the inputs differ in them.
fn note_differences(clouds: &[(PointCloud, DMat4)], parts: &[InputProgress<'_>]) {
    let [(first, _), others @ ..] = clouds else { return };
    for ((cloud, _), part) in clouds.iter().zip(parts) {
        let has = |(other, _): &(PointCloud, DMat4), name: &str| other.fields().iter().any(|field| field.name == name);
        let lost = cloud.fields().iter().filter(|field| !clouds.iter().all(|other| has(other, &field.name)));
        let lost: Vec<String> = lost.map(|field| field.name.escape_debug().take(40).collect()).collect();
        if !lost.is_empty() {
            let more = if lost.len() > MAX_LISTED_NAMES {
                format!(" and {} more", lost.len() - MAX_LISTED_NAMES)
            } else {
                String::new()
            };
            let names = lost[..lost.len().min(MAX_LISTED_NAMES)].join(", ");
            part.note(&format!("not all inputs have {names}{more}; left out"));
        }
    }
    if others.iter().any(|(other, _)| other.crs() != first.crs()) {
        let unit = |cloud: &PointCloud| cloud.crs().unit;
        let units = others.iter().any(|(other, _)| unit(other) != unit(first));
        let what = if units { "coordinate systems and units" } else { "coordinate systems" };
        parts[0].note(&format!("the inputs differ in their {what}; nothing is converted, the result has none"));
    }
}

/// Notes the inputs that lie too far from all others to be seen in one picture.
fn note_distant_inputs(clouds: &[(PointCloud, DMat4)], parts: &[InputProgress<'_>]) {
    if clouds.len() < 2 {
        return;
    }
    let boxes: Vec<[DVec3; 2]> = clouds.par_iter().map(world_box).collect();
    // Gap between two boxes, in diagonals of the larger one.
    let apart = |[low, high]: [DVec3; 2], [other_low, other_high]: [DVec3; 2]| {
        let gap = (other_low - high).max(low - other_high).max(DVec3::ZERO).length();
        let size = (high - low).length().max((other_high - other_low).length());
        if size > 0.0 { gap / size } else { 0.0 }
    };
    let nearest = |at: usize| {
        let others = boxes.iter().enumerate().filter(|&(other, _)| other != at);
        others.map(|(_, &other)| apart(boxes[at], other)).fold(f64::INFINITY, f64::min)
    };
    let mut far: Vec<_> =
        (0..boxes.len()).map(|at| (at, nearest(at))).filter(|&(_, apart)| apart > MAX_GAP_SIZES).collect();
    // If every input is far from all others, the first is the reference.
    if far.len() == boxes.len() {
        far.remove(0);
    }
    for (at, apart) in far {
        parts[at].note(&format!(
            "lies {apart:.0} times the inputs' size away from the others; a picture hardly shows both; move it with --pose"
        ));
    }
}

/// Bounding box of all finite points, in world coordinates.
fn world_box((cloud, world_from_input): &(PointCloud, DMat4)) -> [DVec3; 2] {
    let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let each = cloud
        .positions()
        .iter()
        .map(|&position| world_from_input.transform_point3(cloud.origin() + DVec3::from(position.map(f64::from))));
    each.filter(|place| place.is_finite()).fold(none, |[low, high], place| [low.min(place), high.max(place)])
}

impl Input {
    fn new(name: &str) -> Result<Self, Failure> {
        let source = Source::parse(name).map_err(unknown_scene)?;
        if let Some(path) = source.path() {
            let metadata = metadata(path).map_err(|error| {
                let hint = if Scene::names().any(|(scene, _)| scene == name) {
                    format!("; for the generated scene type scene:{name}")
                } else {
                    String::new()
                };
                Failure::new(Exit::Input, format!("{name}: {error}{hint}"))
            })?;
            if metadata.is_dir() && matches!(source, Source::File(_)) {
                return Err(Failure::new(Exit::Input, format!("{name}: this is a folder; name the files in it")));
            }
        }
        Ok(Self { name: name.into(), source, world_from_input: DMat4::IDENTITY, pose: None })
    }

    /// Title of the reading task.
    fn task(&self) -> String {
        match &self.source {
            Source::File(path) => {
                format!("reading {}", path.file_name().unwrap_or(path.as_os_str()).to_string_lossy())
            }
            Source::Scene(..) => format!("generating {}", self.name),
            Source::Sequence(_) | Source::Recording(_) | Source::StandardInput => format!("reading {}", self.name),
            Source::Remote(_) => format!("waiting for {}", self.name),
        }
    }
}

fn unknown_scene(error: Error) -> Failure {
    Failure::usage(match error {
        Error::UnknownScene { given, .. } => {
            format!("no scene is called '{given}'; {}", suggest(&given, Scene::names().map(|(name, _)| name)))
        }
        other => other.to_string(),
    })
}

/// The failure with the exit code of a read error.
pub(crate) fn read_failure(error: Error) -> Failure {
    match error {
        Error::Cancelled => Failure::interrupted(),
        Error::OutOfMemory { .. } => Failure::new(Exit::Memory, error),
        _ => Failure::new(Exit::Input, error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_input_is_one_input() {
        let new = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|&name| name.into()).collect();
            Inputs::new(&names, &InputArgs::default()).map(drop).map_err(|failure| failure.message)
        };
        assert_eq!(new(&["-"]), Ok(()), "once");
        assert!(new(&["-", "scene:statue:1K", "-"]).is_err_and(|told| told.contains("only once")), "twice");
    }

    #[test]
    fn poses_are_of_inputs() {
        let names = ["a/scan.ply", "./b.ply", "c/scan.ply", "a=b"].map(String::from);
        let placed = |pose: &'static str| posed(&names, pose).map(|(place, file)| (place, file.to_str().unwrap_or("")));
        assert_eq!(placed("c/scan.ply=p.txt"), Some((2, "p.txt")), "as typed");
        assert_eq!(placed("b.ply=p=q.txt"), Some((1, "p=q.txt")), "by the last part of the name");
        assert_eq!(placed("c//scan.ply=p.txt"), Some((2, "p.txt")), "the same path");
        assert_eq!(placed("a=b=p.txt"), Some((3, "p.txt")), "the longer name");
        assert_eq!(placed("scan.ply=p.txt"), None, "either of two");
        assert_eq!(placed("other.ply=p.txt"), None, "none of them");
    }
}
