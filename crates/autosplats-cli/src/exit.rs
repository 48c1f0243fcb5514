//! Failures: one line on standard error, and an exit code for the kind.

use std::fmt::Display;

/// Kind of failure; its value is the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
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
    /// The user pressed Ctrl-C.
    Interrupted = 130,
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
  130  interrupted (Ctrl-C); no partial file is left";

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
        Self { exit, message: plain(message.to_string()) }
    }

    pub(crate) fn usage(message: impl Display) -> Self {
        Self::new(Exit::Usage, message)
    }

    pub(crate) fn interrupted() -> Self {
        Self::new(Exit::Interrupted, "interrupted")
    }
}

/// A message of the operating system without its error number.
fn plain(message: String) -> String {
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
    use super::{plain, suggest};

    #[test]
    fn the_system_is_told_without_its_numbers() {
        let said = |text: &str| plain(text.into());
        assert_eq!(said("a.ply: No such file (os error 2); type b"), "a.ply: No such file; type b");
        assert_eq!(said("a (os error b).ply: empty"), "a (os error b).ply: empty", "a name");
    }

    #[test]
    fn suggestions_are_near_or_all() {
        let known = ["height", "rgb", "Intensity"];
        assert_eq!(suggest("hieght", known), "did you mean 'height'?", "two letters swapped");
        assert_eq!(suggest("intensty", known), "did you mean 'Intensity'?", "letter case is ignored");
        assert_eq!(suggest("banana", known), "there are: height, rgb, Intensity", "nothing is near");
    }
}
