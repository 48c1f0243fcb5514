//! How an input is stored in sessions and settings: its source, and how it is read, played and shown.

use std::path::Path;
use std::time::Duration;

use autosplats::cloud::glam::DMat4;
use autosplats::cloud::{Error, PointFilter};
use autosplats_formats::{DepthCamera, ReadOptions};
use autosplats_sources::{LatestOptions, PlayOptions, Source};
use serde::{Deserialize, Serialize};

use crate::session::{Appearance, Input};

/// An input as stored in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StoredInput {
    /// Path of a file (relative to the session's folder unless absolute), name of a scene, or address of a stream.
    pub(crate) source: String,
    #[serde(default = "yes")]
    pub(crate) visible: bool,
    #[serde(default)]
    pub(crate) tint: Option<[u8; 3]>,
    /// From the input's own to world coordinates, by columns.
    #[serde(default)]
    pub(crate) pose: DMat4,
    #[serde(default, skip_serializing_if = "StoredReadOptions::is_usual")]
    options: StoredReadOptions,
    #[serde(default, skip_serializing_if = "StoredPlayOptions::is_usual")]
    play: StoredPlayOptions,
}

/// How an input is read, where this differs from the default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct StoredReadOptions {
    #[serde(skip_serializing_if = "Option::is_none")]
    columns: Option<Vec<String>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    depth_camera: Option<DepthCamera>,
    /// Words of the filter of points.
    #[serde(skip_serializing_if = "Option::is_none")]
    keep: Option<String>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    keep_no_returns: bool,
}

/// How an input is played, where this differs from the default. The names are those of the program's flags.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct StoredPlayOptions {
    #[serde(skip_serializing_if = "Option::is_none")]
    fps: Option<f64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    topics: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fixed_frame: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sample: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    scan: Option<usize>,
    #[serde(skip_serializing_if = "is_zero")]
    seed: u64,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    watch: bool,
    /// Seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    decay: Option<f64>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    accumulate: bool,
}

impl StoredInput {
    /// Stores an input and its appearance.
    pub(crate) fn of(input: &Input, appearance: Appearance) -> Self {
        let Appearance { visible, tint } = appearance;
        let (source, pose) = (input.source_name(), input.world_from_input);
        Self {
            source,
            visible,
            tint,
            pose,
            options: StoredReadOptions::of(&input.options),
            play: StoredPlayOptions::of(input),
        }
    }

    /// An input of which only the source is known.
    pub(crate) fn named(source: String) -> Self {
        let (options, play) = (StoredReadOptions::default(), StoredPlayOptions::default());
        Self { source, visible: true, tint: None, pose: DMat4::IDENTITY, options, play }
    }

    /// File name without folders.
    pub(crate) fn short_name(&self) -> String {
        let name = Path::new(&self.source).file_name();
        name.map_or_else(|| self.source.clone(), |name| name.to_string_lossy().into_owned())
    }

    /// Whether the input moves, or may move.
    pub(crate) fn moves(&self) -> bool {
        self.clone().open(Path::new("")).is_ok_and(|(input, _)| input.moves())
    }

    /// Why the stored values are invalid; `None` if they are valid.
    pub(crate) fn problem(&self) -> Option<String> {
        if let Some(Err(error)) = self.options.keep.as_ref().map(|words| words.parse::<PointFilter>()) {
            return Some(format!("{}: keep: {error}", self.source));
        }
        let decay = self.play.decay?;
        let wrong = Duration::try_from_secs_f64(decay).is_err();
        wrong.then(|| format!("{}: decay is a number of seconds, not {decay}", self.source))
    }

    /// The input and its appearance. Relative paths are resolved against `folder`.
    ///
    /// # Errors
    /// [`Error::UnknownScene`] and [`Error::BadScene`].
    pub(crate) fn open(self, folder: &Path) -> Result<(Input, Appearance), Error> {
        let Self { source, visible, tint, pose, options, play } = self;
        let input = Input::parse(&if Source::is_address(&source) {
            source
        } else {
            folder.join(source).display().to_string()
        })?;
        let (options, play) = (options.options(), play.options());
        let input = Input { world_from_input: pose, options, play, ..input };
        Ok((input, Appearance { visible, tint }))
    }
}

impl StoredReadOptions {
    fn of(options: &ReadOptions) -> Self {
        let ReadOptions { keep_no_returns, columns, depth_camera, keep, .. } = options.clone();
        Self { columns, depth_camera, keep: keep.map(|filter| filter.to_string()), keep_no_returns }
    }

    /// Whether all values are defaults.
    fn is_usual(&self) -> bool {
        *self == Self::default()
    }

    fn options(self) -> ReadOptions {
        let Self { columns, depth_camera, keep, keep_no_returns } = self;
        let keep = keep.and_then(|words| words.parse().ok());
        ReadOptions { columns, depth_camera, keep, keep_no_returns, ..ReadOptions::default() }
    }
}

impl StoredPlayOptions {
    fn of(input: &Input) -> Self {
        let PlayOptions { fps, topics, frame, sample, scanners, seed, watch, latest, all: _ } = input.play.clone();
        Self {
            fps,
            topics,
            fixed_frame: frame,
            sample,
            scan: scanners,
            seed,
            watch,
            decay: latest.decay.map(|decay| decay.as_secs_f64()),
            accumulate: latest.accumulate,
        }
    }

    /// Whether all values are defaults.
    fn is_usual(&self) -> bool {
        *self == Self::default()
    }

    fn options(self) -> PlayOptions {
        let Self { fps, topics, fixed_frame, sample, scan, seed, watch, decay, accumulate } = self;
        let decay = decay.and_then(|decay| Duration::try_from_secs_f64(decay).ok());
        let latest = LatestOptions { decay, accumulate, ..LatestOptions::default() };
        let (frame, scanners) = (fixed_frame, scan);
        PlayOptions { fps, topics, frame, sample, scanners, seed, watch, latest, all: false }
    }
}

fn yes() -> bool {
    true
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_zero(number: &u64) -> bool {
    *number == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An input with all values set.
    fn told() -> Input {
        let depth_camera = Some(DepthCamera { fx: 525.0, fy: 525.5, cx: 319.5, cy: 239.5, scale: Some(5000.0) });
        let columns = Some(vec!["x".into(), "-".into(), "y".into()]);
        let keep = "ground,-withheld".parse().ok();
        let options = ReadOptions { columns, depth_camera, keep, keep_no_returns: true, ..ReadOptions::default() };
        let latest = LatestOptions { decay: Some(Duration::from_millis(250)), ..LatestOptions::default() };
        let play = PlayOptions {
            fps: Some(12.5),
            topics: vec!["/front".into(), "/rear".into()],
            frame: Some("map".into()),
            sample: Some(1000),
            scanners: Some(3),
            seed: 7,
            watch: true,
            all: false,
            latest,
        };
        let world_from_input = DMat4::from_rotation_z(0.5);
        Input { options, play, world_from_input, ..Input::file("/a/drive.mcap".into()) }
    }

    #[test]
    fn all_that_was_told_comes_back() {
        let appearance = Appearance { visible: false, tint: Some([1, 2, 3]) };
        let kept = StoredInput::of(&told(), appearance);
        let text = serde_json::to_string(&kept).expect("it can be written");
        let read: StoredInput = serde_json::from_str(&text).expect("and read");
        assert_eq!(read, kept, "as it was: {text}");
        assert_eq!(read.problem(), None, "nothing is wrong with it");
        let (input, seen) = read.open(Path::new("/elsewhere")).expect("it can be opened");
        let Input { options, play, world_from_input, .. } = told();
        assert_eq!((seen, input.world_from_input), (appearance, world_from_input));
        assert_eq!(input.play, play, "played as it was");
        assert_eq!(
            (input.options.columns, input.options.depth_camera, input.options.keep_no_returns),
            (options.columns, options.depth_camera, true),
            "and read"
        );
        assert_eq!(input.options.keep, options.keep, "the same points");
        let all = PlayOptions { latest: LatestOptions { accumulate: true, ..LatestOptions::default() }, ..play };
        let (all, _) = StoredInput::of(&Input { play: all, ..told() }, appearance).open(Path::new("")).expect("a file");
        assert!(all.play.latest.accumulate && all.play.latest.decay.is_none(), "all that came is kept");
    }

    #[test]
    fn what_was_not_told_is_not_written() {
        let usual = StoredInput::of(&Input::file("/a/b.ply".into()), Appearance::default());
        let text = serde_json::to_string(&usual).expect("it can be written");
        assert!(!text.contains("options") && !text.contains("play"), "{text}");
        assert_eq!(usual, StoredInput::named("/a/b.ply".into()), "nothing is known but its name");
        assert_eq!(usual.short_name(), "b.ply");
        assert!(!usual.moves() && StoredInput::named("drive.mcap".into()).moves(), "recordings do");
        let relative = StoredInput::named("b.ply".into()).open(Path::new("/a")).expect("a file");
        assert_eq!(relative.0.source.path(), Some(Path::new("/a/b.ply")), "from the folder");
        assert!(StoredInput::named("scene:nothing".into()).open(Path::new("/a")).is_err(), "there is no such scene");
    }

    #[test]
    fn values_that_mean_nothing_are_told() {
        for wrong in [r#""play": {"decay": -1}"#, r#""play": {"decay": 1e300}"#, r#""options": {"keep": "grond"}"#] {
            let text = format!(r#"{{"source": "drive.mcap", {wrong}}}"#);
            let kept: StoredInput = serde_json::from_str(&text).expect("it can be read");
            assert!(kept.problem().is_some_and(|problem| problem.contains("drive.mcap")), "{text}");
        }
    }
}
