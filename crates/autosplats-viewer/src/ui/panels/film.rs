//! The dialog for films: turntables and camera paths, played and recorded.

use std::sync::{Arc, OnceLock};

use autosplats::{Camera, MAX_SIDE};
use autosplats_output::{Error, Target, has_ffmpeg};
use eframe::egui;

use super::target_file::{DialogTexts, TargetFile};
use crate::session::{Clock, Playing, Reel, Session};
use crate::threads::spawn;
use crate::ui::Action;
use crate::view::animation::{path, turntable};
use crate::view::{Recording, View};

/// Largest number of pictures of a film.
const MAX_PICTURES: f64 = 1e6;

/// State of the dialog and of the preview.
pub(crate) struct Film {
    pub(crate) open: bool,
    keyed: bool,
    time: Time,
    /// Length of the film, seconds, unless the timeline sets it.
    seconds: f64,
    degrees: f64,
    rate: u32,
    size: [u32; 2],
    target: TargetFile,
    /// Number of pictures of the refused film, which would have replaced a file.
    refused: Option<usize>,
    /// Whether ffmpeg is installed; `None` until somebody asks, unset until the answer is known.
    ffmpeg: Option<Arc<OnceLock<bool>>>,
    /// Moments of the preview, and the window time when it began, seconds.
    played: Option<(Vec<FilmPicture>, f64)>,
}

/// How time runs in a film.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Time {
    /// Time runs from the beginning of the span, for the length of the film.
    #[default]
    Runs,
    /// Time runs once through the span, which sets the length of the film.
    Once,
    /// Time stands still.
    Stands,
}

/// Camera and time of one picture.
#[derive(Clone, Copy, Debug)]
struct FilmPicture {
    camera: Camera,
    /// Clock position, where time runs.
    place: Option<f64>,
}

impl Film {
    /// Length of the film, seconds.
    fn seconds(&self, clock: Option<&Clock>) -> f64 {
        match clock {
            Some(clock) if self.time == Time::Once => {
                let [begin, end] = clock.span();
                (end - begin) / clock.speed
            }
            _ => self.seconds,
        }
    }

    /// Number of pictures; `clock` is that of the playing inputs.
    fn pictures(&self, clock: Option<&Clock>) -> usize {
        (self.seconds(clock) * f64::from(self.rate)).round().clamp(1.0, MAX_PICTURES) as usize
    }

    /// Stops the preview.
    #[cfg(test)]
    pub(crate) fn stop(&mut self) {
        self.played = None;
    }

    /// Sets half a second of ten small pictures per second, with a still camera.
    #[cfg(test)]
    pub(crate) fn still_for_tests(&mut self) {
        (self.seconds, self.rate, self.degrees, self.size) = (0.5, 10, 0.0, [64, 48]);
    }

    /// Whether ffmpeg is installed; `None` until known. A thread of its own finds out, so that nothing waits.
    fn has_ffmpeg(&mut self, context: &egui::Context) -> Option<bool> {
        let found = self.ffmpeg.get_or_insert_with(|| {
            let found = Arc::new(OnceLock::new());
            let (theirs, context) = (Arc::clone(&found), context.clone());
            spawn("ffmpeg", move || {
                theirs.get_or_init(has_ffmpeg);
                context.request_repaint();
            });
            found
        });
        found.get().copied()
    }
}

impl Default for Film {
    fn default() -> Self {
        Self {
            open: false,
            keyed: false,
            time: Time::default(),
            seconds: 8.0,
            degrees: 360.0,
            rate: 25,
            size: [1280, 720],
            target: TargetFile::new("turntable.mp4"),
            refused: None,
            ffmpeg: None,
            played: None,
        }
    }
}

impl Film {
    /// Opens or closes the window.
    pub(crate) fn toggle(&mut self) {
        self.target.forget();
        self.open = !self.open;
    }

    /// Continues the preview, and shows the window. `entered` says that Enter was pressed where no control takes it.
    pub(super) fn show(
        &mut self,
        context: &egui::Context,
        session: &Session,
        view: &View,
        entered: &mut bool,
        actions: &mut Vec<Action>,
    ) {
        self.play(context, actions);
        if !self.open {
            return;
        }
        let mut open = true;
        let window = egui::Window::new("Film").open(&mut open).collapsible(false).resizable(false);
        window.default_pos(view.rect.right_top() + egui::vec2(-410.0, 10.0)).show(context, |ui| {
            ui.set_width(380.0);
            if let Some(recording) = &view.recording {
                ui.add(egui::ProgressBar::new(recording.fraction()).show_percentage());
                if ui.button("Stop").clicked() {
                    actions.push(Action::StopRecording);
                }
                return;
            }
            self.way(ui, view, actions);
            self.choose_time(ui, &session.playing);
            ui.separator();
            let ready = self.has_cameras(session, view);
            ui.horizontal(|ui| {
                let given = self.clock(&session.playing).map(|clock| self.seconds(Some(clock)));
                match given.filter(|_| self.time == Time::Once) {
                    Some(mut seconds) => {
                        let number = egui::DragValue::new(&mut seconds).max_decimals(1).suffix(" s");
                        ui.add_enabled(false, number).on_disabled_hover_text("As long as the played span");
                    }
                    None => {
                        ui.add(egui::DragValue::new(&mut self.seconds).range(0.1..=600.0).speed(0.1).suffix(" s"));
                    }
                }
                ui.add(egui::DragValue::new(&mut self.rate).range(1..=120).suffix(" pictures a second"));
                let playing = self.played.is_some();
                let button = ui.add_enabled(ready, egui::Button::new(if playing { "Stop" } else { "Play" }));
                if button.clicked() {
                    let began = context.input(|input| input.time);
                    self.played = (!playing).then(|| (self.moments(session, view), began));
                }
            });
            ui.separator();
            let recording = self.target(ui, session, view, ready, entered);
            actions.extend(recording.map(|recording| Action::Record(Box::new(recording))));
        });
        self.open = open;
    }

    /// The choice of the camera path.
    fn way(&mut self, ui: &mut egui::Ui, view: &View, actions: &mut Vec<Action>) {
        ui.horizontal(|ui| {
            ui.radio_value(&mut self.keyed, false, "Turntable");
            ui.radio_value(&mut self.keyed, true, "Through keys");
        });
        if !self.keyed {
            ui.add(egui::Slider::new(&mut self.degrees, -720.0..=720.0).suffix("°").text("turn"));
            return;
        }
        let here = view.navigation.goal_camera();
        let mut keys = view.keys.clone();
        ui.horizontal(|ui| {
            if ui.button("Add this view").clicked() {
                keys.push(here);
            }
            ui.weak(format!("{} keys", view.keys.len()));
        });
        egui::ScrollArea::vertical().max_height(140.0).show(ui, |ui| {
            for (number, key) in view.keys.iter().enumerate() {
                ui.horizontal(|ui| {
                    if ui.link(format!("Key {}", number + 1)).on_hover_text("Go there").clicked() {
                        actions.push(Action::GoTo(*key));
                    }
                    if ui.small_button("Replace").on_hover_text("By the present view").clicked() {
                        keys[number] = here;
                    }
                    if ui.small_button("×").on_hover_text("Remove this key").clicked() {
                        keys.remove(number);
                    }
                });
            }
        });
        if keys != view.keys {
            actions.push(Action::SetKeys(keys));
        }
    }

    /// The choice of how time runs, if an input has a timeline.
    fn choose_time(&mut self, ui: &mut egui::Ui, playing: &Playing) {
        if !playing.has_timeline() {
            return;
        }
        ui.separator();
        let [begin, end] = playing.clock.span();
        let (speed, looped) = (playing.clock.speed, playing.clock.looped);
        ui.horizontal(|ui| {
            ui.label("Time");
            let time = &mut self.time;
            ui.radio_value(time, Time::Runs, "runs").on_hover_text("Playback continues for the length of the film");
            ui.radio_value(time, Time::Once, "runs once").on_hover_text("The film is as long as the played span");
            ui.radio_value(time, Time::Stands, "stands still").on_hover_text("All pictures show the present frame");
        });
        let around = if looped { ", repeatedly" } else { ", then standing still" };
        let around = if self.time == Time::Runs && self.seconds * speed > end - begin { around } else { "" };
        let words = match self.time {
            Time::Stands => format!("{:.2} s in all pictures", playing.clock.position()),
            _ => format!("{begin:.2} to {end:.2} s at {speed:.2}×{around}"),
        };
        ui.weak(words).on_hover_text("Begin, end, speed and loop are those of the timeline");
        if playing.is_live() {
            ui.weak("Live inputs stand still.");
        }
    }

    /// The clock, if time runs in the film.
    fn clock<'a>(&self, playing: &'a Playing) -> Option<&'a Clock> {
        let runs = self.time != Time::Stands && playing.has_timeline();
        runs.then_some(&playing.clock)
    }

    /// Whether the film has cameras.
    fn has_cameras(&self, session: &Session, view: &View) -> bool {
        !session.document().layers.is_empty() && (!self.keyed || !view.keys.is_empty())
    }

    /// Why the film cannot be made, if time is to run; `None` if it can.
    fn problem(&self, session: &Session) -> Option<String> {
        let clock = self.clock(&session.playing)?;
        let pictures = self.seconds(Some(clock)) * f64::from(self.rate);
        if pictures > MAX_PICTURES {
            return Some(format!(
                "The film has {pictures:.0} pictures, more than {MAX_PICTURES:.0}; play a part, or faster"
            ));
        }
        if let Some(waiting) = session.playing.waiting().next() {
            return Some(format!("{} has no points yet: {}", waiting.input.name, waiting.why));
        }
        let unsaved = session
            .history
            .unsaved()
            .find(|&id| session.playing.shows(id))
            .and_then(|id| session.document().layer(id))?;
        Some(format!("{} has unsaved edits of one frame; export or undo them, or let time stand still", unsaved.name))
    }

    /// The cameras of the film and their times, a million at most.
    fn moments(&self, session: &Session, view: &View) -> Vec<FilmPicture> {
        let clock = self.clock(&session.playing);
        let pictures = self.pictures(clock);
        let cameras = if session.document().layers.is_empty() {
            Vec::new()
        } else if self.keyed {
            path(&view.keys, pictures)
        } else {
            turntable(&view.navigation.goal_camera(), session.up(), self.degrees, pictures)
        };
        let place = |picture: usize| clock.map(|clock| clock.place_after(picture as f64 / f64::from(self.rate)));
        cameras.into_iter().enumerate().map(|(picture, camera)| FilmPicture { camera, place: place(picture) }).collect()
    }

    /// The output file. Returns the film, once it is to be written. `ready` says whether the film has cameras.
    fn target(
        &mut self,
        ui: &mut egui::Ui,
        session: &Session,
        view: &View,
        ready: bool,
        entered: &mut bool,
    ) -> Option<Recording> {
        let context = ui.ctx().clone();
        ui.horizontal(|ui| {
            ui.add(egui::DragValue::new(&mut self.size[0]).range(16..=MAX_SIDE).suffix(" px"));
            ui.label("×");
            ui.add(egui::DragValue::new(&mut self.size[1]).range(16..=MAX_SIDE).suffix(" px"));
        });
        let ffmpeg = self.has_ffmpeg(&context);
        let pictures = self.pictures(self.clock(&session.playing));
        let unready = self.problem(session);
        if self.refused.take_if(|refused| *refused != pictures).is_some() {
            self.target.forget();
        }
        let problem = match Target::new(&self.target.path()) {
            Err(Error::Name { why, .. }) => Some(why[..1].to_uppercase() + &why[1..]),
            Err(error) => Some(error.to_string()),
            Ok(Target::Film(_)) if ffmpeg == Some(false) => {
                Some("ffmpeg is not installed; a name that ends in .png writes the pictures".into())
            }
            Ok(_) if !ready => Some("There is no camera path yet".into()),
            Ok(_) => unready,
        };
        let words = DialogTexts { title: "Save film", name: "film.mp4", verb: "Write" };
        let write = self.target.show(ui, &words, entered, problem)?;
        let target = Target::new(&write.path).ok()?;
        // The system's dialog has asked about one name only, but a film of pictures has many.
        let there =
            target.existing(pictures).filter(|there| !(write.answered || write.replace && *there == write.path));
        if let Some(there) = there {
            self.target.refuse(&write.path, format!("{} exists already", there.display()), true);
            self.refused = Some(pictures);
            return None;
        }
        self.target.forget();
        self.played = None;
        let (size, rate) = (self.size, self.rate);
        let moments = self.moments(session, view);
        let cameras = moments.iter().map(|moment| moment.camera).collect();
        let places: Vec<f64> = moments.iter().filter_map(|moment| moment.place).collect();
        let runs = !places.is_empty();
        let reel =
            runs.then(|| Reel::start(session.playing.tracks(&places), session.messages.clone(), context.clone()));
        let wish = view.wish(session, size, false);
        Some(Recording::start(wish, cameras, reel, rate, target, &context))
    }

    /// Continues the preview.
    fn play(&mut self, context: &egui::Context, actions: &mut Vec<Action>) {
        let Some((moments, began)) = &self.played else { return };
        let picture = (context.input(|input| input.time) - began) * f64::from(self.rate);
        match moments.get(picture as usize) {
            Some(&FilmPicture { camera, place }) => {
                actions.push(Action::ShowMoment { camera, place });
                context.request_repaint();
            }
            None => self.played = None,
        }
    }
}
