//! Point clouds, the files they come from and the sources that make them.
//!
//! This crate never sees a GPU and never draws: it turns bytes into a [`PointCloud`].

mod cloud;
mod error;
mod source;

pub use cloud::{Axes, Field, FieldValues, PointCloud};
pub use error::Error;
/// The vector library of the public interface.
pub use glam;
pub use source::scene::{Hit, Scene, View};
