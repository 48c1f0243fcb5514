//! Raw points in, a lit surface out, every frame.

mod camera;
mod error;

pub use autosplats_cloud as cloud;
pub use camera::{Camera, Projection};
pub use error::Error;
