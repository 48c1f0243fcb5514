//! What is to be seen of a stream at one moment.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use glam::DMat4;

use super::latest::{Latest, LatestOptions, LatestStatistics};
use crate::{Error, Next, PointCloud, Progress, Stream, Update};

/// How long a wait may last before somebody may cancel it.
const STEP: Duration = Duration::from_millis(100);

/// Frames of the same channel before one that cannot be read among which one is looked for that can.
const STEPS_BACK: usize = 16;

/// Plays a stream: makes the cloud that is to be seen at a frame of its timeline, or now.
///
/// A frame is the same points whatever was played before it, but for those that [decay](LatestOptions::decay) where frames cannot
/// be read or channels have different rates: it counts from the newest of their channel. And where more than 16 frames of a
/// channel in a row cannot be read, only who played on still sees its last points.
pub struct Player {
    stream: Box<dyn Stream>,
    options: LatestOptions,
    latest: Latest,
    /// The frame that was played last.
    last: Option<usize>,
}

impl Player {
    /// Plays a stream, and keeps what `options` say beside the newest points.
    pub fn new(stream: Box<dyn Stream>, options: LatestOptions) -> Self {
        let mut latest = Latest::new(options.clone());
        latest.add(DMat4::IDENTITY);
        Self { stream, latest, options, last: None }
    }

    /// What is played.
    pub fn stream(&self) -> &dyn Stream {
        &*self.stream
    }

    /// What became of the updates that the stream handed out: shown, late, known already. What it dropped or refused itself is in
    /// its own [statistics](Stream::statistics).
    pub fn latest_statistics(&self) -> LatestStatistics {
        self.latest.statistics()
    }

    /// The points that are seen at a frame of the timeline: of each channel the newest by then, and what is kept of older ones.
    /// What cannot be read is told as a note, once for each frame, and the points before it stay.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` asked to stop.
    pub fn frame(&mut self, frame: usize, progress: &dyn Progress) -> Result<Arc<PointCloud>, Error> {
        if self.last == Some(frame) {
            return Ok(self.latest.cloud());
        }
        let mut after = self.last;
        if self.last.is_some_and(|last| last > frame) {
            // What came later must not be seen.
            self.latest.forget(0);
            (self.last, after) = (None, None);
        }
        let all = self.needed(frame);
        for &needed in all.iter().filter(|&&needed| after.is_none_or(|after| needed > after)) {
            // Instead of a frame that cannot be read whoever comes here sees what was before it, as all do who played on.
            let mut next = Some(needed);
            for _ in 0..=STEPS_BACK {
                let Some(tried) = next.filter(|&next| after.is_none_or(|after| next > after)) else { break };
                if self.put(tried, progress)? {
                    break;
                }
                // Those that are needed themselves have their own turn.
                next = self.before(tried).filter(|before| all.binary_search(before).is_err());
            }
        }
        self.last = Some(frame);
        Ok(self.latest.cloud())
    }

    /// The frame that was seen until this one took its place: of the same channel.
    fn before(&self, frame: usize) -> Option<usize> {
        let seen = self.stream.seen_at(frame);
        self.stream.seen_at(frame.checked_sub(1)?).into_iter().find(|before| !seen.contains(before))
    }

    /// Reads a frame; says whether that was possible.
    fn put(&mut self, frame: usize, progress: &dyn Progress) -> Result<bool, Error> {
        // By the time of the timeline, which is in order, and no two are of the same time: what messages say of themselves may
        // stand still or overtake each other.
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
                    progress.note(&error.to_string());
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// The first frame, or of a live stream the first update, which is waited for no longer than `patience`, counted anew as long
    /// as [bytes](Stream::received) of it come.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame) and [`next`](Self::next), [`Error::NoFrames`] if nothing comes.
    pub fn first(&mut self, patience: Duration, progress: &dyn Progress) -> Result<Arc<PointCloud>, Error> {
        if self.stream.timeline().is_some() {
            return self.frame(0, progress);
        }
        let (mut since, mut received) = (Instant::now(), self.stream.received());
        while let Some(left) = patience.checked_sub(since.elapsed()) {
            if let Some(cloud) = self.next(left.min(STEP), progress)? {
                return Ok(cloud);
            }
            let now = self.stream.received();
            if now > received {
                (since, received) = (Instant::now(), now);
            }
        }
        let why = format!("nothing came within {} s", patience.as_secs());
        Err(Error::NoFrames { name: "the stream".into(), why })
    }

    /// The frames that a frame is made of, in order.
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

    /// The points that are seen once the next update of a live stream has come; `None` if none came within `patience`. What
    /// cannot be read is told as a note.
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
                progress.note(&error.to_string());
                Ok(None)
            }
        }
    }
}
