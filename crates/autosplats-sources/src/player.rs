//! Plays a stream: the points visible at one moment.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use autosplats_cloud::{Error, PointCloud, Progress};
use glam::DMat4;

use super::latest::{Latest, LatestOptions, LatestStatistics};
use crate::{Next, Stream, Timeline, Update};

/// Longest wait between two checks for cancellation.
const MAX_WAIT: Duration = Duration::from_millis(100);

/// How many earlier frames of the same channel are tried when a frame cannot be read.
const MAX_STEPS_BACK: usize = 16;

/// Plays a stream: builds the cloud that is visible at a frame of the timeline, or now for a live stream.
///
/// A frame shows the same points whatever was played before, with two exceptions:
///
/// - With [`decay`](LatestOptions::decay), if frames cannot be read or channels have different rates. Decay counts from
///   the newest update of each channel.
/// - If more than 16 frames of a channel in a row are unreadable. Only uninterrupted playback still shows its points.
///
/// ```
/// use autosplats_sources::{Animation, LatestOptions, Player};
/// use autosplats_formats::ReadOptions;
///
/// # use autosplats_cloud::{PointCloud, glam::DVec3};
/// # use autosplats_formats::write;
/// # let folder = tempfile::tempdir()?;
/// # for (name, count) in [("frame_1.ply", 10), ("frame_2.ply", 20)] {
/// #     let cloud = PointCloud::new(DVec3::ZERO, vec![[1.0; 3]; count]);
/// #     write(&cloud, &folder.path().join(name), &())?;
/// # }
/// # let pattern = folder.path().join("frame_*.ply");
/// # let pattern = pattern.to_string_lossy();
/// // Two files, the first of 10 points and the second of 20.
/// let animation = Animation::sequence(&pattern, 10.0, &ReadOptions::default(), &())?;
/// let mut player = Player::new(Box::new(animation.play()), LatestOptions::default());
/// assert_eq!(player.frame(1, &())?.len(), 20);
/// assert_eq!(player.frame(0, &())?.len(), 10);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Player {
    stream: Box<dyn Stream>,
    options: LatestOptions,
    latest: Latest,
    /// The frame played last.
    last: Option<usize>,
}

impl Player {
    /// Creates a player. `options` say which older points stay visible.
    pub fn new(stream: Box<dyn Stream>, options: LatestOptions) -> Self {
        let mut latest = Latest::new(options.clone());
        latest.add(DMat4::IDENTITY);
        Self { stream, latest, options, last: None }
    }

    /// The stream being played.
    pub fn stream(&self) -> &dyn Stream {
        &*self.stream
    }

    /// Outcomes of the updates returned by the stream. [`Stream::statistics`] counts what the stream refused itself.
    pub fn latest_statistics(&self) -> LatestStatistics {
        self.latest.statistics()
    }

    /// The points visible at a frame of the timeline: the newest of each channel, and older ones as the options say. A
    /// frame that cannot be read is reported as a note, and the points before it stay.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` asked to stop.
    pub fn frame(&mut self, frame: usize, progress: &dyn Progress) -> Result<Arc<PointCloud>, Error> {
        if self.last == Some(frame) {
            return Ok(self.latest.cloud());
        }
        let mut after = self.last;
        if self.last.is_some_and(|last| last > frame) {
            // Later points must not be visible.
            self.latest.forget(0);
            (self.last, after) = (None, None);
        }
        let all = self.needed(frame);
        for &needed in all.iter().filter(|&&needed| after.is_none_or(|after| needed > after)) {
            // If a frame cannot be read, an earlier one takes its place, as in uninterrupted playback.
            let mut next = Some(needed);
            for _ in 0..=MAX_STEPS_BACK {
                let Some(tried) = next.filter(|&next| after.is_none_or(|after| next > after)) else { break };
                if self.put(tried, progress)? {
                    break;
                }
                // Frames that are needed themselves are read in their own turn.
                next = self.before(tried).filter(|before| all.binary_search(before).is_err());
            }
        }
        self.last = Some(frame);
        Ok(self.latest.cloud())
    }

    /// The previous frame of the same channel.
    fn before(&self, frame: usize) -> Option<usize> {
        let seen = self.stream.seen_at(frame);
        self.stream.seen_at(frame.checked_sub(1)?).into_iter().find(|before| !seen.contains(before))
    }

    /// Reads a frame, and returns whether that succeeded.
    fn put(&mut self, frame: usize, progress: &dyn Progress) -> Result<bool, Error> {
        // Uses stamps of the timeline, made unique by the frame number. Stamps in messages may repeat or go back.
        let stamp = self.stream.timeline().and_then(|timeline| timeline.stamps().get(frame).copied());
        self.stream.seek(frame);
        for _ in 0..self.stream.updates_per_frame() {
            match self.stream.next(Duration::ZERO, progress) {
                Ok(Next::Update(update)) => {
                    let stamp = stamp.map_or(update.stamp, |stamp| stamp.saturating_add(frame as i64));
                    self.latest.put(0, Update { stamp, ..update });
                }
                Ok(Next::Nothing | Next::End) => return Ok(false),
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Err(error) => {
                    progress.loss(&error.to_string());
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// The first frame, or the first update of a live stream, in which a point has a finite position: sensors often
    /// begin with empty messages. [`position`](Self::position) tells which frame this is.
    ///
    /// Waits for a live stream up to `patience`, and longer while [bytes](Stream::received) arrive: each arrival starts
    /// the wait anew.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame) and [`next`](Self::next); [`Error::NoFrames`] if no points come.
    pub fn first(&mut self, patience: Duration, progress: &dyn Progress) -> Result<Arc<PointCloud>, Error> {
        let no_frames = |why: String| Err(Error::NoFrames { name: "the stream".into(), why });
        if let Some(frames) = self.stream.timeline().map(Timeline::len) {
            for frame in 0..frames {
                let cloud = self.frame(frame, progress)?;
                if cloud.has_finite(1) {
                    return Ok(cloud);
                }
            }
            return no_frames(match frames {
                0 | 1 => "there are no points in it".into(),
                _ => format!("there are no points in any of its {frames} frames"),
            });
        }
        let (mut since, mut received) = (Instant::now(), self.stream.received());
        while let Some(left) = patience.checked_sub(since.elapsed()) {
            if let Some(cloud) = self.next(left.min(MAX_WAIT), progress)?
                && cloud.has_finite(1)
            {
                return Ok(cloud);
            }
            let now = self.stream.received();
            if now > received {
                (since, received) = (Instant::now(), now);
            }
        }
        no_frames(format!("no points within {} s", patience.as_secs()))
    }

    /// The frame of the timeline that was played last; `None` before the first frame and for a live stream.
    pub fn position(&self) -> Option<usize> {
        self.last
    }

    /// The frames that must be read to show `frame`, in order.
    fn needed(&self, frame: usize) -> Vec<usize> {
        if self.options.accumulate {
            return (0..=frame).collect();
        }
        let mut needed = self.stream.seen_at(frame);
        if let (Some(decay), Some(timeline)) = (self.options.decay, self.stream.timeline())
            && let Some(&now) = timeline.stamps().get(frame)
        {
            let since = now.saturating_sub(i64::try_from(decay.as_nanos()).unwrap_or(i64::MAX));
            let first = timeline.stamps().partition_point(|&stamp| stamp < since);
            needed.extend(first..=frame);
            needed.sort_unstable();
            needed.dedup();
        }
        needed
    }

    /// The points visible after the next update of a live stream; `None` if none arrived within `patience`. An update
    /// that cannot be read is reported as a note.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` asked to stop; [`Error::NoFrames`] when the stream has ended.
    pub fn next(&mut self, patience: Duration, progress: &dyn Progress) -> Result<Option<Arc<PointCloud>>, Error> {
        match self.stream.next(patience, progress) {
            Ok(Next::Update(update)) => {
                self.latest.put(0, update);
                Ok(Some(self.latest.cloud()))
            }
            Ok(Next::Nothing) => Ok(None),
            Ok(Next::End) => Err(Error::NoFrames { name: "the stream".into(), why: "it has ended".into() }),
            Err(Error::Cancelled) => Err(Error::Cancelled),
            Err(error) => {
                progress.loss(&error.to_string());
                Ok(None)
            }
        }
    }
}
