//! A frame, one line per stage.

mod cpu;
mod settings;

pub use cpu::{Frame, Renderer};
pub use settings::{Reconstruction, Settings};

/// Longest side of an image in pixels.
pub const MAX_SIDE: u32 = 16_384;

/// What became of the points of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counts {
    /// Points in the cloud.
    pub points: usize,
    /// Points that cannot be seen: the sum of the next three.
    pub dropped: usize,
    /// Points with a coordinate that is NaN or infinite.
    pub not_finite: usize,
    /// Points at or behind the eye.
    pub behind: usize,
    /// Points outside the picture.
    pub outside: usize,
    /// Points that own a pixel, the nearest one there; the rest are hidden behind them.
    pub visible: usize,
    /// Visible points reconstructed in the first pass.
    pub active: usize,
    /// Visible points that grid culling put back.
    pub passive: usize,
    /// Passive points that turned out not to be hidden and were reconstructed in the second pass.
    pub recovered: usize,
    /// Points discarded because they have no neighbour.
    pub outliers: usize,
    /// Points that kept fewer than k neighbours, because of a gap or of the bound on search work.
    pub clamped: usize,
    /// Points whose search met the bound on its work.
    pub bounded: usize,
}

/// Milliseconds spent in each stage of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[allow(missing_docs, reason = "one field per stage")]
pub struct Timings {
    pub project: f64,
    pub search: f64,
    pub fit: f64,
    pub splat: f64,
    pub shade: f64,
    /// From the first stage's start to the last one's end.
    pub frame: f64,
}
