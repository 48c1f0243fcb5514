//! What a render says when it is done: JSON for machines, one line for people.

use std::path::PathBuf;

use autosplats::{Camera, Counts, Frame, PassTime, Timings};
use autosplats_cloud::Axes;
use serde::Serialize;

use super::job::Job;
use crate::device::Device;
use crate::exit::{Exit, Failure};

/// Everything `--json` prints.
#[derive(Debug, Serialize)]
pub(super) struct Report<'a> {
    version: &'static str,
    size: [u32; 2],
    /// How many times as wide and high the picture is that counts and times are of.
    supersample: u32,
    counts: Counts,
    device: &'a Device,
    axes: &'static str,
    camera: Camera,
    outputs: Vec<Written>,
    timings_ms: PrintedTimings,
    /// Of a graphics device.
    passes: Vec<PassTime>,
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
    /// Gathers what is known when everything is written.
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
            axes: match axes {
                Axes::ZUp => "z-up",
                Axes::YUp => "y-up",
                Axes::Camera => "camera",
            },
            camera,
            outputs: written.into_iter().map(|(path, bytes)| Written { path, bytes }).collect(),
            timings_ms: PrintedTimings { read, stages: frame.timings, write },
            passes: frame.passes.to_vec(),
        }
    }

    /// One line of JSON.
    pub(super) fn to_json(&self) -> Result<String, Failure> {
        // A path that is not UTF-8 is all that can fail here.
        serde_json::to_string(self).map_err(|error| Failure::new(Exit::Output, format!("--json: {error}")))
    }

    /// One line on standard error.
    pub(super) fn summarize(&self) {
        let names: Vec<_> = self.outputs.iter().map(|written| written.path.display().to_string()).collect();
        let PrintedTimings { read, stages, write } = &self.timings_ms;
        eprintln!(
            "{}: {} points, {} visible; read {read:.0} ms, frame {:.0} ms, write {write:.0} ms",
            names.join(", "),
            self.counts.points,
            self.counts.visible,
            stages.frame
        );
    }
}
