//! Playing inputs: each is read by a thread of its own, at the time of one common clock.

mod clock;
mod follow;
mod reel;
#[cfg(test)]
mod tests;
mod thread;

use std::sync::Arc;
use std::time::Duration;

use autosplats_sources::{Statistics, Timeline, beginnings};

pub(crate) use self::clock::{Clock, SPEEDS};
pub(crate) use self::reel::{Reel, Track};
use self::thread::StreamThread;
use crate::session::{Appearance, Input, LayerId};

/// Longest time limit of a picture while an input plays, milliseconds. Also the limit for a live input whose update
/// rate is unknown.
const LIVE_MS: f64 = 100.0;
/// Share of the time between two live updates that a picture may take. On average an update first waits for half a
/// picture, and both must end before the next update.
const LIVE_SHARE: f64 = 0.6;
/// Seconds over which live updates are counted.
const COUNTING_PERIOD_S: f64 = 1.0;

/// All playing inputs.
#[derive(Default)]
pub(crate) struct Playing {
    pub(crate) clock: Clock,
    streams: Vec<PlayingInput>,
    /// The removed inputs that undo would bring back.
    removed: Vec<RemovedInput>,
    /// Window time when the clock was last advanced, seconds.
    time: Option<f64>,
    /// Clock position of the points with unsaved edits, seconds.
    edited_at: Option<f64>,
}

/// A playing input.
struct PlayingInput {
    input: Input,
    thread: StreamThread,
    /// The layer that shows the points, once there are some.
    layer: Option<LayerId>,
    /// The frame that the layer shows.
    frame: Option<usize>,
    /// Start on the clock, if the stamps of several inputs share a clock; `None` starts at 0.
    begins: Option<Duration>,
    appearance: Appearance,
    heard: UpdateRate,
}

/// Measures how often a live input sends updates.
#[derive(Default)]
struct UpdateRate {
    /// Window time in seconds, and number of updates, when counting started.
    since: Option<(f64, u64)>,
    /// Milliseconds between updates, once known.
    period_ms: Option<f64>,
}

impl UpdateRate {
    /// Notes the number of updates so far.
    fn count(&mut self, now: f64, updates: u64) {
        let (since, before) = *self.since.get_or_insert((now, updates));
        if now - since >= COUNTING_PERIOD_S {
            let came = updates.saturating_sub(before);
            self.period_ms = (came > 0).then(|| 1e3 * (now - since) / came as f64);
            self.since = Some((now, updates));
        }
    }

    /// Time limit of a picture, so that it is finished before the next update, milliseconds.
    fn live_ms(&self) -> f64 {
        self.period_ms.map_or(LIVE_MS, |period_ms| (LIVE_SHARE * period_ms).min(LIVE_MS))
    }
}

/// A removed input.
struct RemovedInput {
    input: Input,
    layer: LayerId,
    frame: Option<usize>,
    /// Clock position when the input was removed, seconds.
    position: f64,
}

/// An input that has no points yet.
pub(crate) struct WaitingInput<'a> {
    /// Index among the playing inputs.
    pub(crate) number: usize,
    pub(crate) input: &'a Input,
    pub(crate) appearance: Appearance,
    /// What the input waits for.
    pub(crate) why: String,
    /// Progress of reading, 0 to 1, as far as known.
    pub(crate) read: f32,
}

impl PlayingInput {
    /// An input without points.
    fn new(input: Input, thread: StreamThread, appearance: Appearance) -> Self {
        Self { input, thread, layer: None, frame: None, begins: None, appearance, heard: UpdateRate::default() }
    }

    /// The input's timeline, if it has one and is open.
    fn timeline(&self) -> Option<Arc<Timeline>> {
        self.thread.timeline().flatten()
    }

    /// The frame of the input's timeline at a clock position.
    fn frame_at(&self, timeline: &Timeline, position: Duration) -> usize {
        timeline.frame_at(position.saturating_sub(self.begins.unwrap_or_default()))
    }

    /// What the input waits for, while it has no points.
    fn why(&self) -> String {
        match self.thread.timeline() {
            None => "being opened".into(),
            Some(Some(_)) => "waits for its first points".into(),
            Some(None) => self.thread.statistics().waiting.unwrap_or_else(|| "waits for points".into()),
        }
    }
}

impl Playing {
    /// Whether no input is playing or waiting.
    pub(crate) fn is_empty(&self) -> bool {
        self.streams.is_empty()
    }

    /// Stops the stream of a layer. Returns whether there was one.
    pub(crate) fn stop(&mut self, id: LayerId) -> bool {
        let before = self.streams.len();
        self.streams.retain(|moving| moving.layer != Some(id));
        self.streams.len() < before
    }

    /// Stops an input that [has no points yet](Self::waiting), by its number.
    pub(crate) fn give_up(&mut self, number: usize) {
        if self.streams.get(number).is_some_and(|moving| moving.layer.is_none()) {
            self.streams.remove(number);
        }
    }

    /// Stops all inputs that have no points yet.
    pub(crate) fn give_up_waiting(&mut self) {
        self.streams.retain(|moving| moving.layer.is_some());
    }

    /// Whether an input of this name is playing.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.streams.iter().any(|moving| moving.input.source_name() == name)
    }

    /// Whether a layer belongs to a playing input.
    pub(crate) fn shows(&self, id: LayerId) -> bool {
        self.streams.iter().any(|moving| moving.layer == Some(id))
    }

    /// The inputs that are open but have no points yet.
    pub(crate) fn waiting(&self) -> impl Iterator<Item = WaitingInput<'_>> {
        let waiting = self.streams.iter().enumerate().filter(|(_, moving)| moving.layer.is_none());
        waiting.map(|(number, moving)| {
            let PlayingInput { input, appearance, thread, .. } = moving;
            WaitingInput { number, input, appearance: *appearance, why: moving.why(), read: thread.read() }
        })
    }

    /// The known timelines, and their starts on the clock.
    fn timelines(&self) -> impl Iterator<Item = (Arc<Timeline>, Duration)> + '_ {
        self.streams.iter().filter_map(|moving| Some((moving.timeline()?, moving.begins.unwrap_or_default())))
    }

    /// Whether any input has a timeline.
    pub(crate) fn has_timeline(&self) -> bool {
        self.timelines().next().is_some()
    }

    /// Whether any input is live.
    pub(crate) fn is_live(&self) -> bool {
        self.streams.iter().any(|moving| matches!(moving.thread.timeline(), Some(None)))
    }

    /// Time limit of a picture while inputs play, milliseconds; `None` at rest. For timelines the limit is the shortest
    /// frame period, at least `least_ms`; for live inputs, the time before the next update. No limit is above
    /// `LIVE_MS`.
    pub(crate) fn frame_ms(&self, least_ms: f64) -> Option<f64> {
        let runs = self.clock.runs();
        let each = self
            .timelines()
            .filter(|(timeline, _)| runs && timeline.len() > 1)
            .map(|(timeline, _)| 1e3 * timeline.duration().as_secs_f64() / (timeline.len() as f64 * self.clock.speed));
        let each = each.map(|frame_ms| frame_ms.max(least_ms));
        let is_live = |moving: &&PlayingInput| self.clock.playing && matches!(moving.thread.timeline(), Some(None));
        let live = self.streams.iter().filter(is_live).map(|moving| moving.heard.live_ms());
        each.chain(live).reduce(f64::min).map(|frame_ms| frame_ms.min(LIVE_MS))
    }

    /// Statistics of all updates, summed over the inputs.
    pub(crate) fn statistics(&self) -> Statistics {
        self.streams.iter().map(|moving| moving.thread.statistics()).fold(Statistics::default(), |sum, next| {
            Statistics {
                taken: sum.taken + next.taken,
                dropped: sum.dropped + next.dropped,
                refused: sum.refused + next.refused,
                last_refusal: next.last_refusal.or(sum.last_refusal),
                reconnected: sum.reconnected + next.reconnected,
                waiting: next.waiting.or(sum.waiting),
            }
        })
    }

    /// The shown frame and the number of frames, if exactly one input has a timeline.
    pub(crate) fn frame(&self) -> Option<(usize, usize)> {
        let mut timelines = self.timelines();
        let (only, _) = timelines.next().filter(|_| timelines.next().is_none())?;
        Some((only.frame_at(self.position()), only.len()))
    }

    /// Text on when the input of a layer begins, if several inputs have timelines.
    pub(crate) fn alignment(&self, id: LayerId) -> Option<String> {
        let moving = self.streams.iter().find(|moving| moving.layer == Some(id) && moving.timeline().is_some())?;
        (self.timelines().count() > 1).then(|| match moving.begins {
            Some(begins) => format!("{:.3} s after the first input, by its time stamps", begins.as_secs_f64()),
            None => "together with the other inputs, regardless of time stamps".into(),
        })
    }

    /// Moves to the next frame of any input, or to the previous one.
    pub(crate) fn step(&mut self, forward: bool) {
        self.clock.playing = false;
        let position = self.position();
        // Clock times in nanoseconds: of the shown frame, and of all frames.
        let mut now = 0;
        let mut times: Vec<u64> = Vec::new();
        for (timeline, begins) in self.timelines() {
            let first = timeline.stamps().first().copied().unwrap_or_default();
            let begins_ns = u64::try_from(begins.as_nanos()).unwrap_or(u64::MAX);
            let time = |stamp: &i64| begins_ns.saturating_add(stamp.abs_diff(first));
            if position >= begins {
                now = now.max(timeline.stamps().get(timeline.frame_at(position - begins)).map_or(0, time));
            }
            times.extend(timeline.stamps().iter().map(time));
        }
        let next = if forward {
            times.into_iter().filter(|&time| time > now).min()
        } else {
            times.into_iter().filter(|&time| time < now).max()
        };
        if let Some(next) = next {
            // Half a nanosecond more, so that rounding does not fall short of the frame.
            self.clock.seek(next as f64 * 1e-9 + 0.5e-9);
        }
    }

    /// The frames at some clock positions, for each input that has a timeline and points.
    pub(crate) fn tracks(&self, places: &[f64]) -> Vec<Track> {
        let shown = self.streams.iter().filter_map(|moving| Some((moving, moving.layer?, moving.timeline()?)));
        let track = |(moving, layer, timeline): (&PlayingInput, LayerId, Arc<Timeline>)| {
            let frame = |&place: &f64| moving.frame_at(&timeline, duration(place));
            Track { layer, input: moving.input.clone(), frames: places.iter().map(frame).collect() }
        };
        shown.map(track).collect()
    }

    /// Counts live updates at window time `now`, seconds.
    fn count_updates(&mut self, now: f64) {
        for moving in &mut self.streams {
            let Statistics { taken, dropped, .. } = moving.thread.statistics();
            moving.heard.count(now, taken + dropped);
        }
    }

    /// Computes when each input begins, from the inputs that are open. Unless the clock is held, its position moves so
    /// that the first shown input keeps its frame.
    fn align(&mut self) {
        let span = |moving: &PlayingInput| moving.input.source.clock_span(&*moving.timeline()?);
        let spans: Vec<_> = self.streams.iter().map(span).collect();
        let mut shift = None;
        for (moving, begins) in self.streams.iter_mut().zip(beginnings(&spans)) {
            let [before, after] = [moving.begins, begins].map(|begins| begins.unwrap_or_default().as_secs_f64());
            if moving.layer.is_some() {
                shift.get_or_insert(after - before);
            }
            moving.begins = begins;
        }
        if let Some(shift) = shift.filter(|shift| *shift != 0.0 && !self.clock.is_held()) {
            self.clock.shift(shift);
        }
    }

    fn position(&self) -> Duration {
        duration(self.clock.position())
    }
}

/// A clock position as a duration; 0 if invalid.
fn duration(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}
