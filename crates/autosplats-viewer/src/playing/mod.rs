//! Inputs that move: each is read by a thread of its own, for the time that one clock of all says.

mod clock;
mod follow;
mod reel;
#[cfg(test)]
mod tests;
mod thread;

use std::sync::Arc;
use std::time::Duration;

use autosplats::cloud::{Statistics, Timeline, beginnings};

pub(crate) use self::clock::{Clock, SPEEDS};
pub(crate) use self::reel::{Reel, Track};
use self::thread::StreamThread;
use crate::app::App;
use crate::document::LayerId;
use crate::loading::{Appearance, Input};

/// Milliseconds that a picture of something that moves may take at most, and of what is live before it is known how often that
/// comes.
const LIVE_MS: f64 = 100.0;
/// Share of the time from update to update that a picture of what is live may take: half a picture is waited for first, and both
/// are to be over when the next update comes.
const LIVE_SHARE: f64 = 0.6;
/// Seconds over which live updates are counted.
const COUNTED: f64 = 1.0;

/// All that moves.
#[derive(Default)]
pub(crate) struct Playing {
    pub(crate) clock: Clock,
    streams: Vec<Moving>,
    /// What was removed, and would come back by undo.
    removed: Vec<Removed>,
    /// When the clock was advanced last, seconds of the window.
    time: Option<f64>,
    /// The time of points with edits that are not saved.
    edited_at: Option<f64>,
}

/// An input that moves.
struct Moving {
    input: Input,
    thread: StreamThread,
    /// Where its points are shown, once there are some.
    layer: Option<LayerId>,
    /// The frame that the layer shows.
    frame: Option<usize>,
    /// When it begins on the clock, if its stamps say that; with the clock otherwise.
    begins: Option<Duration>,
    appearance: Appearance,
    heard: Heard,
}

/// How often something live comes.
#[derive(Default)]
struct Heard {
    /// Seconds of the window and the number of updates by then, when counting began.
    since: Option<(f64, u64)>,
    /// Milliseconds from update to update, once that is known.
    period_ms: Option<f64>,
}

impl Heard {
    /// So many updates have come by now.
    fn count(&mut self, now: f64, updates: u64) {
        let (since, before) = *self.since.get_or_insert((now, updates));
        if now - since >= COUNTED {
            let came = updates.saturating_sub(before);
            self.period_ms = (came > 0).then(|| 1e3 * (now - since) / came as f64);
            self.since = Some((now, updates));
        }
    }

    /// Milliseconds that a picture may take to be there before the next update.
    fn live_ms(&self) -> f64 {
        self.period_ms.map_or(LIVE_MS, |period_ms| (LIVE_SHARE * period_ms).min(LIVE_MS))
    }
}

/// An input that moved.
struct Removed {
    input: Input,
    layer: LayerId,
    frame: Option<usize>,
    /// Seconds of the clock at which it was removed.
    position: f64,
}

/// An input that has no points yet.
pub(crate) struct Waiting<'a> {
    /// Among all that moves.
    pub(crate) number: usize,
    pub(crate) input: &'a Input,
    pub(crate) appearance: Appearance,
    /// What it waits for.
    pub(crate) why: String,
    /// Part of that which is done, 0 to 1, as far as it is known.
    pub(crate) read: f32,
}

impl Moving {
    /// Something that has no points yet.
    fn new(input: Input, thread: StreamThread, appearance: Appearance) -> Self {
        Self { input, thread, layer: None, frame: None, begins: None, appearance, heard: Heard::default() }
    }

    /// When its frames happen, if it has a timeline and that is known.
    fn timeline(&self) -> Option<Arc<Timeline>> {
        self.thread.timeline().flatten()
    }

    /// The frame of a timeline of its own that is shown at a place of the clock.
    fn frame_at(&self, timeline: &Timeline, position: Duration) -> usize {
        timeline.frame_at(position.saturating_sub(self.begins.unwrap_or_default()))
    }

    /// What it waits for, if it has no points yet.
    fn why(&self) -> String {
        match self.thread.timeline() {
            None => "being opened".into(),
            Some(Some(_)) => "waits for its first points".into(),
            Some(None) => self.thread.statistics().waiting.unwrap_or_else(|| "waits for points".into()),
        }
    }
}

impl Playing {
    /// Whether anything is played, or will be.
    pub(crate) fn is_empty(&self) -> bool {
        self.streams.is_empty()
    }

    /// Plays what is shown as a layer no longer; says whether it was.
    pub(crate) fn stop(&mut self, id: LayerId) -> bool {
        let before = self.streams.len();
        self.streams.retain(|moving| moving.layer != Some(id));
        self.streams.len() < before
    }

    /// Gives up an input that [has no points yet](Self::waiting), by its number.
    pub(crate) fn give_up(&mut self, number: usize) {
        if self.streams.get(number).is_some_and(|moving| moving.layer.is_none()) {
            self.streams.remove(number);
        }
    }

    /// Gives up all that has no points yet.
    pub(crate) fn give_up_waiting(&mut self) {
        self.streams.retain(|moving| moving.layer.is_some());
    }

    /// Whether something of this name is played.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.streams.iter().any(|moving| App::source_name(&moving.input) == name)
    }

    /// Whether a layer is of something that is played.
    pub(crate) fn shows(&self, id: LayerId) -> bool {
        self.streams.iter().any(|moving| moving.layer == Some(id))
    }

    /// What is open but has no points yet.
    pub(crate) fn waiting(&self) -> impl Iterator<Item = Waiting<'_>> {
        let waiting = self.streams.iter().enumerate().filter(|(_, moving)| moving.layer.is_none());
        waiting.map(|(number, moving)| {
            let Moving { input, appearance, thread, .. } = moving;
            Waiting { number, input, appearance: *appearance, why: moving.why(), read: thread.read() }
        })
    }

    /// The timelines of what has one, and when they begin on the clock.
    fn timelines(&self) -> impl Iterator<Item = (Arc<Timeline>, Duration)> + '_ {
        self.streams.iter().filter_map(|moving| Some((moving.timeline()?, moving.begins.unwrap_or_default())))
    }

    /// Whether there is a time to go to.
    pub(crate) fn has_timeline(&self) -> bool {
        self.timelines().next().is_some()
    }

    /// Whether a part of it is live.
    pub(crate) fn is_live(&self) -> bool {
        self.streams.iter().any(|moving| matches!(moving.thread.timeline(), Some(None)))
    }

    /// Milliseconds from frame to frame, while anything is played: of the input with the most frames a second, `least_ms` at least.
    /// Of what is live, what a picture may take to be there before the next update.
    pub(crate) fn frame_ms(&self, least_ms: f64) -> Option<f64> {
        let runs = self.clock.runs();
        let each = self
            .timelines()
            .filter(|(timeline, _)| runs && timeline.len() > 1)
            .map(|(timeline, _)| 1e3 * timeline.duration().as_secs_f64() / (timeline.len() as f64 * self.clock.speed));
        let each = each.map(|frame_ms| frame_ms.max(least_ms));
        let is_live = |moving: &&Moving| self.clock.playing && matches!(moving.thread.timeline(), Some(None));
        let live = self.streams.iter().filter(is_live).map(|moving| moving.heard.live_ms());
        each.chain(live).reduce(f64::min).map(|frame_ms| frame_ms.min(LIVE_MS))
    }

    /// What became of all updates.
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

    /// The frame that is shown, of so many, where one input alone has a timeline.
    pub(crate) fn frame(&self) -> Option<(usize, usize)> {
        let mut timelines = self.timelines();
        let (only, _) = timelines.next().filter(|_| timelines.next().is_none())?;
        Some((only.frame_at(self.position()), only.len()))
    }

    /// When the input of a layer begins, where several have timelines, in words.
    pub(crate) fn alignment(&self, id: LayerId) -> Option<String> {
        let moving = self.streams.iter().find(|moving| moving.layer == Some(id) && moving.timeline().is_some())?;
        (self.timelines().count() > 1).then(|| match moving.begins {
            Some(begins) => format!("by the clock of its stamps, {:.3} s after the first", begins.as_secs_f64()),
            None => "at once with the others, whatever their stamps say".into(),
        })
    }

    /// Goes to the next frame of any input, or to the one before.
    pub(crate) fn step(&mut self, forward: bool) {
        self.clock.playing = false;
        let position = self.position();
        // Nanoseconds of the clock: of what is shown now, and those to choose from.
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
            // Half a nanosecond, lest rounding falls short of the frame.
            self.clock.seek(next as f64 * 1e-9 + 0.5e-9);
        }
    }

    /// The frames that are seen at each of some places of the clock, of all that has a timeline and points.
    pub(crate) fn tracks(&self, places: &[f64]) -> Vec<Track> {
        let shown = self.streams.iter().filter_map(|moving| Some((moving, moving.layer?, moving.timeline()?)));
        let track = |(moving, layer, timeline): (&Moving, LayerId, Arc<Timeline>)| {
            let frame = |&place: &f64| moving.frame_at(&timeline, duration(place));
            Track { layer, input: moving.input.clone(), frames: places.iter().map(frame).collect() }
        };
        shown.map(track).collect()
    }

    /// Listens how often live updates come, at a second of the window.
    fn count_updates(&mut self, now: f64) {
        for moving in &mut self.streams {
            let Statistics { taken, dropped, .. } = moving.thread.statistics();
            moving.heard.count(now, taken + dropped);
        }
    }

    /// Finds out when each begins, by what is open now. What is shown stays as it is unless the clock is held; of several that
    /// move against each other, what the first one shows.
    fn align(&mut self) {
        let span = |moving: &Moving| moving.input.source.clock_span(&*moving.timeline()?);
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

/// A time of a clock.
fn duration(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}
