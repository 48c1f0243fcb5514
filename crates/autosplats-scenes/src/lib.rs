//! Generated worlds: scenes with an exact surface, and scanners that see them.
//!
//! Scenes know neither files nor streams, so that tests of pictures need no reader.
//!
//! ```
//! use autosplats_scenes::Scene;
//!
//! let (scene, count) = Scene::parse("statue:5K")?;
//! assert_eq!(scene.sample(count, &())?.len(), 5000);
//! # Ok::<(), autosplats_cloud::Error>(())
//! ```

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic where the stream cannot be written")]

mod scanner;
mod scene;
mod surface;

pub use scanner::{Scanner, Scanners};
pub use scene::{Hit, SCENE_PREFIX, Sampler, Scene, View, parse_count};
pub use surface::Surface;
