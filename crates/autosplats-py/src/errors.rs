//! Exceptions: the classes are Python's, in `autosplats/_errors.py`; here is which error becomes which.

use std::path::Path;

use autosplats_cloud::ErrorKind;
use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::PyType;

/// An exception class of the package.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    Argument,
    Format,
    Missing,
    Empty,
    Device,
    Memory,
}

impl Class {
    fn name(self) -> &'static str {
        match self {
            Self::Argument => "ArgumentError",
            Self::Format => "FormatError",
            Self::Missing => "MissingFieldError",
            Self::Empty => "EmptyError",
            Self::Device => "DeviceError",
            Self::Memory => "OutOfMemoryError",
        }
    }
}

/// The exception of this class.
pub(crate) fn raise(class: Class, message: String) -> PyErr {
    Python::attach(|py| {
        let found = py.import("autosplats._errors").and_then(|module| module.getattr(class.name()));
        match found.and_then(|class| Ok(class.cast_into::<PyType>()?)) {
            Ok(class) => PyErr::from_type(class, message),
            Err(error) => error,
        }
    })
}

/// An error of the work, as it comes out of the threads.
#[derive(Debug)]
pub(crate) enum Failure {
    Cloud(autosplats_cloud::Error),
    Render(autosplats::Error),
    /// A file cannot be written.
    Io(std::path::PathBuf, std::io::Error),
    /// An exception that is ready.
    Raised(Class, String),
    /// The work was cancelled.
    Cancelled,
    /// A panic, which is a fault of ours.
    Fault(String),
}

impl From<autosplats_cloud::Error> for Failure {
    fn from(error: autosplats_cloud::Error) -> Self {
        Self::Cloud(error)
    }
}

impl From<autosplats::Error> for Failure {
    fn from(error: autosplats::Error) -> Self {
        Self::Render(error)
    }
}

impl Failure {
    /// The exception.
    pub(crate) fn raise(self) -> PyErr {
        match self {
            Self::Cloud(error) => of_cloud(error),
            Self::Render(autosplats::Error::Reading(error)) => of_cloud(error),
            Self::Render(autosplats::Error::MissingAttribute { .. }) => raise(Class::Missing, self.message()),
            Self::Render(autosplats::Error::NothingVisible(_)) => raise(Class::Empty, self.message()),
            Self::Render(ref error) => raise(of_kind(error.kind()), self.message()),
            Self::Io(path, error) => of_system(&path, &error),
            Self::Raised(class, message) => raise(class, message),
            // Whoever cancelled has an exception of its own.
            Self::Cancelled => PyRuntimeError::new_err("cancelled"),
            Self::Fault(message) => PyRuntimeError::new_err(format!("a fault within autosplats: {message}")),
        }
    }

    fn message(&self) -> String {
        match self {
            Self::Render(error) => error.to_string(),
            Self::Cloud(error) => error.to_string(),
            _ => String::new(),
        }
    }
}

fn of_cloud(error: autosplats_cloud::Error) -> PyErr {
    use autosplats_cloud::Error;
    match &error {
        Error::Io { path, source } => of_system(path, source),
        Error::NothingKept { .. } | Error::NoFrames { .. } | Error::NoSurface => raise(Class::Empty, error.to_string()),
        Error::Remote { .. } => PyOSError::new_err(error.to_string()),
        other => raise(of_kind(other.kind()), error.to_string()),
    }
}

fn of_kind(kind: ErrorKind) -> Class {
    match kind {
        ErrorKind::Data | ErrorKind::Unsupported => Class::Format,
        ErrorKind::Memory => Class::Memory,
        ErrorKind::Device => Class::Device,
        _ => Class::Argument,
    }
}

/// An error of the system: Python chooses the class by the number, such as FileNotFoundError.
fn of_system(path: &Path, error: &std::io::Error) -> PyErr {
    use std::io::ErrorKind;
    let text = error.to_string();
    // What follows is the number, or the name of a temporary file, which the caller does not know.
    let end = [" (os error ", " at path "].into_iter().filter_map(|end| text.find(end)).min().unwrap_or(text.len());
    let said = match error.kind() {
        ErrorKind::AlreadyExists => "the file exists; overwrite=True replaces it".into(),
        _ => text[..end].to_owned(),
    };
    let number = error.raw_os_error().or(match error.kind() {
        // An error about a temporary file has no number, but a kind.
        ErrorKind::NotFound => Some(2),
        ErrorKind::PermissionDenied => Some(13),
        ErrorKind::AlreadyExists => Some(17),
        ErrorKind::NotADirectory => Some(20),
        ErrorKind::IsADirectory => Some(21),
        _ => None,
    });
    match number {
        Some(number) => PyOSError::new_err((number, said, path.display().to_string())),
        None => PyOSError::new_err(format!("{}: {said}", path.display())),
    }
}
