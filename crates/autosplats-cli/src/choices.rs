//! The names that options take.

use autosplats::Backs;
use clap::ValueEnum;

use crate::first_radius::FirstRadius;

/// Which way normals point.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum OrientChoice {
    /// To the sensor where the file tells its place, else upward for land, else outward
    Auto,
    /// To the sensor
    Sensor,
    /// Upward, along z
    Up,
    /// Away from the middle
    Outward,
}

/// Where to look from.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Side {
    Iso,
    Front,
    Back,
    Left,
    Right,
    Top,
    Bottom,
}

/// Which way is up.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum AxesChoice {
    Auto,
    /// Surveys, robots
    ZUp,
    /// Models
    YUp,
    /// X right, y down, z forward, seen from the origin: depth cameras
    Camera,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Engine {
    /// Buckets of screen points, exact
    ScreenGrid,
    /// The paper's own: points draw splats onto each other's pixels; on a GPU only, slower
    SplatCommunication,
    /// The paper's rival: a kd-tree over all points, built anew in each frame; on a GPU only, see --first-radius
    KdTree,
}

impl Engine {
    /// As it is asked for.
    pub(crate) fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// The engine that it names; `first_radius` is what the kd-tree begins with.
    pub(crate) fn with_first_radius(self, first_radius: FirstRadius) -> autosplats::SearchEngine {
        match self {
            Self::ScreenGrid => autosplats::SearchEngine::ScreenGrid,
            Self::SplatCommunication => autosplats::SearchEngine::SplatCommunication,
            Self::KdTree => autosplats::SearchEngine::KdTree { first_radius: first_radius.unless_best() },
        }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Backend {
    /// A hardware GPU where there is one, else the CPU
    Auto,
    /// All cores; needs no driver
    Cpu,
    /// The best device that Vulkan, Metal or DirectX 12 has; also one that is a program on the CPU, which is slower than
    /// 'cpu'
    Gpu,
}

impl From<Backend> for autosplats::Backend {
    fn from(backend: Backend) -> Self {
        match backend {
            Backend::Auto => Self::Auto,
            Backend::Cpu => Self::Cpu,
            Backend::Gpu => Self::Gpu,
        }
    }
}

/// How the backs of surfaces are shown.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum BacksChoice {
    /// Darker and with less colour
    Toned,
    /// Like the front
    Same,
}

impl From<BacksChoice> for Backs {
    fn from(choice: BacksChoice) -> Self {
        match choice {
            BacksChoice::Toned => Self::Toned,
            BacksChoice::Same => Self::Same,
        }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Map {
    Viridis,
    Inferno,
    Turbo,
    Gray,
    Reds,
}
