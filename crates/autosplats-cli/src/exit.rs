//! Failures: one line on standard error, and an exit code for the kind.

use std::fmt::Display;
use std::io;
use std::path::Path;

use autosplats_cloud::ErrorKind;
use autosplats_scenes::Scene;

/// Kind of failure; its value is the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// The command line names something that does not exist or does not fit together.
    Usage = 2,
    /// An input is missing, unreadable or malformed, or shows nothing.
    Input = 3,
    /// An output cannot be written.
    Output = 4,
    /// The requested backend has no device.
    Device = 5,
    /// The task does not fit into memory.
    Memory = 6,
    /// The terminal was closed.
    HungUp = 129,
    /// The user pressed Ctrl-C.
    Interrupted = 130,
    /// The system asked the command to end.
    Terminated = 143,
}

/// Exit codes as `--help` explains them.
pub(crate) const EXIT_CODES: &str = "\
Exit codes:
  0    done
  2    bad usage: an option, a scene, a field or a camera that does not exist or does not fit
  3    bad input: a file that is missing, unreadable, malformed, without points, or not in the picture
  4    an output cannot be written
  5    no usable device for the backend asked for
  6    too large for this machine's memory
  130  interrupted (Ctrl-C); no partial file is left. A second Ctrl-C ends at once. 129 for SIGHUP, 143 for SIGTERM";

/// Why a command failed.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) exit: Exit,
    /// What is wrong and what to do, in one line.
    pub(crate) message: String,
}

impl Failure {
    /// A failure of this kind with a message.
    pub(crate) fn new(exit: Exit, message: impl Display) -> Self {
        Self { exit, message: one_line(&message.to_string()) }
    }

    /// The failure with the exit code of an error's kind.
    fn of(kind: ErrorKind, error: impl Display) -> Self {
        match kind {
            ErrorKind::Argument => Self::usage(error),
            ErrorKind::Memory => Self::new(Exit::Memory, error),
            ErrorKind::Device => Self::new(Exit::Device, error),
            _ => Self::new(Exit::Input, error),
        }
    }

    pub(crate) fn usage(message: impl Display) -> Self {
        Self::new(Exit::Usage, message)
    }

    /// The failure of temporary files in a folder.
    pub(crate) fn temporary(folder: &Path, source: &io::Error) -> Self {
        Self::new(Exit::Output, format!("{}: {source}", folder.display()))
    }

    pub(crate) fn interrupted() -> Self {
        Self::new(Exit::Interrupted, "interrupted")
    }
}

impl From<autosplats_cloud::Error> for Failure {
    fn from(error: autosplats_cloud::Error) -> Self {
        match error {
            autosplats_cloud::Error::UnknownScene { given, .. } => {
                let known = Scene::names().map(|(name, _)| name);
                Self::usage(format!("no scene is called '{given}'; {}", suggest(&given, known)))
            }
            error => Self::of(error.kind(), error),
        }
    }
}

impl From<autosplats::Error> for Failure {
    fn from(error: autosplats::Error) -> Self {
        match error {
            autosplats::Error::Setting { name, value, range } => {
                let option = OPTIONS.iter().find_map(|(field, option)| (*field == name).then_some(*option));
                Self::usage(format!("{} {value}: it must be {range}", option.unwrap_or(name)))
            }
            error => Self::of(error.kind(), error),
        }
    }
}

impl From<autosplats_output::Error> for Failure {
    fn from(error: autosplats_output::Error) -> Self {
        match error.kind() {
            ErrorKind::Argument => Self::usage(error),
            _ => Self::new(Exit::Output, error),
        }
    }
}

#[cfg(feature = "viewer")]
impl From<autosplats_viewer::Error> for Failure {
    fn from(error: autosplats_viewer::Error) -> Self {
        match error {
            autosplats_viewer::Error::Unsaved(_) => Self::new(Exit::Output, error),
            error => Self::of(error.kind(), error),
        }
    }
}

/// Fields of the libraries' settings and the options that set them.
const OPTIONS: [(&str, &str); 11] = [
    ("k", "-k"),
    ("points_per_pixel", "--points-per-pixel"),
    ("first_radius", "--first-radius"),
    ("outlier_expansions", "--e0"),
    ("gap_factor", "--gap-factor"),
    ("splat_scale", "--splat-scale"),
    ("frames_averaged", "--frames-averaged"),
    ("exposure", "--exposure"),
    ("occlusion", "--occlusion"),
    ("range", "--range"),
    ("orientation", "--sensor"),
];

/// A message in one line, without the error numbers of the operating system.
fn one_line(message: &str) -> String {
    let message = message.lines().map(str::trim).collect::<Vec<_>>().join(" ");
    let number = message.split_once(" (os error ").and_then(|(said, after)| Some((said, after.split_once(')')?)));
    match number {
        Some((said, (digits, rest))) if digits.parse::<i32>().is_ok() => format!("{said}{rest}"),
        _ => message,
    }
}

/// Suggests the known name nearest to `typed`, or lists all if none is near.
pub(crate) fn suggest<'a>(typed: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    let distance = |name: &&&str| strsim::osa_distance(&name.to_lowercase(), &typed.to_lowercase());
    match known.iter().min_by_key(distance) {
        Some(name) if distance(&name) <= 1 + typed.len() / 4 => format!("did you mean '{name}'?"),
        _ => format!("there are: {}", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use autosplats::Settings;

    use super::{Failure, one_line, suggest};

    #[test]
    fn the_system_is_told_without_its_numbers() {
        assert_eq!(one_line("a.ply: No such file (os error 2); type b"), "a.ply: No such file; type b");
        assert_eq!(one_line("a (os error b).ply: empty"), "a (os error b).ply: empty", "a name");
        assert_eq!(one_line("a:\n  b"), "a: b", "one line");
    }

    #[test]
    fn settings_are_called_as_their_options() {
        let mut settings = Settings::default();
        settings.reconstruction.outlier_expansions = Some(9);
        let message = settings.check().map_err(|error| Failure::from(error).message);
        assert_eq!(message, Err("--e0 9: it must be within 0 to 8".into()));
    }

    #[test]
    fn suggestions_are_near_or_all() {
        let known = ["height", "rgb", "Intensity"];
        assert_eq!(suggest("hieght", known), "did you mean 'height'?", "two letters swapped");
        assert_eq!(suggest("intensty", known), "did you mean 'Intensity'?", "letter case is ignored");
        assert_eq!(suggest("banana", known), "there are: height, rgb, Intensity", "nothing is near");
    }
}
