//! The screen-grid engine: exact k nearest neighbours by reading screen cells outwards.
//!
//! # How it works
//! Sixteen consecutive screen points lie close together, so they share a *window*: a rectangle of the screen that
//! contains the projections of all their search spheres. A window is one contiguous run of screen points per strip.
//! The squared distances from all sixteen points to every candidate in the window are computed once. The k-th smallest
//! is found by counting the candidates below a threshold and moving the threshold, sixteen points at a time. A last
//! pass over the window sums the moments of the candidates below the threshold.
//!
//! A lane is finished when the projection of the sphere (P, d_k) lies inside the window: no point outside can be
//! nearer. Other lanes get a window for the radius known to suffice. With too few candidates the radius grows by
//! √(k/σ) as in §5.2. The result is exact, and does not depend on the points that share a block. Only the neighbours
//! of a bounded search depend on what was read.

mod cpu;
pub(crate) mod gpu;
mod window;

pub(crate) use cpu::search;
