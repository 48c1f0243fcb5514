//! How the points are shown: what the look panel changes and settings keep between starts.

use autosplats::{Backend, Settings};
use serde::{Deserialize, Serialize};

/// Milliseconds a picture may take while the eye moves: 30 a second.
const MOVING_MS: f64 = 1000.0 / 30.0;

/// Everything about the picture but what is in it and where it is seen from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Look {
    /// What the renderer is asked for.
    pub(crate) settings: Settings,
    /// Points as dots in place of the surface.
    pub(crate) dots: bool,
    /// Width of a dot in pixels.
    pub(crate) dot_size: u32,
    /// Where pictures are made.
    pub(crate) backend: Backend,
    /// Milliseconds a picture may take while the eye moves; larger is sharper and less smooth.
    pub(crate) moving_ms: f64,
    /// What two fingers do that are drawn over a touchpad.
    pub(crate) two_fingers: TwoFingers,
    /// The little axes, the scale bar and the figures over the picture.
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

/// What two fingers do that are drawn over a touchpad; pinched they zoom in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum TwoFingers {
    /// As a wheel does.
    #[default]
    Zoom,
    /// They turn the view.
    Orbit,
    /// They move it sideways.
    Pan,
}
