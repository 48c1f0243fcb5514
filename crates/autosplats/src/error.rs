//! What a renderer can fail with.

/// Everything that rendering can fail with.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The camera cannot see: its message says why.
    #[error("camera: {0}")]
    Camera(String),
    /// A setting lies outside its range.
    #[error("{name} is {value}, must be {range}")]
    Setting {
        /// Name of the field of [`Settings`](crate::Settings).
        name: &'static str,
        /// Value given.
        value: String,
        /// What is allowed.
        range: &'static str,
    },
    /// More points than a 32-bit index can name.
    #[error("{0} points are more than the 4,294,967,295 that one picture can hold; reduce the cloud first")]
    TooManyPoints(usize),
}
