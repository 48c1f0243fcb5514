//! Playing inputs: what the window does with them in each frame.

use std::sync::Arc;

use autosplats::cloud::PointCloud;
use autosplats_sources::Source;
use eframe::egui;

use super::thread::StreamThread;
use super::{PlayingInput, RemovedInput};
use crate::app::App;
use crate::document::{Layer, LayerId};
use crate::glance::FirstLook;
use crate::loading::{Appearance, Input};

impl App {
    /// Starts to play an input.
    pub(crate) fn play(&mut self, input: Input, appearance: Appearance, context: &egui::Context) {
        let thread = StreamThread::start(input.clone(), self.session.loader.frame.clone(), context.clone());
        self.session.playing.streams.push(PlayingInput::new(input, thread, appearance));
    }

    /// Opens the source of a layer again and plays it from the clock's position.
    pub(crate) fn play_anew(&mut self, id: LayerId, input: Input) {
        if matches!(input.source, Source::StandardInput) {
            self.ui.messages.note(format!("{}: an input from a pipe cannot be read again", input.name));
            return;
        }
        self.ui.messages.note(format!("{} is opened again", input.name));
        let thread = StreamThread::start(
            input.clone(),
            self.session.loader.frame.clone(),
            self.session.loader.context().clone(),
        );
        match self.session.playing.streams.iter_mut().find(|moving| moving.layer == Some(id)) {
            Some(moving) => (moving.thread, moving.frame) = (thread, None),
            None => {
                let moving = PlayingInput::new(input, thread, Appearance::default());
                self.session.playing.streams.push(PlayingInput { layer: Some(id), ..moving });
            }
        }
        self.session.playing.clock.hold();
    }

    /// Starts or stops playback.
    pub(crate) fn toggle_playing(&mut self) {
        self.session.playing.clock.toggle();
    }

    /// Advances the clock, requests the frames of the new time and receives points.
    pub(crate) fn follow_streams(&mut self, context: &egui::Context) {
        self.follow_layers(context);
        if self.session.playing.is_empty() {
            return;
        }
        let now = context.input(|input| input.time);
        let passed = self.session.playing.time.replace(now).map_or(0.0, |before| now - before);
        self.keep_edits();
        let playing = &mut self.session.playing;
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
        if self.session.playing.clock.runs() && self.session.playing.timelines().any(|(timeline, _)| timeline.len() > 1)
        {
            context.request_repaint();
        }
    }

    /// Stops the streams of removed layers, and restarts those of layers that undo has brought back. A restored layer
    /// is at the clock's time; if it has unsaved edits, the clock returns to their time.
    fn follow_layers(&mut self, context: &egui::Context) {
        let open: Vec<LayerId> = self.document().layers.iter().map(|layer| layer.id).collect();
        let position = self.session.playing.clock.position();
        let mut index = 0;
        while let Some(moving) = self.session.playing.streams.get(index) {
            match moving.layer.filter(|id| !open.contains(id)) {
                None => index += 1,
                Some(layer) => {
                    let PlayingInput { input, frame, .. } = self.session.playing.streams.remove(index);
                    self.session.playing.removed.push(RemovedInput { input, layer, frame, position });
                }
            }
        }
        if self.session.playing.removed.is_empty() {
            return;
        }
        let removed = std::mem::take(&mut self.session.playing.removed);
        let (back, gone): (Vec<_>, Vec<_>) = removed.into_iter().partition(|removed| open.contains(&removed.layer));
        self.session.playing.removed = gone;
        self.session.playing.removed.retain(|removed| self.session.history.holds(removed.layer));
        for RemovedInput { input, layer, frame, position } in back {
            // A pipe cannot be read again.
            if matches!(input.source, Source::StandardInput) {
                self.ui.messages.note(format!("{} was closed; its last points are shown", input.name));
                continue;
            }
            if self.session.history.is_unsaved(layer) {
                self.session.playing.edited_at.get_or_insert(position);
            }
            let thread = StreamThread::go_on(input.clone(), frame, self.session.loader.frame.clone(), context.clone());
            let moving = PlayingInput::new(input, thread, Appearance::default());
            self.session.playing.streams.push(PlayingInput { layer: Some(layer), frame, ..moving });
            self.session.playing.clock.hold();
        }
    }

    /// Receives news of the streams.
    fn take_news(&mut self) {
        let news: Vec<_> = self.session.playing.streams.iter().map(|moving| moving.thread.news()).collect();
        let mut ended = Vec::new();
        for (number, news) in news.into_iter().enumerate() {
            let name = self.session.playing.streams[number].input.name.clone();
            news.notes.into_iter().for_each(|note| self.ui.messages.note(format!("{name}: {note}")));
            if let Some(ending) = news.ending {
                match ending {
                    Ok(()) => self.ui.messages.note(format!("{name} has ended")),
                    Err(failure) => self.ui.messages.error(failure),
                }
                ended.push(number);
            }
            if let Some((frame, cloud)) = news.cloud {
                self.show_frame(number, frame, &cloud, news.glance);
            }
        }
        for number in ended.into_iter().rev() {
            let moving = self.session.playing.streams.remove(number);
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
        let layers: Vec<LayerId> = self.session.playing.streams.iter().filter_map(|moving| moving.layer).collect();
        let unsaved = layers.iter().find(|id| self.session.history.is_unsaved(**id)).copied();
        let position = self.session.playing.clock.position();
        let edited_at = unsaved.map(|_| self.session.playing.edited_at.unwrap_or(position));
        self.session.playing.edited_at = edited_at;
        let moves = self.session.playing.clock.playing || edited_at.is_some_and(|at| at != position);
        if let (Some(id), Some(at)) = (unsaved.filter(|_| moves), edited_at) {
            self.session.playing.clock.playing = false;
            self.session.playing.clock.seek(at);
            self.session.playing.edited_at = Some(self.session.playing.clock.position());
            let name = self.document().layer(id).map(|layer| layer.name.clone()).unwrap_or_default();
            self.ui
                .messages
                .note(format!("{name} has edits that are not saved; export or undo them to continue playing"));
        }
        let still = !self.session.playing.clock.playing;
        let changed = |id: &LayerId| self.document().layer(*id).is_some_and(|layer| layer.incomplete == still);
        if layers.iter().any(changed) {
            self.settle(|document| layers.iter().for_each(|&id| document.set_incomplete(id, !still)));
        }
    }

    /// Shows the points of a stream.
    fn show_frame(&mut self, number: usize, frame: Option<usize>, cloud: &Arc<PointCloud>, glance: Option<FirstLook>) {
        let moving = &self.session.playing.streams[number];
        match moving.layer {
            // These points were requested before the edit.
            Some(id) if self.session.history.is_unsaved(id) => return,
            Some(id) => self.fill(id, cloud),
            None if cloud.is_empty() => return,
            None => {
                let known = || FirstLook::of(&moving.input, cloud, self.frame());
                let glance = glance.unwrap_or_else(known);
                let PlayingInput { input, appearance, .. } = moving;
                let (input, appearance) = (input.clone(), *appearance);
                let path = input.source.path().map(std::path::Path::to_path_buf);
                let mut layer = Layer::new(&*input.name, path, Arc::clone(cloud)).opened_at(input.world_from_input);
                layer.incomplete = self.session.playing.clock.playing;
                Appearance { visible: layer.visible, tint: layer.tint } = appearance;
                let id = self.add_layer(layer, &input, glance);
                self.session.playing.streams[number].layer = Some(id);
            }
        }
        self.session.playing.streams[number].frame = frame;
    }
}
