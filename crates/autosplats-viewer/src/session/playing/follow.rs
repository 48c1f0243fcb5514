//! Playing inputs: what the window does with them in each frame.

use std::sync::Arc;

use autosplats::cloud::PointCloud;
use autosplats_sources::Source;

use super::thread::StreamThread;
use super::{PlayingInput, RemovedInput};
use crate::session::document::Bits;
use crate::session::{Appearance, FirstLook, Input, LayerId, Session};

impl Session {
    /// Starts to play an input.
    pub(crate) fn play(&mut self, input: Input, appearance: Appearance) {
        let thread = StreamThread::start(input.clone(), self.loader.frame.clone(), self.loader.context().clone());
        self.playing.streams.push(PlayingInput::new(input, thread, appearance));
    }

    /// Opens the source of a layer again and plays it from the clock's position.
    pub(crate) fn play_anew(&mut self, id: LayerId, input: Input) {
        if matches!(input.source, Source::StandardInput) {
            self.messages.note(format!("{}: an input from a pipe cannot be read again", input.name));
            return;
        }
        self.messages.note(format!("{} is opened again", input.name));
        let thread = StreamThread::start(input.clone(), self.loader.frame.clone(), self.loader.context().clone());
        match self.playing.streams.iter_mut().find(|moving| moving.layer == Some(id)) {
            Some(moving) => (moving.input, moving.thread, moving.frame) = (input, thread, None),
            None => {
                let moving = PlayingInput::new(input, thread, Appearance::default());
                self.playing.streams.push(PlayingInput { layer: Some(id), ..moving });
            }
        }
        self.playing.clock.hold();
    }

    /// Advances the clock to window time `now`, seconds, requests the frames of the new time and receives points.
    pub(crate) fn follow_streams(&mut self, now: f64) {
        self.follow_layers();
        if self.playing.is_empty() {
            return;
        }
        let passed = self.playing.time.replace(now).map_or(0.0, |before| now - before);
        self.keep_edits();
        let playing = &mut self.playing;
        playing.count_updates(now);
        let open = playing.streams.iter().all(|moving| moving.thread.timeline().is_some());
        if open || !playing.clock.is_held() {
            playing.align();
        }
        let ends = playing.timelines().map(|(timeline, begins)| begins.saturating_add(timeline.duration()));
        let length = ends.max().unwrap_or_default();
        playing.clock.set_length(length, open);
        let live = playing.is_live();
        playing.clock.advance(passed.min(0.5), live);
        let position = playing.position();
        for moving in &playing.streams {
            moving.thread.pause(!playing.clock.playing);
            if let Some(timeline) = moving.timeline() {
                moving.thread.want(moving.frame_at(&timeline, position));
            }
        }
        self.take_news();
        if self.playing.clock.runs() && self.playing.timelines().any(|(timeline, _)| timeline.len() > 1) {
            self.loader.context().request_repaint();
        }
    }

    /// Stops the streams of removed layers, and restarts those of layers that undo has brought back. A restored layer
    /// is at the clock's time; if it has unsaved edits, the clock returns to their time.
    fn follow_layers(&mut self) {
        let open: Vec<LayerId> = self.document().layers.iter().map(|layer| layer.id).collect();
        let position = self.playing.clock.position();
        let mut index = 0;
        while let Some(moving) = self.playing.streams.get(index) {
            match moving.layer.filter(|id| !open.contains(id)) {
                None => index += 1,
                Some(layer) => {
                    let PlayingInput { input, frame, .. } = self.playing.streams.remove(index);
                    self.playing.removed.push(RemovedInput { input, layer, frame, position });
                }
            }
        }
        if self.playing.removed.is_empty() {
            return;
        }
        let removed = std::mem::take(&mut self.playing.removed);
        let (back, gone): (Vec<_>, Vec<_>) = removed.into_iter().partition(|removed| open.contains(&removed.layer));
        self.playing.removed = gone;
        self.playing.removed.retain(|removed| self.history.holds(removed.layer));
        for RemovedInput { input, layer, frame, position } in back {
            // A pipe cannot be read again.
            if matches!(input.source, Source::StandardInput) {
                self.messages.note(format!("{} was closed; its last points are shown", input.name));
                continue;
            }
            if self.history.is_unsaved(layer) {
                self.playing.edited_at.get_or_insert(position);
            }
            let thread =
                StreamThread::go_on(input.clone(), frame, self.loader.frame.clone(), self.loader.context().clone());
            let moving = PlayingInput::new(input, thread, Appearance::default());
            self.playing.streams.push(PlayingInput { layer: Some(layer), frame, ..moving });
            self.playing.clock.hold();
        }
    }

    /// Receives news of the streams.
    fn take_news(&mut self) {
        let news: Vec<_> = self.playing.streams.iter().map(|moving| moving.thread.news()).collect();
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
            if let Some((frame, cloud)) = news.cloud {
                self.show_frame(number, frame, &cloud, news.glance);
            }
        }
        for number in ended.into_iter().rev() {
            let moving = self.playing.streams.remove(number);
            match moving.layer {
                // The last points stay as an ordinary layer.
                Some(id) => self.settle(|document| document.complete(id)),
                None => self.fail(moving.input, moving.appearance),
            }
        }
    }

    /// Keeps the clock at the time of unsaved edits, since another frame would replace the edited points. Points of a
    /// stopped clock can be edited.
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
            self.playing.edited_at = Some(self.playing.clock.position());
            let name = self.document().layer(id).map(|layer| layer.name.clone()).unwrap_or_default();
            self.messages.note(format!("{name} has edits that are not saved; export or undo them to continue playing"));
        }
        let still = !self.playing.clock.playing;
        let changed = |id: &LayerId| self.document().layer(*id).is_some_and(|layer| layer.incomplete == still);
        if layers.iter().any(changed) {
            self.settle(|document| layers.iter().for_each(|&id| document.set_incomplete(id, !still)));
        }
    }

    /// Shows the points of a stream.
    fn show_frame(&mut self, number: usize, frame: Option<usize>, cloud: &Arc<PointCloud>, glance: Option<FirstLook>) {
        let moving = &self.playing.streams[number];
        match moving.layer {
            // These points were requested before the edit.
            Some(id) if self.history.is_unsaved(id) => return,
            Some(id) => self.fill(id, cloud),
            None if !cloud.has_finite(1) => return,
            None => {
                let known = || FirstLook::of(&moving.input, cloud, &Bits::default(), self.loader.frame.get());
                let glance = glance.unwrap_or_else(known);
                let PlayingInput { input, appearance, .. } = moving;
                let (input, appearance) = (input.clone(), *appearance);
                let id = self.add_layer(&input, cloud, appearance, self.playing.clock.playing);
                self.examined(id, glance);
                self.playing.streams[number].layer = Some(id);
            }
        }
        self.playing.streams[number].frame = frame;
    }
}
