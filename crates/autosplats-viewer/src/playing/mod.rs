//! Inputs that move: each is read by a thread of its own, for the time that one clock of all says.

mod clock;
#[cfg(test)]
mod tests;
mod thread;

use std::sync::Arc;
use std::time::Duration;

use autosplats::cloud::{PointCloud, Statistics, Timeline};
use eframe::egui;

pub(crate) use self::clock::Clock;
use self::thread::StreamThread;
use crate::app::App;
use crate::document::{Layer, LayerId};
use crate::loading::Input;

/// Milliseconds that a picture of something that moves may take at most, and of what is live, whenever the next one comes.
const LIVE_MS: f64 = 100.0;

/// All that moves.
#[derive(Default)]
pub(crate) struct Playing {
    pub(crate) clock: Clock,
    streams: Vec<Moving>,
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
    visible: bool,
    tint: Option<[u8; 3]>,
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

    /// Whether something of this name is played.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.streams.iter().any(|moving| App::source_name(&moving.input) == name)
    }

    /// What is open but has no points yet.
    pub(crate) fn waiting(&self) -> impl Iterator<Item = &Input> {
        self.streams.iter().filter(|moving| moving.layer.is_none()).map(|moving| &moving.input)
    }

    /// The timelines of what has one.
    fn timelines(&self) -> impl Iterator<Item = Arc<Timeline>> + '_ {
        self.streams.iter().filter_map(|moving| moving.thread.timeline().flatten())
    }

    /// Whether there is a time to go to.
    pub(crate) fn has_timeline(&self) -> bool {
        self.timelines().next().is_some()
    }

    /// Whether a part of it is live.
    pub(crate) fn is_live(&self) -> bool {
        self.streams.iter().any(|moving| matches!(moving.thread.timeline(), Some(None)))
    }

    /// Milliseconds from frame to frame, while anything is played: of the input with the most frames a second.
    pub(crate) fn frame_ms(&self) -> Option<f64> {
        if !self.clock.playing || self.is_empty() {
            return None;
        }
        let each = self
            .timelines()
            .filter(|timeline| timeline.len() > 1)
            .map(|timeline| 1e3 * timeline.duration().as_secs_f64() / (timeline.len() as f64 * self.clock.speed));
        each.chain(self.is_live().then_some(LIVE_MS)).reduce(f64::min).map(|frame_ms| frame_ms.min(LIVE_MS))
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
        let only = timelines.next().filter(|_| timelines.next().is_none())?;
        Some((only.frame_at(self.position()), only.len()))
    }

    /// Goes to the next frame of any input, or to the one before.
    pub(crate) fn step(&mut self, forward: bool) {
        self.clock.playing = false;
        let position = self.position();
        // Times since the first frame: the one that is shown now, and those to choose from.
        let mut now = 0;
        let mut times: Vec<i64> = Vec::new();
        for timeline in self.timelines() {
            let first = timeline.stamps().first().copied().unwrap_or_default();
            let since = |stamp: &i64| stamp.saturating_sub(first);
            now = now.max(timeline.stamps().get(timeline.frame_at(position)).map_or(0, since));
            times.extend(timeline.stamps().iter().map(since));
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

    fn position(&self) -> Duration {
        Duration::from_secs_f64(self.clock.position())
    }
}

impl App {
    /// Begins to play something.
    pub(crate) fn play(&mut self, input: Input, visible: bool, tint: Option<[u8; 3]>, context: &egui::Context) {
        let thread = StreamThread::start(input.clone(), context.clone());
        self.playing.streams.push(Moving { input, thread, layer: None, visible, tint });
    }

    /// Begins or stops to play.
    pub(crate) fn toggle_playing(&mut self) {
        self.playing.clock.toggle();
    }

    /// Lets the time pass, asks for what is to be seen by then and takes in what has come.
    pub(crate) fn follow_streams(&mut self, context: &egui::Context) {
        if self.playing.is_empty() {
            return;
        }
        let now = context.input(|input| input.time);
        let passed = self.playing.time.replace(now).map_or(0.0, |before| now - before);
        self.keep_edits();
        let playing = &mut self.playing;
        let length = playing.timelines().map(|timeline| timeline.duration()).max().unwrap_or_default();
        playing.clock.set_length(length);
        playing.clock.advance(passed.min(0.5));
        let position = playing.position();
        for moving in &playing.streams {
            moving.thread.pause(!playing.clock.playing);
            if let Some(Some(timeline)) = moving.thread.timeline() {
                moving.thread.want(timeline.frame_at(position));
            }
        }
        let news: Vec<_> = playing.streams.iter().map(|moving| moving.thread.news()).collect();
        let mut ended = Vec::new();
        for (number, news) in news.into_iter().enumerate() {
            let name = self.playing.streams[number].input.name.clone();
            news.notes.into_iter().for_each(|note| self.messages.note(format!("{name}: {note}")));
            if let Some(ending) = news.ending {
                match ending {
                    Ok(()) => self.messages.note(format!("{name} has ended")),
                    Err(failure) => self.messages.error(failure),
                }
                ended.push(number);
            }
            if let Some(cloud) = news.cloud {
                self.show_frame(number, &cloud);
            }
        }
        for number in ended.into_iter().rev() {
            let moving = self.playing.streams.remove(number);
            match moving.layer {
                // What came last stays, as any points do.
                Some(id) => self.settle(|document| document.complete(id)),
                None => self.failed.push(moving.input),
            }
        }
        let open: Vec<LayerId> = self.document().layers.iter().map(|layer| layer.id).collect();
        self.playing.streams.retain(|moving| moving.layer.is_none_or(|id| open.contains(&id)));
        if self.playing.clock.playing && self.playing.timelines().any(|timeline| timeline.len() > 1) {
            context.request_repaint();
        }
    }

    /// Points that stand still can be edited; what moves on would lose that, and stays at the time of the edits.
    fn keep_edits(&mut self) {
        let layers: Vec<LayerId> = self.playing.streams.iter().filter_map(|moving| moving.layer).collect();
        let unsaved = layers.iter().find(|id| self.history.is_unsaved(**id)).copied();
        let position = self.playing.clock.position();
        let edited_at = unsaved.map(|_| self.playing.edited_at.unwrap_or(position));
        self.playing.edited_at = edited_at;
        let moves = self.playing.clock.playing || edited_at.is_some_and(|at| at != position);
        if let (Some(id), Some(at)) = (unsaved.filter(|_| moves), edited_at) {
            self.playing.clock.playing = false;
            self.playing.clock.seek(at);
            let name = self.document().layer(id).map(|layer| layer.name.clone()).unwrap_or_default();
            self.messages.note(format!("{name} has edits that are not saved; export or undo them to play on"));
        }
        let still = !self.playing.clock.playing;
        let changed = |id: &LayerId| self.document().layer(*id).is_some_and(|layer| layer.incomplete == still);
        if layers.iter().any(changed) {
            self.settle(|document| layers.iter().for_each(|&id| document.set_incomplete(id, !still)));
        }
    }

    /// Shows the points of a stream.
    fn show_frame(&mut self, number: usize, cloud: &Arc<PointCloud>) {
        let moving = &self.playing.streams[number];
        match moving.layer {
            Some(id) => self.fill(id, cloud),
            None if cloud.is_empty() => {}
            None => {
                let Moving { input, visible, tint, .. } = moving;
                let (input, visible, tint) = (input.clone(), *visible, *tint);
                let path = input.source.path().map(std::path::Path::to_path_buf);
                let mut layer = Layer::new(&*input.name, path, Arc::clone(cloud)).opened_at(input.world_from_input);
                layer.incomplete = self.playing.clock.playing;
                (layer.visible, layer.tint) = (visible, tint);
                let id = self.add_layer(layer, &input);
                self.playing.streams[number].layer = Some(id);
            }
        }
    }
}
