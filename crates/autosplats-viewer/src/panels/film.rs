//! The dialog for films: turntables and camera paths, played and recorded.

use std::sync::{Arc, OnceLock};

use autosplats::{Camera, MAX_SIDE};
use autosplats_film::{Error, Target, has_ffmpeg};
use eframe::egui;

use super::target_file::{DialogTexts, TargetFile};
use crate::animation::{path, turntable};
use crate::app::App;
use crate::output;
use crate::playing::{Clock, Reel};
use crate::recording::Recording;
use crate::threads::spawn;

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

pub(crate) fn toggle(app: &mut App) {
    app.ui.panels.film.target.forget();
    app.ui.panels.film.open = !app.ui.panels.film.open;
}

pub(super) fn show(app: &mut App, context: &egui::Context) {
    play(app, context);
    if !app.ui.panels.film.open {
        return;
    }
    let mut open = true;
    let window = egui::Window::new("Film").open(&mut open).collapsible(false).resizable(false);
    window.default_pos(app.view.rect.right_top() + egui::vec2(-410.0, 10.0)).show(context, |ui| {
        ui.set_width(380.0);
        if let Some(recording) = &app.view.recording {
            ui.add(egui::ProgressBar::new(recording.fraction()).show_percentage());
            if ui.button("Stop").clicked() {
                output::stop(&mut app.view.recording);
            }
            return;
        }
        way(app, ui);
        time(app, ui);
        ui.separator();
        let ready = has_cameras(app);
        ui.horizontal(|ui| {
            let given = clock(app).map(|clock| app.ui.panels.film.seconds(Some(clock)));
            let film = &mut app.ui.panels.film;
            match given.filter(|_| film.time == Time::Once) {
                Some(mut seconds) => {
                    let number = egui::DragValue::new(&mut seconds).max_decimals(1).suffix(" s");
                    ui.add_enabled(false, number).on_disabled_hover_text("As long as the played span");
                }
                None => {
                    ui.add(egui::DragValue::new(&mut film.seconds).range(0.1..=600.0).speed(0.1).suffix(" s"));
                }
            }
            ui.add(egui::DragValue::new(&mut film.rate).range(1..=120).suffix(" pictures a second"));
            let playing = film.played.is_some();
            let button = ui.add_enabled(ready, egui::Button::new(if playing { "Stop" } else { "Play" }));
            if button.clicked() {
                let began = context.input(|input| input.time);
                app.ui.panels.film.played = (!playing).then(|| (moments(app), began));
            }
        });
        ui.separator();
        target(app, ui, ready);
    });
    app.ui.panels.film.open = open;
}

/// The choice of the camera path.
fn way(app: &mut App, ui: &mut egui::Ui) {
    ui.horizontal(|ui| {
        ui.radio_value(&mut app.ui.panels.film.keyed, false, "Turntable");
        ui.radio_value(&mut app.ui.panels.film.keyed, true, "Through keys");
    });
    if !app.ui.panels.film.keyed {
        ui.add(egui::Slider::new(&mut app.ui.panels.film.degrees, -720.0..=720.0).suffix("°").text("turn"));
        return;
    }
    let here = app.view.navigation.goal_camera();
    let mut change = None;
    ui.horizontal(|ui| {
        if ui.button("Add this view").clicked() {
            change = Some((app.view.keys.len(), Some(here)));
        }
        ui.weak(format!("{} keys", app.view.keys.len()));
    });
    egui::ScrollArea::vertical().max_height(140.0).show(ui, |ui| {
        for number in 0..app.view.keys.len() {
            ui.horizontal(|ui| {
                if ui.link(format!("Key {}", number + 1)).on_hover_text("Go there").clicked() {
                    let camera = app.view.keys[number];
                    app.view.navigation.go_to(&camera, false);
                }
                if ui.small_button("Replace").on_hover_text("By the present view").clicked() {
                    app.view.keys[number] = here;
                }
                if ui.small_button("×").on_hover_text("Remove this key").clicked() {
                    change = Some((number, None));
                }
            });
        }
    });
    match change {
        Some((_, Some(camera))) => app.view.keys.push(camera),
        Some((number, None)) => {
            app.view.keys.remove(number);
        }
        None => {}
    }
}

/// The choice of how time runs, if an input has a timeline.
fn time(app: &mut App, ui: &mut egui::Ui) {
    if !app.session.playing.has_timeline() {
        return;
    }
    ui.separator();
    let [begin, end] = app.session.playing.clock.span();
    let (speed, looped) = (app.session.playing.clock.speed, app.session.playing.clock.looped);
    ui.horizontal(|ui| {
        ui.label("Time");
        let time = &mut app.ui.panels.film.time;
        ui.radio_value(time, Time::Runs, "runs").on_hover_text("Playback continues for the length of the film");
        ui.radio_value(time, Time::Once, "runs once").on_hover_text("The film is as long as the played span");
        ui.radio_value(time, Time::Stands, "stands still").on_hover_text("All pictures show the present frame");
    });
    let film = &app.ui.panels.film;
    let around = if looped { ", repeatedly" } else { ", then standing still" };
    let around = if film.time == Time::Runs && film.seconds * speed > end - begin { around } else { "" };
    let words = match film.time {
        Time::Stands => format!("{:.2} s in all pictures", app.session.playing.clock.position()),
        _ => format!("{begin:.2} to {end:.2} s at {speed:.2}×{around}"),
    };
    ui.weak(words).on_hover_text("Begin, end, speed and loop are those of the timeline");
    if app.session.playing.is_live() {
        ui.weak("Live inputs stand still.");
    }
}

/// The clock, if time runs in the film.
fn clock(app: &App) -> Option<&Clock> {
    let runs = app.ui.panels.film.time != Time::Stands && app.session.playing.has_timeline();
    runs.then_some(&app.session.playing.clock)
}

/// Whether the film has cameras.
fn has_cameras(app: &App) -> bool {
    !app.document().layers.is_empty() && (!app.ui.panels.film.keyed || !app.view.keys.is_empty())
}

/// Why the film cannot be made, if time is to run; `None` if it can.
fn problem(app: &App) -> Option<String> {
    let clock = clock(app)?;
    let pictures = app.ui.panels.film.seconds(Some(clock)) * f64::from(app.ui.panels.film.rate);
    if pictures > MAX_PICTURES {
        return Some(format!(
            "The film has {pictures:.0} pictures, more than {MAX_PICTURES:.0}; play a part, or faster"
        ));
    }
    if let Some(waiting) = app.session.playing.waiting().next() {
        return Some(format!("{} has no points yet: {}", waiting.input.name, waiting.why));
    }
    let unsaved = app
        .session
        .history
        .unsaved()
        .find(|&id| app.session.playing.shows(id))
        .and_then(|id| app.document().layer(id))?;
    Some(format!("{} has unsaved edits of one frame; export or undo them, or let time stand still", unsaved.name))
}

/// The cameras of the film and their times, a million at most.
fn moments(app: &App) -> Vec<FilmPicture> {
    let (film, clock) = (&app.ui.panels.film, clock(app));
    let pictures = film.pictures(clock);
    let cameras = if app.document().layers.is_empty() {
        Vec::new()
    } else if film.keyed {
        path(&app.view.keys, pictures)
    } else {
        turntable(&app.view.navigation.goal_camera(), app.up(), film.degrees, pictures)
    };
    let place = |picture: usize| clock.map(|clock| clock.place_after(picture as f64 / f64::from(film.rate)));
    cameras.into_iter().enumerate().map(|(picture, camera)| FilmPicture { camera, place: place(picture) }).collect()
}

/// The output file. `ready` says whether the film has cameras.
fn target(app: &mut App, ui: &mut egui::Ui, ready: bool) {
    let context = ui.ctx().clone();
    let film = &mut app.ui.panels.film;
    ui.horizontal(|ui| {
        ui.add(egui::DragValue::new(&mut film.size[0]).range(16..=MAX_SIDE).suffix(" px"));
        ui.label("×");
        ui.add(egui::DragValue::new(&mut film.size[1]).range(16..=MAX_SIDE).suffix(" px"));
    });
    let ffmpeg = film.has_ffmpeg(&context);
    let pictures = app.ui.panels.film.pictures(clock(app));
    let unready = problem(app);
    let film = &mut app.ui.panels.film;
    if film.refused.take_if(|refused| *refused != pictures).is_some() {
        film.target.forget();
    }
    let problem = match Target::new(&film.target.path()) {
        Err(Error::Name { why, .. }) => Some(why[..1].to_uppercase() + &why[1..]),
        Err(error) => Some(error.to_string()),
        Ok(Target::Film(_)) if ffmpeg == Some(false) => {
            Some("ffmpeg is not installed; a name that ends in .png writes the pictures".into())
        }
        Ok(_) if !ready => Some("There is no camera path yet".into()),
        Ok(_) => unready,
    };
    let words = DialogTexts { title: "Save film", name: "film.mp4", verb: "Write" };
    let Some(write) = film.target.show(ui, &words, &mut app.ui.panels.entered, problem) else { return };
    let Ok(target) = Target::new(&write.path) else { return };
    // The system's dialog has asked about one name only, but a film of pictures has many.
    let there = target.existing(pictures).filter(|there| !(write.answered || write.replace && *there == write.path));
    if let Some(there) = there {
        film.target.refuse(&write.path, format!("{} exists already", there.display()), true);
        film.refused = Some(pictures);
        return;
    }
    film.target.forget();
    film.played = None;
    let (size, rate) = (film.size, film.rate);
    let moments = moments(app);
    let cameras = moments.iter().map(|moment| moment.camera).collect();
    let places: Vec<f64> = moments.iter().filter_map(|moment| moment.place).collect();
    let runs = !places.is_empty();
    let reel =
        runs.then(|| Reel::start(app.session.playing.tracks(&places), app.ui.messages.sender(), context.clone()));
    let wish = app.wish(size, false);
    app.view.recording = Some(Recording::start(wish, cameras, reel, rate, target, &context));
}

/// Continues the preview.
fn play(app: &mut App, context: &egui::Context) {
    let Some((moments, began)) = &app.ui.panels.film.played else { return };
    let picture = (context.input(|input| input.time) - began) * f64::from(app.ui.panels.film.rate);
    match moments.get(picture as usize) {
        Some(&FilmPicture { camera, place }) => {
            app.view.navigation.go_to(&camera, true);
            if let Some(place) = place {
                app.session.playing.clock.playing = false;
                app.session.playing.clock.seek(place);
            }
            app.note_movement();
            context.request_repaint();
        }
        None => app.ui.panels.film.played = None,
    }
}
