//! Errors of rendering and of normal estimation.

use autosplats_cloud::ErrorKind;

/// Longest allowed side of an image in pixels.
pub const MAX_SIDE: u32 = 16_384;

/// Error of rendering or of normal estimation.
///
/// # Examples
///
/// ```
/// use autosplats::{Error, Settings};
///
/// let mut settings = Settings::default();
/// settings.reconstruction.k = 100;
/// let Err(error) = settings.check() else { panic!("k is at most 64") };
/// assert!(matches!(error, Error::Setting { name: "k", .. }));
/// assert_eq!(error.to_string(), "k is 100, must be within 1 to 64");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The camera is unusable. The message names the invalid value.
    #[error("camera: {0}")]
    Camera(String),
    /// A setting is outside its range.
    #[error("{name} is {value}, must be {range}")]
    Setting {
        /// Field of [`Settings`](crate::Settings) or [`NormalSettings`](crate::NormalSettings), or of a struct in it.
        name: &'static str,
        /// The invalid value.
        value: String,
        /// The valid range.
        range: &'static str,
    },
    /// The text is no background.
    #[error("'{0}' must be a CSS colour such as white, '#rrggbb', TOP,BOTTOM or transparent")]
    Background(String),
    /// A side of the image is 0 or longer than [`MAX_SIDE`].
    #[error("image size {width}x{height}: each side must be within 1 to {MAX_SIDE}")]
    ImageSize {
        /// Requested width in pixels.
        width: u32,
        /// Requested height in pixels.
        height: u32,
    },
    /// The cloud has too many points for 32-bit indices; the value is their number.
    #[error("{0} points are too many, the limit is 4,294,967,294; reduce the cloud first")]
    TooManyPoints(usize),
    /// The colour mode needs an attribute that the cloud does not have.
    #[error("the cloud has no {name}; it has {has}")]
    MissingAttribute {
        /// The attribute.
        name: String,
        /// The attributes that the cloud has.
        has: String,
    },
    /// A layer to be shaded does not have one value per pixel of its tiles.
    #[error("the {layer} layer has {values} values, must have {wanted}; create layers with GBuffer::new")]
    Layers {
        /// Name of the layer.
        layer: &'static str,
        /// Number of values in the layer.
        values: usize,
        /// Required number of values.
        wanted: usize,
    },
    /// No surface would be visible. The message says why.
    #[error("nothing to show: {0}")]
    NothingVisible(String),
    /// No GPU is available, or the device cannot do what is needed. The message says why.
    #[error("GPU: {0}")]
    Device(String),
    /// The frame needs a larger buffer than the GPU can bind.
    #[error(
        "GPU: {what} takes {needed} bytes, the device allows {allowed}; use a smaller picture or cloud, or the CPU backend"
    )]
    DeviceLimit {
        /// Content of the buffer.
        what: &'static str,
        /// Required size in bytes.
        needed: u64,
        /// Largest size in bytes that the device allows.
        allowed: u64,
    },
    /// The GPU is out of memory. The value is the size of the failed allocation in bytes, if known.
    #[error("GPU: out of memory{}; use a smaller picture or cloud, or the CPU backend",
        .0.map(|bytes| format!(" for {bytes} bytes")).unwrap_or_default())]
    DeviceMemory(Option<u64>),
    /// The GPU stopped working; the value is the driver's message. A new renderer may work again.
    #[error("GPU: the device was lost: {0}; make a new renderer, or use the CPU backend")]
    DeviceLost(String),
    /// Normals, curvatures or radii given with a cloud do not match its number of points.
    #[error("{given} {what} for {points} points: there must be one normal, curvature and radius per point")]
    Normals {
        /// The list of the wrong length: normals, curvatures or radii.
        what: &'static str,
        /// Number of values in the list.
        given: usize,
        /// Number of points in the cloud.
        points: usize,
    },
    /// The target texture is unsuitable. The message says why.
    #[error("target texture: {0}")]
    Texture(String),
    /// A tree cannot be read.
    #[error(transparent)]
    Reading(autosplats_cloud::Error),
    /// [`Progress::cancelled`](autosplats_cloud::Progress::cancelled) or a callback asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl From<autosplats_cloud::Error> for Error {
    fn from(error: autosplats_cloud::Error) -> Self {
        match error {
            autosplats_cloud::Error::Cancelled => Self::Cancelled,
            error => Self::Reading(error),
        }
    }
}

impl Error {
    /// The kind of this error.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Camera(_)
            | Self::Setting { .. }
            | Self::Background(_)
            | Self::ImageSize { .. }
            | Self::MissingAttribute { .. } => ErrorKind::Argument,
            Self::Layers { .. } | Self::NothingVisible(_) | Self::Normals { .. } => ErrorKind::Data,
            Self::TooManyPoints(_) | Self::DeviceLimit { .. } | Self::DeviceMemory(_) => ErrorKind::Memory,
            Self::Device(_) | Self::DeviceLost(_) | Self::Texture(_) => ErrorKind::Device,
            Self::Reading(error) => error.kind(),
            Self::Cancelled => ErrorKind::Cancelled,
        }
    }
}
