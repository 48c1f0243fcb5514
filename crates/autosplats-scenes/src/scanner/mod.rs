//! Simulated scanners around a moving surface, like the three in the paper [Paper, Figure 12].
//!
//! # How it works
//!
//! In each frame every scanner sends out rays at equal steps of azimuth and elevation (`rays`). Each ray ends at the
//! first surface on its way (`target`), so surfaces hidden from a scanner are missing. Most rays hit nothing.
//! Therefore triangles and parts of a scene look up the rays that may hit them, instead of each ray searching the
//! surface. Ranges get noise, some rays return nothing, and points are placed with the scanner's assumed pose, which
//! may differ from the true one. Random numbers depend only on the seed, the frame, the scanner and the ray, so threads
//! change nothing.

mod device;
mod rays;
mod scanners;
mod target;
mod triangles;

pub use self::{device::Scanner, scanners::Scanners};
