//! Report of a rendered picture: JSON for programs, one line for people.

use std::path::PathBuf;

use autosplats::{Camera, Counts, Frame, PassTime, Timings};
use autosplats_cloud::{Axes, own_memory};
use serde::Serialize;

use super::job::Job;
use crate::device::Device;

/// The object that `--json` prints.
#[derive(Debug, Serialize)]
pub(super) struct Report<'a> {
    version: &'static str,
    size: [u32; 2],
    /// Factor on both sides of the picture that counts and times refer to.
    supersample: u32,
    counts: Counts,
    device: &'a Device,
    axes: &'static str,
    camera: Camera,
    outputs: Vec<Written>,
    /// What was read of octrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    tree: Option<TreeReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    memory: Option<MemoryReport>,
    timings_ms: PrintedTimings,
    /// Times of the passes of a graphics device.
    passes: Vec<PassTime>,
}

/// What was read of octrees for a picture.
#[derive(Clone, Debug, Serialize)]
pub(super) struct TreeReport {
    /// Number of points that all nodes have.
    pub(super) stored_points: u64,
    /// Number of nodes that the picture is made of.
    pub(super) nodes: usize,
    /// Number of their points.
    pub(super) points: u64,
    /// Number of nodes that were read for this picture, and of their points. The others were there.
    pub(super) read_nodes: usize,
    pub(super) read_points: u64,
    /// Bytes read so far, and in how many requests.
    pub(super) bytes: u64,
    pub(super) requests: u64,
    /// Largest distance in pixels between neighbouring points to which finer ones exist.
    pub(super) spacing_px: f64,
    /// Milliseconds from the first byte read until all points were there.
    pub(super) complete_ms: f64,
}

/// Memory of the program in bytes, if the system states it.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct MemoryReport {
    /// At the end of the picture.
    resident: u64,
    /// At most so far.
    peak: u64,
}

impl MemoryReport {
    pub(super) fn now() -> Option<Self> {
        own_memory().map(|[resident, peak]| Self { resident, peak })
    }
}

#[derive(Debug, Serialize)]
struct PrintedTimings {
    read: f64,
    #[serde(flatten)]
    stages: Timings,
    write: f64,
}

#[derive(Debug, Serialize)]
struct Written {
    path: PathBuf,
    bytes: u64,
}

impl<'a> Report<'a> {
    /// Collects the facts after everything is written.
    pub(super) fn new(
        job: &Job,
        device: &'a Device,
        camera: Camera,
        axes: Axes,
        frame: &Frame<'_>,
        written: Vec<(PathBuf, u64)>,
        [read, write]: [f64; 2],
    ) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            size: job.size,
            supersample: job.supersample,
            counts: frame.counts,
            device,
            axes: axes.name(),
            camera,
            outputs: written.into_iter().map(|(path, bytes)| Written { path, bytes }).collect(),
            tree: None,
            memory: MemoryReport::now(),
            timings_ms: PrintedTimings { read, stages: frame.timings, write },
            passes: frame.passes.to_vec(),
        }
    }

    /// Adds what was read of octrees.
    pub(super) fn with_tree(self, tree: Option<TreeReport>) -> Self {
        Self { tree, ..self }
    }

    /// The summary for people.
    pub(super) fn summary(&self) -> String {
        let names: Vec<_> = self.outputs.iter().map(|written| written.path.display().to_string()).collect();
        let PrintedTimings { read, stages, write } = &self.timings_ms;
        let of = self.tree.as_ref().map_or_else(String::new, |tree| format!(" of {}", tree.stored_points));
        format!(
            "{}: {} points{of}, {} visible; read {read:.0} ms, frame {:.0} ms, write {write:.0} ms",
            names.join(", "),
            self.counts.points,
            self.counts.visible,
            stages.frame
        )
    }
}
