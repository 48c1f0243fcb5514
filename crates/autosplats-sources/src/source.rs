//! Sources of point clouds: files, sequences, recordings, live streams and generated scenes.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use autosplats_cloud::{Error, PointCloud, Progress, Tree};
use autosplats_formats::{ReadOptions, files_beside, open_tree, read_mesh, tree_file};
use autosplats_scenes::{SCENE_PREFIX, Scene};

#[cfg(feature = "zenoh")]
use crate::remote;
use crate::{
    address,
    animation::Animation,
    latest::LatestOptions,
    listing::candidates,
    live::{Live, LiveOptions},
    player::Player,
    recording::{Recording, RecordingOptions, is_recording},
    stream::{Stream, Timeline},
};

/// Prefix of the address of points over Zenoh.
const REMOTE_PREFIX: &str = "zenoh://";
/// Bytes of memory per generated point: position and colour.
const BYTES_PER_GENERATED_POINT: u64 = 16;
/// Default files per second of a sequence.
const SEQUENCE_FPS: f64 = 10.0;
/// Default frames per second of an animated glTF or scene.
const MOTION_FPS: f64 = 30.0;

/// An input of points.
///
/// ```
/// use autosplats_formats::ReadOptions;
/// use autosplats_sources::Source;
///
/// let source = Source::parse("scene:figure:2K")?;
/// assert_eq!(source.read(&ReadOptions::default(), &())?.len(), 2000);
/// assert!(matches!(Source::parse("scan.laz")?, Source::File(_)));
/// assert!(matches!(Source::parse("scans/frame_*.ply")?, Source::Sequence(_)));
/// assert!(matches!(Source::parse("drive.mcap")?, Source::Recording(_)));
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
#[derive(Clone, Debug)]
pub enum Source {
    /// A file of any of the [formats](autosplats_formats::formats).
    File(PathBuf),
    /// A generated scene and its number of points.
    Scene(Scene, usize),
    /// A folder of files or a pattern that matches files, one file per frame.
    Sequence(String),
    /// A recording of a robot: an MCAP file, a ROS 1 bag or the folder of a ROS 2 bag.
    Recording(PathBuf),
    /// PLY and PCD files, one after the other, from standard input.
    StandardInput,
    /// The address of ROS 2 topics over Zenoh. [`Source::play`] needs the feature `zenoh`.
    Remote(String),
    /// The `http://`, `https://`, `s3://`, `gs://` or `az://` address of a file. Reading needs the feature `http`.
    Address(String),
}

/// How [`Source::play`] plays a source. Options that do not apply to the kind of source are ignored, unless stated.
///
/// ```
/// use std::time::Duration;
///
/// use autosplats_sources::{LatestOptions, PlayOptions, Source};
/// use autosplats_formats::ReadOptions;
///
/// // Frames are 0.2 s apart: a decay of 0.3 s keeps the frame before.
/// let latest = LatestOptions { decay: Some(Duration::from_millis(300)), ..Default::default() };
/// let options = PlayOptions { fps: Some(5.0), latest, ..PlayOptions::default() };
/// let source = Source::parse("scene:figure:2K")?;
/// let mut player = source.play(&options, &ReadOptions::default(), &())?;
/// assert_eq!(player.frame(3, &())?.len(), 4000);
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlayOptions {
    /// Frames per second: files of a sequence (default 10), or poses of an animated glTF or scene (default 30).
    pub fps: Option<f64>,
    /// Topics of a recording to play; empty for all topics with points.
    pub topics: Vec<String>,
    /// Coordinate frame for the points of a recording or of robots over Zenoh. See [`RecordingOptions::frame`].
    pub frame: Option<String>,
    /// Number of points to sample on the surface, in place of mesh vertices. [`Error::NoSurface`] if there is none.
    pub sample: Option<usize>,
    /// Number of simulated scanners, at least 1, whose points replace all others. [`Error::NoSurface`] without surface.
    pub scanners: Option<usize>,
    /// Seed of the scanners' noise.
    pub seed: u64,
    /// Shows only the newest file of a sequence, and reloads it when it changes.
    pub watch: bool,
    /// Plays every frame of standard input and drops none. See [`LiveOptions::all`].
    pub all: bool,
    /// Points that stay visible beside the newest ones.
    pub latest: LatestOptions,
}

impl Source {
    /// Longest time to wait for the first points of a live stream. Whoever waits can cancel; a robot's connection and
    /// its transforms may take many seconds.
    pub const FIRST_POINTS_TIMEOUT: Duration = Duration::from_secs(30);

    /// Whether a name is an address, of a generated scene or of live points, and no path.
    pub fn is_address(name: &str) -> bool {
        name.starts_with(SCENE_PREFIX) || name.contains("://")
    }

    /// Parses the name of a source:
    ///
    /// - `scene:NAME[:COUNT][@SECONDS]` is a generated scene.
    /// - `zenoh://[HOST[:PORT]]/TOPIC` is a live topic.
    /// - `http://`, `https://`, `s3://`, `gs://` and `az://` begin the address of a file.
    /// - `-` is standard input.
    /// - A path that [`is_recording`](crate::is_recording) accepts is a recording: `.mcap`, `.bag`, `.db3`, or the
    ///   folder of a ROS 2 bag.
    /// - A folder with [a file that describes an octree](autosplats_formats::TREE_FILES) is one scan.
    /// - Any other folder, and a pattern with `*` or `?` that is not itself a path, is a sequence.
    /// - Anything else is a file, which need not exist.
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
        } else if address::is_address(name) {
            Ok(Self::Address(name.into()))
        } else if is_recording(path) {
            Ok(Self::Recording(path.into()))
        } else if let Some(file) = tree_file(path) {
            Ok(Self::File(file))
        } else if path.is_dir() || name.contains(['*', '?']) && !path.exists() {
            Ok(Self::Sequence(name.into()))
        } else {
            Ok(Self::File(path.into()))
        }
    }

    /// The path of a file or recording; `None` for other sources.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::File(path) | Self::Recording(path) => Some(path),
            Self::Scene(..) | Self::Sequence(_) | Self::StandardInput | Self::Remote(_) | Self::Address(_) => None,
        }
    }

    /// All files that currently belong to the source, and those that [they refer to](files_beside).
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files = match self {
            Self::File(path) => vec![path.clone()],
            Self::Recording(path) if path.is_dir() => candidates(&path.to_string_lossy()).unwrap_or_default(),
            Self::Recording(path) => vec![path.clone()],
            Self::Sequence(name) => candidates(name).unwrap_or_default(),
            Self::Scene(..) | Self::StandardInput | Self::Remote(_) | Self::Address(_) => Vec::new(),
        };
        let beside: Vec<PathBuf> = files.iter().flat_map(|file| files_beside(file)).collect();
        files.extend(beside);
        files
    }

    /// The last component of the path, pattern or address; `None` for scenes and standard input.
    pub fn short_name(&self) -> Option<String> {
        let path = match self {
            Self::File(path) | Self::Recording(path) => path,
            Self::Sequence(name) | Self::Remote(name) => Path::new(name),
            Self::Address(address) => return Some(address::short_name(address)),
            Self::Scene(..) | Self::StandardInput => return None,
        };
        path.file_name().map(|name| name.to_string_lossy().into_owned())
    }

    /// Lower bound of the memory needed, in bytes, without opening the source; 0 if unknown.
    pub fn least_bytes(&self) -> u64 {
        match self {
            Self::Scene(_, count) => *count as u64 * BYTES_PER_GENERATED_POINT,
            _ => 0,
        }
    }

    /// Whether the points change by themselves. Files and scenes return false, but can be [played](Self::play) as well.
    pub fn moves(&self) -> bool {
        matches!(self, Self::Sequence(_) | Self::Recording(_) | Self::StandardInput | Self::Remote(_))
    }

    /// The [span](Timeline::span) of the timeline of a recording, for [`beginnings`](crate::beginnings). `None` for
    /// other sources, whose stamps share no clock.
    pub fn clock_span(&self, timeline: &Timeline) -> Option<[i64; 2]> {
        matches!(self, Self::Recording(_)).then(|| timeline.span()).flatten()
    }

    /// Reads or generates the cloud. A source that changes gives its [first](Player::first) frame with points.
    ///
    /// # Errors
    /// Those of [`read`](autosplats_formats::read), of [`Scene::sample`] or of [`play`](Self::play).
    pub fn read(&self, options: &ReadOptions, progress: &dyn Progress) -> Result<PointCloud, Error> {
        self.check_filter(options)?;
        match self {
            Self::File(path) => address::read_file(path, options, progress),
            Self::Address(address) => address::read(address, options, progress),
            Self::Scene(scene, count) => scene.sample(*count, progress),
            moving => {
                let cloud = moving
                    .play(&PlayOptions::default(), options, progress)?
                    .first(Self::FIRST_POINTS_TIMEOUT, progress)?;
                Ok(Arc::unwrap_or_clone(cloud))
            }
        }
    }

    /// Opens a file or an address whose points are stored as an octree, so that parts can be read. `None` if they are
    /// not.
    ///
    /// # Errors
    /// Those of [`open_tree`](autosplats_formats::open_tree), and those of the network.
    pub fn open_tree(&self, options: &ReadOptions, progress: &dyn Progress) -> Result<Option<Arc<dyn Tree>>, Error> {
        match self {
            Self::File(path) => open_tree(path, progress),
            Self::Address(address) => address::open_tree(address, options, progress),
            _ => Ok(None),
        }
    }

    /// Prepares the source for playing. A static file has one frame.
    ///
    /// # Errors
    /// - [`Error::NoFrames`] if there is nothing to play.
    /// - [`Error::BadValue`] if an option is out of its range.
    /// - [`Error::NoSurface`] if samples or scanners are asked for and there is no surface.
    /// - The errors of reading what all frames share.
    pub fn play(&self, play: &PlayOptions, options: &ReadOptions, progress: &dyn Progress) -> Result<Player, Error> {
        self.check_filter(options)?;
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
                let why = "this program was built without Zenoh; build it with the feature 'zenoh'".into();
                return Err(Error::NoFrames { name: address.clone(), why });
            }
            Self::Sequence(name) if play.watch => return Self::plain(Live::watch(name.as_ref(), options)?, play),
            Self::Sequence(name) => Animation::sequence(name, play.fps.unwrap_or(SEQUENCE_FPS), options, progress)?,
            Self::Scene(scene, count) => Animation::scene(scene, *count, fps)?,
            Self::Address(address) => Animation::still(address::read(address, options, progress)?.into()),
            Self::File(path) => {
                let still = || Ok(Animation::still(read_mesh(path, options, progress)?));
                if is_gltf(path) {
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

    /// Fails if points without classes, flags and returns shall be filtered by these.
    fn check_filter(&self, options: &ReadOptions) -> Result<(), Error> {
        let filtered = options.keep.as_ref().filter(|filter| !filter.is_all() && !filter.is_usual());
        let lacking = match self {
            Self::Scene(..) => "generated scenes",
            Self::File(path) if is_gltf(path) => "the points of glTF",
            _ => return Ok(()),
        };
        filtered.map_or(Ok(()), |filter| {
            Err(Error::BadFilter {
                word: filter.to_string(),
                why: format!("cannot be kept: {lacking} have no classes"),
            })
        })
    }

    /// Plays a stream of points without a surface.
    fn plain(stream: impl Stream + 'static, play: &PlayOptions) -> Result<Player, Error> {
        if play.sample.is_some() || play.scanners.is_some() {
            return Err(Error::NoSurface);
        }
        Ok(Player::new(Box::new(stream), play.latest.clone()))
    }
}

/// Whether a file is called like a glTF, which may be animated.
pub(crate) fn is_gltf(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("glb") || end.eq_ignore_ascii_case("gltf"))
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
        assert!(matches!(kind("https://a.b/c.copc.laz"), Source::Address(_)), "an address of a file");
        std::fs::create_dir(path("ept")).expect("a folder");
        std::fs::write(path("ept/ept.json"), "{}").expect("a file");
        assert!(matches!(kind(&path("ept")), Source::File(file) if file.ends_with("ept.json")), "a folder of EPT");
        std::fs::write(path("metadata.yaml"), "rosbag2_bagfile_information:").expect("a file");
        assert!(matches!(kind(&path("")), Source::Recording(_)), "a folder of ROS 2");
    }
}
