//! Point clouds: the files they are read from and written to, and the sources that make them.
//!
//! This crate turns bytes into a [`PointCloud`]. It draws nothing and uses no GPU.
//!
//! ```
//! use autosplats_cloud::{PointCloud, write};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let path = |name| folder.path().join(name);
//! std::fs::write(path("survey.csv"), "x,y,z,Intensity\n512000.5,5400000.25,310.0,7\n")?;
//! let cloud = PointCloud::from_path(path("survey.csv"), &())?;
//! assert_eq!(cloud.world_position(0).y, 5_400_000.25);
//! write(&cloud, &path("survey.ply"), &())?;
//! # Ok(())
//! # }
//! ```

mod cloud;
mod crs;
mod error;
mod geographic;
mod identity;
mod las;
mod memory;
mod merge;
mod moved;
mod progress;
mod random;
mod read;
mod retain;
mod sample;
mod source;
mod thin;
mod write;

pub use cloud::{Axes, Field, FieldValues, PointCloud, Scan};
pub use crs::{Crs, GeoKeys, Unit};
pub use error::Error;
pub use geographic::LocalMetres;
/// Vector library of the public interface.
pub use glam;
pub use memory::{available_memory, check_memory};
pub use progress::Progress;
pub use read::{
    Attribute, Contents, DepthCamera, Description, ReadOptions, describe, describe_bytes, formats, read, read_bytes,
    read_mesh, read_mesh_bytes, read_with,
};
pub use sample::sample_surface;
#[cfg(feature = "zenoh")]
pub use source::remote;
pub use source::{
    PlayOptions, Source,
    align::beginnings,
    animation::{Animation, Playback},
    latest::{Arrival, Latest, LatestOptions, LatestStatistics},
    live::{Live, LiveOptions},
    player::Player,
    point_cloud2,
    recording::{Recording, RecordingOptions, RecordingSummary, RecordingTopic, describe_recording, is_recording},
    scanner::Scanner,
    scene::{Hit, Scene, View, parse_count},
    stream::{Next, Statistics, Stream, Timeline, Update},
};
pub use write::{check_writable, write, written_formats};
