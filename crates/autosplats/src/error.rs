//! What rendering and estimating normals can fail with.

/// Everything that rendering and estimating normals can fail with.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The camera cannot see: its message says why.
    #[error("camera: {0}")]
    Camera(String),
    /// A setting lies outside its range.
    #[error("{name} is {value}, must be {range}")]
    Setting {
        /// Name of the field of [`Settings`](crate::Settings) or [`NormalSettings`](crate::NormalSettings).
        name: &'static str,
        /// Value given.
        value: String,
        /// What is allowed.
        range: &'static str,
    },
    /// The image has no pixels or too many.
    #[error("image size {width}x{height}: each side must be within 1 to {}", crate::MAX_SIDE)]
    ImageSize {
        /// Width asked for.
        width: u32,
        /// Height asked for.
        height: u32,
    },
    /// More points than a 32-bit index can name.
    #[error("{0} points are more than the 4,294,967,295 that can be numbered; reduce the cloud first")]
    TooManyPoints(usize),
    /// The colour mode needs an attribute that the cloud lacks.
    #[error("the cloud has no {name}; it has {has}")]
    MissingAttribute {
        /// What was asked for.
        name: String,
        /// What there is instead.
        has: String,
    },
    /// A layer to be shaded has not one value for each pixel, tile by tile.
    #[error("the {layer} layer has {values} values, not {wanted}; GBuffer::new sizes layers")]
    Layers {
        /// Which.
        layer: &'static str,
        /// Values that it has.
        values: usize,
        /// Values that it has to have.
        wanted: usize,
    },
    /// No surface would be seen: its message says why.
    #[error("nothing to show: {0}")]
    NothingVisible(String),
    /// There is no GPU to render on, or it cannot do what is needed: its message says why.
    #[error("GPU: {0}")]
    Device(String),
    /// The GPU binds no buffer as large as the frame needs.
    #[error(
        "GPU: {what} takes {needed} bytes, the device allows {allowed}; use a smaller picture or cloud, or the CPU backend"
    )]
    DeviceLimit {
        /// What the buffer holds.
        what: &'static str,
        /// Bytes it takes.
        needed: u64,
        /// Bytes the device allows.
        allowed: u64,
    },
    /// The GPU has no memory left for so many bytes, where the number is known.
    #[error("GPU: out of memory{}; use a smaller picture or cloud, or the CPU backend",
        .0.map(|bytes| format!(" for {bytes} bytes")).unwrap_or_default())]
    DeviceMemory(Option<u64>),
    /// The GPU stopped working, by its driver's message; a new renderer may find it working again.
    #[error("GPU: the device was lost: {0}; make a new renderer, or use the CPU backend")]
    DeviceLost(String),
    /// Normals given for a cloud do not belong to it.
    #[error("normals, curvatures and radii must be one of each per point: {given} {what} for {points} points")]
    Normals {
        /// What there are too few or too many of: normals, curvatures or radii.
        what: &'static str,
        /// How many of them were given.
        given: usize,
        /// Points of the cloud.
        points: usize,
    },
    /// The texture to render into is none that it can: its message says why.
    #[error("texture to render into: {0}")]
    Texture(String),
    /// [`Progress::cancelled`](autosplats_cloud::Progress::cancelled) asked to stop.
    #[error("cancelled")]
    Cancelled,
}
