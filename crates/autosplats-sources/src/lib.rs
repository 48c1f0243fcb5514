//! Sources of points: files, sequences, recordings, live streams and generated scenes, each played in the same way.
//!
//! ```
//! use autosplats_formats::ReadOptions;
//! use autosplats_sources::{PlayOptions, Source};
//!
//! let source = Source::parse("scene:figure:2K")?;
//! let mut player = source.play(&PlayOptions::default(), &ReadOptions::default(), &())?;
//! assert_eq!(player.frame(3, &())?.len(), 2000);
//! # Ok::<(), autosplats_cloud::Error>(())
//! ```

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic where the stream cannot be written")]

mod address;
mod align;
mod animation;
mod clock;
mod input;
mod latest;
mod listing;
mod live;
mod player;
pub mod point_cloud2;
mod recording;
#[cfg(feature = "zenoh")]
pub mod remote;
mod source;
mod stream;
#[cfg_attr(not(feature = "zenoh"), allow(dead_code, reason = "only Zenoh receives live transforms"))]
mod transforms;
mod wire;

pub use address::{MIN_TREE_POINTS, read_tree};
pub use align::beginnings;
pub use animation::{Animation, Playback};
pub use input::Input;
pub use latest::{Arrival, Latest, LatestOptions, LatestStatistics};
pub use live::{Live, LiveOptions};
pub use player::Player;
pub use recording::{Recording, RecordingOptions, RecordingSummary, RecordingTopic, describe_recording, is_recording};
pub use source::{PlayOptions, Source};
pub use stream::{Next, Statistics, Stream, Timeline, Update};
