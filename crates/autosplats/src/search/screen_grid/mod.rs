//! The screen-grid engine: exact k nearest neighbours by reading screen cells outwards.
//!
//! # How it works
//! Sixteen consecutive screen points lie close together, so they share a *window*: a rectangle of the screen that contains
//! the projected bounds of all their search spheres. A window is one contiguous run of screen points per strip. Squared
//! distances from all sixteen to every candidate in the window are computed once, sixteen at a time; the k-th smallest is
//! found by counting how many lie below a threshold and moving the threshold, again sixteen at a time; a last pass over
//! the window sums the moments of the candidates below it.
//!
//! A lane is finished when the projected bound of the sphere (P, d_k) lies inside the window: then no point outside can be
//! nearer. The others get a window for the radius now known to suffice, or, with too few candidates, for one grown by
//! √(k/σ) as in §5.2. So the result is exact, and the same whichever points happened to share a block; only where the bound
//! on search work ends a search, what is kept depends on what happened to be read.

mod cpu;
pub(crate) mod gpu;
mod window;

pub(crate) use cpu::search;
