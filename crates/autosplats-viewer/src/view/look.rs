//! How points are shown: changed in the look panel, kept between starts.

use autosplats::{Backend, Settings};
use serde::{Deserialize, Serialize};

/// Time limit of a picture while the view moves, milliseconds: 30 pictures a second.
const MOVING_MS: f64 = 1000.0 / 30.0;

/// Everything about the picture except its content and its camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Look {
    pub(crate) settings: Settings,
    /// Whether to draw points as dots instead of the surface.
    pub(crate) dots: bool,
    /// Width of a dot, pixels.
    pub(crate) dot_size: u32,
    pub(crate) backend: Backend,
    /// Time limit of a picture while the view moves, milliseconds. A larger limit is sharper and less smooth.
    pub(crate) moving_ms: f64,
    /// What a two-finger drag on a touchpad does.
    pub(crate) two_fingers: TwoFingers,
    /// Whether to draw the axes and the scale bar over the picture.
    pub(crate) overlay: bool,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            settings: Settings::default(),
            dots: false,
            dot_size: 2,
            backend: Backend::Auto,
            moving_ms: MOVING_MS,
            two_fingers: TwoFingers::default(),
            overlay: true,
        }
    }
}

/// What a two-finger drag on a touchpad does. A pinch always zooms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum TwoFingers {
    /// Zooms, as a wheel does.
    #[default]
    Zoom,
    /// Turns the view.
    Orbit,
    /// Moves the view sideways.
    Pan,
}
