//! The screen-grid engine: exact k nearest neighbours by reading screen cells outwards.
//!
//! # How it works
//! Sixteen consecutive screen points lie close together, so they share a *window*: a rectangle of the screen that
//! contains the projections of all their search spheres. Cells and strips are those of `project`: a cell is one pixel
//! wide and one strip of a few pixels high. So a window is one contiguous run of screen points per strip. The squared
//! distances from all sixteen points to every candidate in the window are computed once. The k-th smallest is found by
//! counting the candidates below a threshold and moving the threshold, sixteen points at a time. A last pass over the
//! window sums the moments of the candidates below the threshold.
//!
//! A *lane* is one of the sixteen points. The lane of point P is finished when the sphere about P projects inside the
//! window, with the distance d_k to the k-th neighbour as radius: no point outside can be nearer. Other lanes get a
//! window for the radius known to suffice. If only σ < k neighbours are known, the radius grows by √(k/σ) as in §5.2.
//! The result is exact, and does not depend on the points that share a block. Only the neighbours of a bounded search
//! depend on what was read.
// Differs from the paper: the paper iterates until 99.9 % of the points are found. See
// docs/decisions/0015-search-engines.md.

mod cpu;
pub(crate) mod gpu;
mod window;

pub(crate) use cpu::search;
