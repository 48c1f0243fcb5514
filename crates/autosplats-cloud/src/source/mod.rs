//! Where clouds come from.

pub(crate) mod align;
pub(crate) mod animation;
mod clock;
pub(crate) mod latest;
pub(crate) mod live;
pub(crate) mod player;
pub mod point_cloud2;
pub(crate) mod recording;
#[cfg(feature = "zenoh")]
pub mod remote;
pub(crate) mod scanner;
pub(crate) mod scene;
pub(crate) mod stream;
pub(crate) mod wire;

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use self::{
    animation::{Animation, candidates},
    latest::LatestOptions,
    live::{Live, LiveOptions},
    player::Player,
    recording::{Recording, RecordingOptions, is_recording},
    stream::{Stream, Timeline},
};
use crate::{Error, PointCloud, Progress, ReadOptions, Scene, read::colors_beside, read_mesh, read_with};

/// What begins the name of a generated scene.
const SCENE_PREFIX: &str = "scene:";
/// What begins the address of points over Zenoh.
const REMOTE_PREFIX: &str = "zenoh://";
/// Bytes that a generated point takes: position and colour.
const BYTES_PER_GENERATED_POINT: u64 = 16;
/// Files of a sequence that are shown in a second.
const SEQUENCE_FPS: f64 = 10.0;
/// Times a second that what moves all the while is looked at.
const MOTION_FPS: f64 = 30.0;
/// How long the first points of something live are waited for.
const FIRST_POINTS: Duration = Duration::from_secs(10);

/// Something that points come from.
#[derive(Clone, Debug)]
pub enum Source {
    /// A file of any of the [formats](crate::formats).
    File(PathBuf),
    /// A generated scene of so many points.
    Scene(Scene, usize),
    /// A folder of files, or a pattern that stands for them, which follow each other.
    Sequence(String),
    /// A recording of a robot: a file, or a folder of ROS 2.
    Recording(PathBuf),
    /// PLY and PCD files, one after the other, from standard input.
    StandardInput,
    /// Topics of ROS 2 over Zenoh, by their address; played with the feature `zenoh` only.
    Remote(String),
}

/// How what moves is played.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlayOptions {
    /// Files of a sequence in a second, 10 if it is not said; times a second that a glTF or a scene is looked at, else 30.
    pub fps: Option<f64>,
    /// Topics of a recording; all of them if there are none.
    pub topics: Vec<String>,
    /// Coordinate frame of a recording, or of robots heard over Zenoh, that points are brought into; see
    /// [`RecordingOptions::frame`].
    pub frame: Option<String>,
    /// Points that are strewn over a mesh in place of its vertices.
    pub sample: Option<usize>,
    /// Simulated scanners, 1 to 4, that stand around and whose points are taken in place of all.
    pub scanners: Option<usize>,
    /// Another seed makes other noise of the scanners.
    pub seed: u64,
    /// A folder is no sequence: its newest file is shown, as it changes.
    pub watch: bool,
    /// All that comes through a pipe is taken, as in [`LiveOptions::all`].
    pub all: bool,
    /// What is kept beside the newest points.
    pub latest: LatestOptions,
}

impl Source {
    /// What a name means: `scene:NAME[:COUNT][@SECONDS]`; `zenoh://[HOST[:PORT]]/TOPIC`; `-`, standard input; a folder, or a pattern with `*` or `?` that is no
    /// file, for a sequence or a recording; a recording by its extension (`.mcap`, `.bag`, `.db3`); or else a file, which need
    /// not exist.
    ///
    /// # Errors
    /// [`Error::UnknownScene`] and [`Error::BadScene`].
    pub fn parse(name: &str) -> Result<Self, Error> {
        let path = Path::new(name);
        if name.starts_with(SCENE_PREFIX) {
            let (scene, count) = Scene::parse(name)?;
            Ok(Self::Scene(scene, count))
        } else if name == "-" {
            Ok(Self::StandardInput)
        } else if name.starts_with(REMOTE_PREFIX) {
            Ok(Self::Remote(name.into()))
        } else if is_recording(path) {
            Ok(Self::Recording(path.into()))
        } else if path.is_dir() || name.contains(['*', '?']) && !path.exists() {
            Ok(Self::Sequence(name.into()))
        } else {
            Ok(Self::File(path.into()))
        }
    }

    /// The file, or the folder of a recording, if it is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::File(path) | Self::Recording(path) => Some(path),
            Self::Scene(..) | Self::Sequence(_) | Self::StandardInput | Self::Remote(_) => None,
        }
    }

    /// All files that it is read from, as far as they are there now: of a sequence those that its name stands for, of a
    /// recording's folder all that are in it; and the pictures that give depth images their colours.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files = match self {
            Self::File(path) => vec![path.clone()],
            Self::Recording(path) if path.is_dir() => candidates(&path.to_string_lossy()).unwrap_or_default(),
            Self::Recording(path) => vec![path.clone()],
            Self::Sequence(name) => candidates(name).unwrap_or_default(),
            Self::Scene(..) | Self::StandardInput | Self::Remote(_) => Vec::new(),
        };
        let colors: Vec<PathBuf> = files.iter().filter_map(|file| colors_beside(file)).collect();
        files.extend(colors);
        files
    }

    /// The last part of its path, pattern or address; none of what has no such thing.
    pub fn short_name(&self) -> Option<String> {
        let path = match self {
            Self::File(path) | Self::Recording(path) => path,
            Self::Sequence(name) | Self::Remote(name) => Path::new(name),
            Self::Scene(..) | Self::StandardInput => return None,
        };
        path.file_name().map(|name| name.to_string_lossy().into_owned())
    }

    /// Bytes that will be taken at least, as far as that is known without a look at it.
    pub fn least_bytes(&self) -> u64 {
        match self {
            Self::Scene(_, count) => *count as u64 * BYTES_PER_GENERATED_POINT,
            _ => 0,
        }
    }

    /// Whether its points change by themselves. Files and scenes can be [played](Self::play) as well.
    pub fn moves(&self) -> bool {
        matches!(self, Self::Sequence(_) | Self::Recording(_) | Self::StandardInput | Self::Remote(_))
    }

    /// The [span](Timeline::span) of its timeline by a clock that others may share, as [`beginnings`](crate::beginnings) takes it.
    /// Recordings have such a clock; the stamps of all others count from their own beginning.
    pub fn clock_span(&self, timeline: &Timeline) -> Option<[i64; 2]> {
        matches!(self, Self::Recording(_)).then(|| timeline.span()).flatten()
    }

    /// Reads or generates the cloud; of what moves, the first.
    ///
    /// # Errors
    /// Those of [`read`](crate::read), of [`Scene::sample`] or of [`play`](Self::play).
    pub fn read(&self, options: &ReadOptions, progress: &dyn Progress) -> Result<PointCloud, Error> {
        match self {
            Self::File(path) => read_with(path, options, progress),
            Self::Scene(scene, count) => scene.sample(*count, &|done| {
                progress.report(done);
                !progress.cancelled()
            }),
            moving => {
                let cloud = moving.play(&PlayOptions::default(), options, progress)?.first(FIRST_POINTS, progress)?;
                Ok(Arc::unwrap_or_clone(cloud))
            }
        }
    }

    /// Makes it ready to be played. What stands still has one frame.
    ///
    /// # Errors
    /// [`Error::NoFrames`] if there is nothing to play, [`Error::BadValue`], [`Error::NoSurface`] for scanners and samples of what
    /// has none, and those of reading what all frames need.
    pub fn play(&self, play: &PlayOptions, options: &ReadOptions, progress: &dyn Progress) -> Result<Player, Error> {
        let fps = play.fps.unwrap_or(MOTION_FPS);
        let animation = match self {
            Self::Recording(path) => {
                let PlayOptions { topics, frame, .. } = play.clone();
                let options = RecordingOptions { topics, frame, read: options.clone() };
                return Self::plain(Recording::open(path, &options, progress)?, play);
            }
            Self::StandardInput => {
                let options = LiveOptions { read: options.clone(), all: play.all, ..LiveOptions::default() };
                return Self::plain(Live::bytes(std::io::stdin(), "standard input", &options)?, play);
            }
            #[cfg(feature = "zenoh")]
            Self::Remote(address) => {
                let options = remote::RemoteOptions { frame: play.frame.clone(), read: options.clone() };
                return Self::plain(remote::Remote::open(address, &options)?, play);
            }
            #[cfg(not(feature = "zenoh"))]
            Self::Remote(address) => {
                let why = "this build has no Zenoh; it takes one with the feature 'zenoh'".into();
                return Err(Error::NoFrames { name: address.clone(), why });
            }
            Self::Sequence(name) if play.watch => return Self::plain(Live::watch(name.as_ref(), options)?, play),
            Self::Sequence(name) => Animation::sequence(name, play.fps.unwrap_or(SEQUENCE_FPS), options, progress)?,
            Self::Scene(scene, count) => Animation::scene(scene, *count, fps)?,
            Self::File(path) => {
                let still = || Ok(Animation::still(read_mesh(path, options, progress)?));
                let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
                if extension == "glb" || extension == "gltf" {
                    match Animation::gltf(path, fps, progress) {
                        Err(Error::NoFrames { .. }) => still()?,
                        animation => animation?,
                    }
                } else {
                    still()?
                }
            }
        };
        let animation = match play.sample {
            Some(count) => animation.sampled(count, progress)?,
            None => animation,
        };
        let animation = match play.scanners {
            Some(count) => animation.scanned(animation.scanners(count, progress)?, play.seed)?,
            None => animation,
        };
        Ok(Player::new(Box::new(animation.play()), play.latest.clone()))
    }

    /// Plays what has points and no surface.
    fn plain(stream: impl Stream + 'static, play: &PlayOptions) -> Result<Player, Error> {
        if play.sample.is_some() || play.scanners.is_some() {
            return Err(Error::NoSurface);
        }
        Ok(Player::new(Box::new(stream), play.latest.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_mean_what_is_there() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name).display().to_string();
        std::fs::write(path("odd*.ply"), "").expect("a file");
        let kind = |name: &str| Source::parse(name).expect("a source");
        assert!(matches!(kind(&path("")), Source::Sequence(_)), "a folder");
        assert!(matches!(kind(&path("f_*.ply")), Source::Sequence(_)), "a pattern");
        assert!(matches!(kind(&path("odd*.ply")), Source::File(_)), "a file that looks like a pattern");
        assert!(matches!(kind("drive.mcap"), Source::Recording(_)), "by its extension");
        assert!(matches!(kind("a.ply"), Source::File(_)), "it need not exist");
        assert!(matches!(kind("-"), Source::StandardInput), "as everywhere");
        assert!(matches!(kind("zenoh://robot/points"), Source::Remote(_)), "an address");
        let short = |name: &str| kind(name).short_name();
        assert_eq!(short("a/b/scan.ply").as_deref(), Some("scan.ply"));
        assert_eq!(short("a/f_*.ply").as_deref(), Some("f_*.ply"));
        assert_eq!(short("zenoh://robot/points").as_deref(), Some("points"));
        assert_eq!(short("-"), None, "a pipe is called as it is");
        std::fs::write(path("f_1.ply"), "").expect("a file");
        let files = |name: &str| kind(name).files().len();
        assert_eq!([files(&path("")), files(&path("f_*.ply")), files("a.ply"), files("-")], [2, 1, 1, 0]);
        for name in ["depth_1.pgm", "color_1.png"] {
            std::fs::write(path(name), "").expect("a file");
        }
        assert_eq!(kind(&path("depth_*.pgm")).files().last(), Some(&path("color_1.png").into()), "the colours as well");
        assert!(matches!(kind("scene:statue:1K"), Source::Scene(_, 1000)), "a scene");
        std::fs::write(path("metadata.yaml"), "rosbag2_bagfile_information:").expect("a file");
        assert!(matches!(kind(&path("")), Source::Recording(_)), "a folder of ROS 2");
    }
}
