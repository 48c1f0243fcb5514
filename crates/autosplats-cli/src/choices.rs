//! Options with named values.

use autosplats::Backs;
use clap::ValueEnum;

use crate::values::FirstRadius;

/// Side that normals point to.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum OrientChoice {
    /// To the sensor if the file states it, else up for terrain, else outward
    Auto,
    /// To the sensor; fails if the file does not state it
    Sensor,
    /// Up, along z
    Up,
    /// Away from the middle of the cloud
    Outward,
}

/// Side to look from.
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

/// Up axis of the input.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum AxesChoice {
    Auto,
    /// Z is up: surveys, robots
    ZUp,
    /// Y is up: models
    YUp,
    /// X is up
    XUp,
    /// Z is down
    ZDown,
    /// Y is down: structure from motion
    YDown,
    /// X is down
    XDown,
    /// X right, y down, z forward, seen from the origin: depth cameras
    Camera,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Engine {
    /// Reads buckets of screen points around each point; exact
    ScreenGrid,
    /// The paper's engine, in compute shaders: points splat onto each other's pixels; GPU only, slower
    SplatCommunication,
    /// The same, drawn by the raster pipeline as in the paper; slow on cards for data centres
    SplatCommunicationRaster,
    /// The paper's baseline: a kd-tree over all points, rebuilt in each frame; GPU only, see --first-radius
    KdTree,
}

impl Engine {
    /// Name of the engine on the command line.
    pub(crate) fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// The library's engine. `first_radius` is the first search radius of the kd-tree.
    pub(crate) fn with_first_radius(self, first_radius: FirstRadius) -> autosplats::SearchEngine {
        match self {
            Self::ScreenGrid => autosplats::SearchEngine::ScreenGrid,
            Self::SplatCommunication => autosplats::SearchEngine::SplatCommunication,
            Self::SplatCommunicationRaster => autosplats::SearchEngine::SplatCommunicationRaster,
            Self::KdTree => autosplats::SearchEngine::KdTree { first_radius: first_radius.unless_best() },
        }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Backend {
    /// A hardware GPU if there is one, else the CPU
    Auto,
    /// All CPU cores; needs no driver
    Cpu,
    /// The best device of Vulkan, Metal or DirectX 12, even a software renderer on the CPU, which is slower than 'cpu'
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

/// Look of the backs of surfaces.
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
