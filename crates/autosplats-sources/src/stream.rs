//! Streams of points: what sequences, recordings, live connections and simulated scanners have in common.

use std::{sync::Arc, time::Duration};

use autosplats_cloud::{Error, PointCloud, Progress};

/// Points that change over time, one update after the other.
///
/// There are two kinds of streams. A stream with a [timeline](Self::timeline) knows all its frames, can seek to each of
/// them, and gives the same points for a frame each time. A live stream gives updates as they arrive. Updates that
/// nobody takes in time are replaced by newer ones and counted, unless the stream is set to keep all.
///
/// ```
/// use std::{sync::Arc, time::Duration};
///
/// use autosplats_cloud::{Error, PointCloud, Progress, glam::DVec3};
/// use autosplats_sources::{LatestOptions, Next, Player, Statistics, Stream, Timeline, Update};
///
/// /// A sensor that sees one more point each time.
/// #[derive(Default)]
/// struct Sensor {
///     count: usize,
/// }
///
/// impl Stream for Sensor {
///     fn timeline(&self) -> Option<&Timeline> {
///         None
///     }
///
///     fn seek(&mut self, _frame: usize) {}
///
///     fn next(&mut self, _patience: Duration, _progress: &dyn Progress) -> Result<Next, Error> {
///         self.count += 1;
///         let cloud = PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; self.count]);
///         let stamp = self.count as i64;
///         Ok(Next::Update(Update { channel: 0, stamp, cloud: Arc::new(cloud) }))
///     }
///
///     fn statistics(&self) -> Statistics {
///         Statistics { taken: self.count as u64, ..Statistics::default() }
///     }
/// }
///
/// let mut player = Player::new(Box::new(Sensor::default()), LatestOptions::default());
/// player.next(Duration::ZERO, &())?;
/// let cloud = player.next(Duration::ZERO, &())?;
/// assert_eq!(cloud.map(|cloud| cloud.len()), Some(2));
/// # Ok::<(), Error>(())
/// ```
pub trait Stream: Send {
    /// The times of all frames; `None` for a live stream.
    fn timeline(&self) -> Option<&Timeline>;

    /// The frames that together are visible at the time of `frame`, in order: the newest of each channel. If every
    /// frame has updates of all channels, this is only `frame`.
    fn seen_at(&self, frame: usize) -> Vec<usize> {
        vec![frame]
    }

    /// Number of updates per frame of the timeline. Larger than 1 only for several simulated scanners.
    fn updates_per_frame(&self) -> usize {
        1
    }

    /// Makes `frame` the [next](Self::next) one, without reading it. Beyond the last frame, `next` returns
    /// [`Next::End`]. Live streams ignore the call.
    fn seek(&mut self, frame: usize);

    /// The next update. A live stream waits up to `patience`. A stream with a timeline takes the time needed for
    /// reading, with reports to `progress`, which may cancel it.
    ///
    /// # Errors
    /// Those of reading. After an error the stream continues with the update that follows.
    fn next(&mut self, patience: Duration, progress: &dyn Progress) -> Result<Next, Error>;

    /// Counts of the outcomes of updates so far.
    fn statistics(&self) -> Statistics;

    /// Bytes of updates that have arrived so far, complete or not. Growth tells a caller that waits for the first
    /// update that data are on their way. 0 if the stream does not count them.
    fn received(&self) -> u64 {
        0
    }
}

/// Result of [`Stream::next`].
#[derive(Clone, Debug, PartialEq)]
pub enum Next {
    /// New points.
    Update(Update),
    /// Nothing arrived in time; more may follow.
    Nothing,
    /// The end: no update follows unless the caller seeks to an earlier frame.
    End,
}

/// The points of one sensor at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Update {
    /// Number of the sensor within the stream, from 0. An update replaces the previous one of its channel only.
    pub channel: usize,
    /// Time of measurement in nanoseconds: since 1970 for recordings, since the start for sequences.
    pub stamp: i64,
    /// The points, in the stream's common coordinate frame. [Their scans](PointCloud::scans) hold the sensor's
    /// positions.
    pub cloud: Arc<PointCloud>,
}

/// Counts of the outcomes of a stream's updates so far.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Updates returned by [`Stream::next`].
    pub taken: u64,
    /// Updates replaced by newer ones before anyone took them.
    pub dropped: u64,
    /// Updates refused: unreadable, or not convertible to the coordinate frame asked for.
    pub refused: u64,
    /// Reason for the last refusal, in one line.
    pub last_refusal: Option<String>,
    /// Number of reconnections.
    pub reconnected: u64,
    /// Why nothing arrives over a connection at present, in one line.
    pub waiting: Option<String>,
}

/// The times of a stream's frames, sorted.
///
/// ```
/// use std::time::Duration;
///
/// use autosplats_sources::Timeline;
///
/// let timeline = Timeline::even(4, 10.0)?;
/// assert_eq!(timeline.duration(), Duration::from_millis(400));
/// assert_eq!(timeline.frame_at(Duration::from_millis(250)), 2);
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Timeline {
    stamps: Vec<i64>,
}

impl Timeline {
    /// Creates a timeline from stamps in nanoseconds, and sorts them.
    pub fn new(mut stamps: Vec<i64>) -> Self {
        stamps.sort_unstable();
        Self { stamps }
    }

    /// Creates a timeline of `frames` frames at `fps` frames per second, the first at 0.
    ///
    /// # Errors
    /// [`Error::BadValue`] if `fps` is not above 0 and at most 100,000.
    pub fn even(frames: usize, fps: f64) -> Result<Self, Error> {
        if !(fps > 0.0 && fps <= 1e5) {
            return Err(Error::BadValue { name: "frames per second", value: fps, rule: "above 0 and at most 100000" });
        }
        Ok(Self { stamps: (0..frames).map(|frame| (frame as f64 * 1e9 / fps).round() as i64).collect() })
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.stamps.len()
    }

    /// Whether there are no frames.
    pub fn is_empty(&self) -> bool {
        self.stamps.is_empty()
    }

    /// Stamp of each frame in nanoseconds, sorted.
    pub fn stamps(&self) -> &[i64] {
        &self.stamps
    }

    /// The first and the last stamp, in nanoseconds; `None` without frames.
    /// [`Source::clock_span`](crate::Source::clock_span) tells whether they count from a shared origin.
    pub fn span(&self) -> Option<[i64; 2]> {
        Some([*self.stamps.first()?, *self.stamps.last()?])
    }

    /// Time from the first frame to the end of the last, which gets the average length. Zero without frames.
    pub fn duration(&self) -> Duration {
        let Some([first, last]) = self.span() else { return Duration::ZERO };
        let span = last.abs_diff(first);
        let frames = self.stamps.len() as u64;
        Duration::from_nanos(if frames > 1 { span.saturating_add(span / (frames - 1)) } else { span })
    }

    /// The frame shown at a time since the first frame: the last that starts by then.
    pub fn frame_at(&self, since_first: Duration) -> usize {
        let Some(first) = self.stamps.first() else { return 0 };
        let time = i128::from(*first) + i128::try_from(since_first.as_nanos()).unwrap_or(i128::MAX >> 1);
        self.stamps.partition_point(|&stamp| i128::from(stamp) <= time).saturating_sub(1)
    }
}

/// A frame without points if a filter keeps none of them, since an object may leave the scene.
pub(crate) fn or_empty(frame: Result<PointCloud, Error>) -> Result<PointCloud, Error> {
    if matches!(frame, Err(Error::NothingKept { .. })) { Ok(PointCloud::default()) } else { frame }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_by_time() -> Result<(), Error> {
        let timeline = Timeline::even(4, 10.0)?;
        let at = |milliseconds| timeline.frame_at(Duration::from_millis(milliseconds));
        assert_eq!([0, 99, 100, 250, 300, 9000].map(at), [0, 0, 1, 2, 3, 3], "a frame is shown until the next");
        assert_eq!(timeline.duration(), Duration::from_millis(400), "the last frame lasts as well");
        assert_eq!(Timeline::new(vec![30, 10, 20]).stamps(), [10, 20, 30], "brought into order");
        assert_eq!(
            (Timeline::new(vec![3, 1]).span(), Timeline::default().span()),
            (Some([1, 3]), None),
            "first and last"
        );
        assert_eq!(Timeline::default().frame_at(Duration::MAX), 0, "no frame at all");
        let far = Timeline::new(vec![i64::MIN, i64::MAX]);
        assert_eq!(far.frame_at(Duration::MAX), 1, "a clock that jumped over all there is");
        assert!(far.duration() > Duration::from_secs(1 << 33), "and takes its time");
        Ok(())
    }

    #[test]
    fn rates_that_are_none_are_refused() {
        for fps in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e6] {
            assert!(Timeline::even(2, fps).is_err(), "{fps} frames a second");
        }
    }
}
