//! Kinds of errors, shared by all crates.

/// What went wrong, as far as a caller needs it to choose an exit code or an exception.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Error, ErrorKind};
///
/// let error = Error::malformed("scan.ply".as_ref(), "line 3", "'abc' is not a number");
/// assert_eq!(error.kind(), ErrorKind::Data);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// A value or a name that the caller gave is out of its range or unknown.
    Argument,
    /// A file does not exist.
    NotFound,
    /// The system refused to open, read or write a file, or nobody answers at an address.
    Io,
    /// Data is malformed, empty or contradictory.
    Data,
    /// Data is valid, but cannot be handled.
    Unsupported,
    /// The memory of the machine or of its graphics device does not suffice.
    Memory,
    /// No device can do what is needed, or the device failed.
    Device,
    /// The caller asked to stop.
    Cancelled,
}

impl From<&std::io::Error> for ErrorKind {
    fn from(error: &std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::NotFound => Self::NotFound,
            std::io::ErrorKind::OutOfMemory => Self::Memory,
            _ => Self::Io,
        }
    }
}
