//! Temporal smoothing: surfels move towards the results of earlier frames.
//!
//! Where the points are the same as in the last frame (*steady*), a surfel looks back for its own point. The fits to a
//! point differ by the neighbours seen in each frame, and by noise. So the mean over frames is steadier than each, and
//! nearer to the truth. The fit is kept for one frame, for each point that owns a pixel. A point that owned none has no
//! past of its own. If noise moved its fit, its surfel moves towards the surface seen there in the last frame.
//!
//! Where the points differ, as those of a live scanner do in each frame, all surfels move towards the surface seen at
//! their place (`surfaces.rs`). See docs/decisions/0014-frame-to-frame.md.

pub(crate) mod gpu;
mod points;
mod surfaces;

#[cfg(test)]
pub(crate) use points::Fitted;
pub(crate) use points::{OverTime, STEADY_FRAMES};
