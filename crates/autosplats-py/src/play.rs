//! Points that move: recordings, sequences, animations and live streams.

use std::sync::Mutex;
use std::time::Duration;

use autosplats_sources::{LatestOptions, PlayOptions, Player, Source, Timeline};
use pyo3::prelude::*;

use crate::cloud::Cloud;
use crate::errors::{self, Class, Failure};
use crate::read::Reading;
use crate::wait::run;

/// Longest wait for a live stream before it is asked again.
const PATIENCE: Duration = Duration::from_millis(100);

/// A source that is played.
#[pyclass(frozen, module = "autosplats._core")]
pub(crate) struct Recording {
    player: Mutex<Player>,
    /// Times of the frames in nanoseconds; None for a live stream.
    stamps: Option<Vec<i64>>,
}

/// Options of playing, as Python hands them over.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Playing {
    fps: Option<f64>,
    topics: Vec<String>,
    frame: Option<String>,
    sample: Option<usize>,
    scanners: Option<usize>,
    /// Seconds.
    decay: Option<f64>,
    accumulate: bool,
}

impl Playing {
    fn options(self) -> PyResult<PlayOptions> {
        let Self { fps, topics, frame, sample, scanners, decay, accumulate } = self;
        let decay = decay.map(Duration::try_from_secs_f64).transpose();
        let decay = decay.map_err(|error| errors::raise(Class::Argument, format!("decay: {error}")))?;
        let latest = LatestOptions { decay, accumulate, ..LatestOptions::default() };
        Ok(PlayOptions { fps, topics, frame, sample, scanners, all: true, latest, ..PlayOptions::default() })
    }
}

#[pymethods]
impl Recording {
    #[new]
    fn new(
        py: Python<'_>,
        name: &str,
        playing: Playing,
        reading: Reading,
        threads: Option<usize>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (play, read) = (playing.options()?, reading.options()?);
        let player = run(py, threads, progress, |watch| Ok(Source::parse(name)?.play(&play, &read, watch)?))?;
        let stamps = player.stream().timeline().map(|timeline: &Timeline| timeline.stamps().to_vec());
        Ok(Self { player: Mutex::new(player), stamps })
    }

    /// Times of the frames in nanoseconds; None for a live stream.
    #[getter]
    fn stamps(&self) -> Option<Vec<i64>> {
        self.stamps.clone()
    }

    /// The points at a frame.
    fn frame(&self, py: Python<'_>, frame: usize, threads: Option<usize>) -> PyResult<Cloud> {
        let cloud = run(py, threads, None, |watch| {
            Ok(self.player.lock().unwrap_or_else(|broken| broken.into_inner()).frame(frame, watch)?)
        })?;
        Ok(Cloud { cloud, camera: None })
    }

    /// The points after the next update of a live stream; None when it has ended.
    fn next(&self, py: Python<'_>) -> PyResult<Option<Cloud>> {
        let cloud = run(py, None, None, |watch| {
            let mut player = self.player.lock().unwrap_or_else(|broken| broken.into_inner());
            while watch.goes_on() {
                match player.next(PATIENCE, watch) {
                    Ok(Some(cloud)) => return Ok(Some(cloud)),
                    Ok(None) => {}
                    Err(autosplats_cloud::Error::NoFrames { .. }) => return Ok(None),
                    Err(error) => return Err(error.into()),
                }
            }
            Err(Failure::Cancelled)
        })?;
        Ok(cloud.map(|cloud| Cloud { cloud, camera: None }))
    }
}
