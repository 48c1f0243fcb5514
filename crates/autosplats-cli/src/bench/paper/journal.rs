//! Journal of measurements: a file that lets an interrupted run be resumed.

use std::collections::BTreeMap;
use std::fs::read_to_string;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::console::Console;
use crate::exit::{Exit, Failure};
use crate::output::write_file;

/// Measurements by key, in a JSON file.
pub(super) struct Journal {
    console: Console,
    path: PathBuf,
    entries: BTreeMap<String, Value>,
}

impl Journal {
    /// Opens the journal at `path`, or creates one. `fresh` discards existing entries.
    pub(super) fn open(path: &Path, fresh: bool, console: &Console) -> Result<Self, Failure> {
        let bad = |why: String| {
            Failure::new(
                Exit::Input,
                format!("{}: not a journal of measurements: {why}; --fresh starts again", path.display()),
            )
        };
        let entries = match read_to_string(path) {
            _ if fresh => BTreeMap::new(),
            Ok(text) => serde_json::from_str(&text).map_err(|error| bad(error.to_string()))?,
            Err(error) if error.kind() == ErrorKind::NotFound => BTreeMap::new(),
            Err(error) => return Err(bad(error.to_string())),
        };
        Ok(Self { console: console.clone(), path: path.into(), entries })
    }

    /// The entry of `key`, if it has the type `T`.
    pub(super) fn get<T: DeserializeOwned>(&self, key: &str) -> Option<T> {
        self.entries.get(key).and_then(|value| serde_json::from_value(value.clone()).ok())
    }

    /// Stores a measurement and writes the file.
    pub(super) fn note(&mut self, key: &str, measured: &impl Serialize) -> Result<(), Failure> {
        let fail = |error: serde_json::Error| Failure::new(Exit::Output, format!("{key}: {error}"));
        self.entries.insert(key.into(), serde_json::to_value(measured).map_err(fail)?);
        let text = serde_json::to_string_pretty(&self.entries).map_err(fail)?;
        write_file(&self.path, &self.console, |writer| writer.write_all(text.as_bytes())).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_noted_is_there_the_next_time() -> Result<(), Failure> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("journal.json");
        let console = Console::of_process();
        let mut journal = Journal::open(&path, false, &console)?;
        assert_eq!(journal.get::<Vec<f64>>("a"), None, "nothing was measured yet");
        journal.note("a", &[1.5, 2.0])?;
        journal.note("b", &"text")?;
        let journal = Journal::open(&path, false, &console)?;
        assert_eq!(journal.get::<Vec<f64>>("a"), Some(vec![1.5, 2.0]));
        assert_eq!(journal.get::<Vec<f64>>("b"), None, "a text is no list");
        assert_eq!(Journal::open(&path, true, &console)?.get::<Vec<f64>>("a"), None, "a fresh one is empty");
        Ok(())
    }

    #[test]
    fn a_broken_journal_is_named_with_the_remedy() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("journal.json");
        std::fs::write(&path, "{\"a\": ").expect("written");
        let failure = Journal::open(&path, false, &Console::of_process()).err().expect("it is cut off");
        assert!(failure.message.contains("--fresh"), "{}", failure.message);
    }
}
