//! Temporal smoothing: surfels drawn towards what the frames before found.
//!
//! Where the points are the same as in the last frame (*steady*), a surfel looks back for the very point that it stands for. What
//! was fitted to it then and what is fitted now differ by which points around it were seen, and by noise: the mean over frames
//! is steadier than each, and nearer to the truth. It is kept about each point that owns a pixel, for one frame. A point that
//! owned none then has no past of its own; where its fit was moved by noise it is drawn towards the surface seen there.
//!
//! Where the points are others, as a live scanner measures them anew for each frame, all surfels are drawn towards the surface
//! seen at their place (`surfaces.rs`).

pub(crate) mod gpu;
mod points;
mod surfaces;

#[cfg(test)]
pub(crate) use points::Fitted;
pub(crate) use points::{OverTime, STEADY_FRAMES};
