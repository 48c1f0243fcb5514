//! Inputs: files and generated scenes, each with an optional pose, read into one cloud.

mod distant;
mod pose;
mod streamed;
mod trees;

use std::fs::metadata;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use autosplats_cloud::glam::{DMat4, DVec3};
use autosplats_cloud::{Error, PointCloud, PointFilter, Progress, check_memory, sample_surface};
use autosplats_formats::{ReadOptions, check_columns, read_mesh};
use autosplats_scenes::{SCENE_PREFIX, Scene};
use autosplats_sources::{Input, LatestOptions, Live, PlayOptions, Player, Source, beginnings};
use rayon::prelude::*;

use self::distant::{note_distant_inputs, world_box};
use self::pose::read_pose;
use crate::args::{InputArgs, PartArgs, PlayingArgs, ReadingArgs};
use crate::console::Console;
use crate::exit::{Exit, Failure};
use crate::output::{ReadFiles, folder_of};
use crate::progress::Bar;

/// Most fields and inputs that a message names.
const MAX_LISTED_NAMES: usize = 10;

/// The inputs of one command. All files exist.
#[derive(Debug)]
pub(crate) struct Inputs {
    list: Vec<Input>,
    /// Files of the poses.
    poses: Vec<PathBuf>,
}

impl PlayingArgs {
    /// The options for the library.
    pub(crate) fn options(&self) -> PlayOptions {
        let Self { fps, topics, fixed_frame, decay, accumulate, sample, scan } = self;
        PlayOptions {
            fps: *fps,
            topics: topics.clone(),
            frame: fixed_frame.clone(),
            sample: *sample,
            scanners: scan.map(usize::from),
            latest: LatestOptions { decay: *decay, accumulate: *accumulate, ..LatestOptions::default() },
            ..PlayOptions::default()
        }
    }
}

impl ReadingArgs {
    /// The options for the library.
    pub(crate) fn options(&self) -> ReadOptions {
        let Self { columns, depth_camera, keep, headers, keep_no_returns } = self;
        ReadOptions {
            columns: columns.clone(),
            keep: keep.clone(),
            headers: headers.clone(),
            depth_camera: *depth_camera,
            keep_no_returns: *keep_no_returns,
            ..ReadOptions::default()
        }
    }
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
        let inputs = Self::parse(names, args)?;
        inputs.check_memory()?;
        Ok(inputs)
    }

    /// Fails if the points of generated scenes do not fit into memory.
    pub(crate) fn check_memory(&self) -> Result<(), Failure> {
        let generated = self.list.iter().map(|input| input.source.least_bytes()).sum();
        Ok(check_memory("the points of generated scenes", generated)?)
    }

    fn parse(names: &[String], args: &InputArgs) -> Result<Self, Failure> {
        let InputArgs { poses, reading, playing } = args;
        let mut list = names.iter().map(|name| existing(name)).collect::<Result<Vec<_>, _>>()?;
        if list.iter().filter(|input| matches!(input.source, Source::StandardInput)).count() > 1 {
            return Err(Failure::usage("-: standard input can be read only once; name it once"));
        }
        if reading.columns.is_some() && list.iter().all(|input| matches!(input.source, Source::Scene(..))) {
            return Err(Failure::usage("--columns: no input is a file; generated scenes have no columns"));
        }
        reading.columns.as_deref().map_or(Ok(()), check_columns).map_err(Failure::usage)?;
        let mut files = Vec::new();
        for pose in poses {
            let (place, file) = posed(names, pose).ok_or_else(|| {
                let names = names.join(", ");
                Failure::usage(format!("--pose {pose}: must be INPUT=FILE, where INPUT is one of: {names}"))
            })?;
            list[place].world_from_input = read_pose(file)?;
            files.push(file.into());
        }
        for input in &mut list {
            // A pipe's frames are read one by one, since its writer can wait and no frame comes twice.
            input.play = PlayOptions { all: true, ..playing.options() };
            input.options = reading.options();
        }
        Ok(Self { list, poses: files })
    }

    /// Parses the inputs and the output: `output`, or else the last name. Does not check the memory of scenes.
    pub(crate) fn with_output(
        paths: &[String],
        output: Option<&Path>,
        args: &InputArgs,
        part: &PartArgs,
    ) -> Result<(Self, PathBuf), Failure> {
        match (paths, output) {
            (inputs, Some(output)) => Ok((Self::parse(inputs, args)?.for_writing(part), output.into())),
            ([inputs @ .., output], None) if !inputs.is_empty() => {
                Ok((Self::parse(inputs, args)?.for_writing(part), output.into()))
            }
            _ => Err(Failure::usage(format!("{}: the name of the file to write is missing", paths.join(" ")))),
        }
    }

    /// A built-in scene alone.
    pub(crate) fn scene(name: &str) -> Result<Self, Failure> {
        Ok(Self { list: vec![Input::parse(&format!("{SCENE_PREFIX}{name}"))?], poses: Vec::new() })
    }

    /// Leaves out what pictures usually do not show, unless the user has said what to keep.
    pub(crate) fn for_pictures(mut self) -> Self {
        for input in &mut self.list {
            input.options.keep.get_or_insert_with(PointFilter::usual);
        }
        self
    }

    /// Reads all digits, for writing the points again, and only whole inputs, unless the user takes what is left.
    fn for_writing(mut self, part: &PartArgs) -> Self {
        for input in &mut self.list {
            (input.options.exact, input.options.whole) = (true, !part.salvage);
        }
        self
    }

    /// The inputs for the viewer.
    #[cfg(feature = "viewer")]
    pub(crate) fn for_viewer(mut self, watch: bool) -> Vec<Input> {
        for Input { name, source, play, .. } in &mut self.list {
            // The window shows the current state and skips older frames.
            (play.watch, play.all) = (watch, false);
            if let Some(short) = source.short_name() {
                *name = short;
            }
        }
        self.list
    }

    pub(crate) fn only(&self) -> &Source {
        &self.list[0].source
    }

    /// Files that are read, including those of sequences and poses, and `others`.
    pub(crate) fn files<'a>(&'a self, others: impl IntoIterator<Item = &'a Path>) -> ReadFiles {
        let own = self.list.iter().flat_map(|input| input.source.files());
        ReadFiles::new(own.chain(self.poses.clone()).chain(others.into_iter().map(Path::to_owned)))
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
    pub(crate) fn read(&self, console: &Console) -> Result<PointCloud, Failure> {
        self.read_each(console, false, read_whole)
    }

    /// Name of the first input whose points move.
    pub(crate) fn moving(&self) -> Option<&str> {
        self.list.iter().find(|input| input.moves()).map(|input| &*input.name)
    }

    /// What the trees of these inputs shall give.
    pub(crate) fn kept(&self) -> Option<PointFilter> {
        self.list[0].options.keep.clone()
    }

    /// Prepares the inputs for playing, with their poses. If `watched`, files and folders are followed as they change.
    pub(crate) fn play(&self, watched: bool, console: &Console) -> Result<Vec<Playing>, Failure> {
        let open = |input: &Input| {
            let bar = Bar::on_file("opening", Path::new(&input.name), console);
            let player = match &input.source {
                Source::File(path) if watched => watch(path, input),
                Source::Sequence(folder) if watched => watch(Path::new(folder), input),
                source => source.play(&input.play, &input.options, &bar).map_err(|error| failure(input, error)),
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

    /// Reads meshes and samples `count` points on the surface of each, into one cloud.
    pub(crate) fn sample(&self, count: usize, seed: u64, console: &Console) -> Result<PointCloud, Failure> {
        if let Some(input) = self.list.iter().find(|input| matches!(input.source, Source::Scene(..))) {
            let name = &input.name;
            return Err(Failure::usage(format!("--sample: {name} is not a mesh; set its point count as {name}:1M")));
        }
        self.read_each(console, false, |input, progress| match &input.source {
            Source::File(path) => sample_surface(&read_mesh(path, &input.options, progress)?, count, seed, &()),
            _ => first_frame(input, progress),
        })
    }

    /// Reads the inputs in parallel, each by `read`, and merges them. Fails for one without points unless some
    /// `may_be_empty`.
    fn read_each(
        &self,
        console: &Console,
        may_be_empty: bool,
        read: impl Fn(&Input, &dyn Progress) -> Result<PointCloud, Error> + Sync,
    ) -> Result<PointCloud, Failure> {
        let title = match self.list.as_slice() {
            [input] => task(input),
            several => format!("reading {} inputs", several.len()),
        };
        let bar = Bar::new(&title, console);
        let parts: Vec<_> = self.list.iter().map(|input| bar.part(self.list.len(), &input.name)).collect();
        let several = self.list.len() > 1;
        let clouds = self.list.par_iter().zip(&parts).map(|(input, part)| match read(input, part) {
            Ok(cloud) if cloud.is_empty() && !may_be_empty => {
                Err(Failure::new(Exit::Input, format!("{}: there are no points in it", input.name)))
            }
            Ok(cloud) => Ok(Some((cloud, input.world_from_input))),
            // Of the tiles of a survey, some may have no point of a class.
            Err(Error::NothingKept { filter, points, .. }) if several => {
                part.note(&format!("--keep {filter} leaves none of its {points} points"));
                Ok(None)
            }
            Err(error) => Err(failure(input, error)),
        });
        // Of several failures, the first input's is reported, independent of timing.
        let clouds: Vec<Result<_, Failure>> = clouds.collect();
        let clouds = clouds.into_iter().collect::<Result<Vec<_>, _>>()?;
        if clouds.iter().all(Option::is_none) {
            return Err(Failure::new(Exit::Input, format!("{}: --keep leaves none of their points", self.names())));
        }
        let filled = clouds.into_iter().zip(parts).filter_map(|(cloud, part)| Some((cloud?, part)));
        let (clouds, parts): (Vec<_>, Vec<_>) = filled.unzip();
        let unplaced: Vec<&PointCloud> = clouds.iter().map(|(cloud, _)| cloud).collect();
        differences(&unplaced).iter().for_each(|(index, note)| parts[*index].note(note));
        if clouds.len() > 1 {
            let boxes: Vec<[DVec3; 2]> = clouds.par_iter().map(world_box).collect();
            note_distant_inputs(&boxes, |at, note| parts[at].note(note));
        }
        let finite = |cloud: &PointCloud| cloud.positions().par_iter().filter(|place| is_finite(place)).count();
        let placed = clouds.iter().any(|(_, world_from_input)| *world_from_input != DMat4::IDENTITY);
        let before = if placed { clouds.iter().map(|(cloud, _)| finite(cloud)).sum() } else { 0 };
        let merged = PointCloud::merge(clouds);
        let after = if placed { finite(&merged) } else { 0 };
        if after < before {
            let lost = before - after;
            let why = format!("--pose moves {lost} of {before} points further than numbers reach");
            return Err(Failure::new(Exit::Input, format!("{}: {why}; correct the pose", self.names())));
        }
        Ok(merged)
    }
}

fn is_finite(position: &[f32; 3]) -> bool {
    position.iter().all(|along| along.is_finite())
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

/// Notes on the fields and coordinate systems that the merged cloud loses because the inputs differ in them, each with
/// the number of the input.
fn differences(clouds: &[&PointCloud]) -> Vec<(usize, String)> {
    let [first, others @ ..] = clouds else { return Vec::new() };
    let mut notes = Vec::new();
    for (index, cloud) in clouds.iter().enumerate() {
        let lost = cloud.fields().iter().filter(|field| !clouds.iter().all(|other| other.knows(&field.name)));
        let lost: Vec<String> = lost.map(|field| field.name.escape_debug().take(40).collect()).collect();
        if !lost.is_empty() {
            let more = if lost.len() > MAX_LISTED_NAMES {
                format!(" and {} more", lost.len() - MAX_LISTED_NAMES)
            } else {
                String::new()
            };
            let names = lost[..lost.len().min(MAX_LISTED_NAMES)].join(", ");
            notes.push((index, format!("not all inputs have {names}{more}; left out")));
        }
    }
    if others.iter().any(|other| other.crs() != first.crs()) {
        let units = others.iter().any(|other| other.crs().unit != first.crs().unit);
        let what = if units { "coordinate systems and units" } else { "coordinate systems" };
        notes.push((0, format!("the inputs differ in their {what}; nothing is converted, the result has none")));
    }
    notes
}

/// Parses the name of an input. A file must exist.
fn existing(name: &str) -> Result<Input, Failure> {
    let input = Input { name: name.into(), ..Input::parse(name)? };
    if let Some(path) = input.source.path() {
        let metadata = metadata(path).map_err(|error| {
            let hint = if Scene::names().any(|(scene, _)| scene == name) {
                format!("; for the generated scene type {SCENE_PREFIX}{name}")
            } else {
                String::new()
            };
            Failure::new(Exit::Input, format!("{name}: {error}{hint}"))
        })?;
        if metadata.is_dir() && matches!(input.source, Source::File(_)) {
            return Err(Failure::new(Exit::Input, format!("{name}: this is a folder; name the files in it")));
        }
    }
    Ok(input)
}

/// Reads all points of an input, or of its first frame.
fn read_whole(input: &Input, progress: &dyn Progress) -> Result<PointCloud, Error> {
    if input.source.moves() || is_made(input) {
        first_frame(input, progress)
    } else {
        input.source.read(&input.options, progress)
    }
}

/// Whether the points are sampled or scanned, so that there are none without a surface.
fn is_made(input: &Input) -> bool {
    input.play.sample.is_some() || input.play.scanners.is_some()
}

/// The first points of an input that is played.
fn first_frame(input: &Input, progress: &dyn Progress) -> Result<PointCloud, Error> {
    let mut player = input.source.play(&input.play, &input.options, progress)?;
    let cloud = player.first(Source::FIRST_POINTS_TIMEOUT, progress)?;
    if let Some(which) = which_frame(&player) {
        progress.note(&format!("this is {which}"));
    }
    Ok(Arc::unwrap_or_clone(cloud))
}

/// Which frame of several the player has [first](Player::first) found points in; `None` for a single frame and for live
/// points.
pub(crate) fn which_frame(player: &Player) -> Option<String> {
    let frames = player.stream().timeline()?.len();
    match player.position()? {
        _ if frames < 2 => None,
        0 => Some(format!("the first of {frames} frames")),
        frame => Some(format!("frame {frame} of 0 to {}, the first with points", frames - 1)),
    }
}

/// Plays a file or a folder as it changes.
fn watch(path: &Path, input: &Input) -> Result<Player, Failure> {
    if is_made(input) {
        let name = &input.name;
        return Err(Failure::usage(format!("--watch: {name} cannot be sampled; leave out --sample and --scan")));
    }
    let stream = Live::watch(path, &input.options)?;
    Ok(Player::new(Box::new(stream), input.play.latest.clone()))
}

/// The failure to read an input. The message names the input.
fn failure(input: &Input, error: Error) -> Failure {
    match error {
        Error::NoSurface => Failure::new(Exit::Input, format!("{}: {error}", input.name)),
        Error::NoFrames { why, .. } => Failure::new(Exit::Input, format!("{}: {why}", input.name)),
        error => error.into(),
    }
}

/// Title of the task that reads an input.
fn task(input: &Input) -> String {
    match &input.source {
        Source::File(path) => {
            format!("reading {}", path.file_name().unwrap_or(path.as_os_str()).to_string_lossy())
        }
        Source::Scene(..) => format!("generating {}", input.name),
        Source::Sequence(_) | Source::Recording(_) | Source::StandardInput => format!("reading {}", input.name),
        Source::Address(_) => format!("fetching {}", input.name),
        Source::Remote(_) => format!("waiting for {}", input.name),
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
