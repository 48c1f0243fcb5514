//! Points that change: what sequences, recordings, live connections and simulated scanners have in common.

use std::{sync::Arc, time::Duration};

use crate::{Error, PointCloud, Progress};

/// Points that change over time, an update after the other.
///
/// There are two kinds. One has a [timeline](Self::timeline): all its frames are known, each can be sought, and the same frame
/// is the same points each time. The other is live: updates come when they come, what is not taken in time is replaced by what
/// is newer, and counted.
pub trait Stream: Send {
    /// The times of all frames, if they are known.
    fn timeline(&self) -> Option<&Timeline>;

    /// The frames that together are seen at the time of `frame`, in order: of each channel the newest by then. Where all channels
    /// have updates in every frame, that is the frame alone.
    fn seen_at(&self, frame: usize) -> Vec<usize> {
        vec![frame]
    }

    /// Updates that each frame of the timeline has, one after the other; 1 but for several simulated scanners.
    fn updates_per_frame(&self) -> usize {
        1
    }

    /// Makes `frame` the [next](Self::next) one; beyond the last there is none. Nothing is read yet. Live streams stay as
    /// they are.
    fn seek(&mut self, frame: usize);

    /// The next update. Waits for it no longer than `patience` if it is live; one of a timeline takes the time that reading
    /// takes, which `progress` hears of and may cancel.
    ///
    /// # Errors
    /// Those of reading. The stream goes on behind what failed: the next call is about what follows.
    fn next(&mut self, patience: Duration, progress: &dyn Progress) -> Result<Next, Error>;

    /// What became of the updates so far.
    fn statistics(&self) -> Statistics;

    /// Bytes that have come of updates so far, whole or not, for whoever waits for the first: while they become more, something is
    /// on its way. 0 where nobody counts them.
    fn received(&self) -> u64 {
        0
    }
}

/// What [`Stream::next`] found.
#[derive(Clone, Debug, PartialEq)]
pub enum Next {
    /// New points.
    Update(Update),
    /// Nothing came in time; something may yet.
    Nothing,
    /// There will be no more, unless an earlier frame is sought.
    End,
}

/// The points of one sensor at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Update {
    /// Which of the stream's sensors it is of, counted from 0: an update takes the place of the one before of the same
    /// channel, and leaves other channels alone.
    pub channel: usize,
    /// When the points were measured, in nanoseconds; of recordings since 1970, of sequences since their beginning.
    pub stamp: i64,
    /// The points, in the stream's common frame. Where the sensor stood say [their scans](PointCloud::scans).
    pub cloud: Arc<PointCloud>,
}

/// What became of the updates of a stream so far.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Handed out by [`Stream::next`].
    pub taken: u64,
    /// Replaced by newer ones before anyone took them.
    pub dropped: u64,
    /// Not readable, older than what had come before, or not to be brought into the frame that was asked for.
    pub refused: u64,
    /// Why the last one was refused, in a line.
    pub last_refusal: Option<String>,
    /// Times that a connection was made anew.
    pub reconnected: u64,
    /// Why nothing comes over a connection, in a line, while that is so.
    pub waiting: Option<String>,
}

/// When the frames of a stream happen, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Timeline {
    stamps: Vec<i64>,
}

impl Timeline {
    /// Frames at these times, in nanoseconds; brought into order where they are not.
    pub fn new(mut stamps: Vec<i64>) -> Self {
        stamps.sort_unstable();
        Self { stamps }
    }

    /// `frames` frames, `fps` of them a second, the first at 0.
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

    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.stamps.is_empty()
    }

    /// When each frame happens, in nanoseconds, never falling.
    pub fn stamps(&self) -> &[i64] {
        &self.stamps
    }

    /// The first and the last stamp, in nanoseconds; `None` if there is no frame. What they count from, and whether others
    /// count from the same, [the source](crate::Source::clock_span) knows.
    pub fn span(&self) -> Option<[i64; 2]> {
        Some([*self.stamps.first()?, *self.stamps.last()?])
    }

    /// From the first frame to the last one's end, which lasts as long as the others do on average; zero if there is none.
    pub fn duration(&self) -> Duration {
        let Some([first, last]) = self.span() else { return Duration::ZERO };
        let span = last.abs_diff(first);
        let frames = self.stamps.len() as u64;
        Duration::from_nanos(if frames > 1 { span.saturating_add(span / (frames - 1)) } else { span })
    }

    /// The frame that is shown so long after the first one: the last that happens by then.
    pub fn frame_at(&self, since_first: Duration) -> usize {
        let Some(first) = self.stamps.first() else { return 0 };
        let time = i128::from(*first) + i128::try_from(since_first.as_nanos()).unwrap_or(i128::MAX >> 1);
        self.stamps.partition_point(|&stamp| i128::from(stamp) <= time).saturating_sub(1)
    }
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
