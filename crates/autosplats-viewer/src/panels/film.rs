//! Turntables and ways of the camera, played and written.

use std::sync::{Arc, OnceLock};

use autosplats::{Camera, MAX_SIDE};
use autosplats_film::{Error, Target, has_ffmpeg};
use eframe::egui;

use super::target_file::{TargetFile, Words};
use crate::animation::{path, turntable};
use crate::app::App;
use crate::output;
use crate::recording::Recording;
use crate::threads::spawn;

/// What is being asked and what is being played.
pub(crate) struct Film {
    pub(crate) open: bool,
    keyed: bool,
    seconds: f64,
    degrees: f64,
    rate: u32,
    size: [u32; 2],
    target: TargetFile,
    /// How many pictures were not written because they would replace something.
    refused: Option<usize>,
    /// Whether films can be made, once it is known, and once somebody looks.
    ffmpeg: Option<Arc<OnceLock<bool>>>,
    /// Cameras that are being played, and when that began.
    played: Option<(Vec<Camera>, f64)>,
}

impl Film {
    /// Number of pictures.
    fn pictures(&self) -> usize {
        (self.seconds * f64::from(self.rate)).round().max(1.0) as usize
    }

    /// Whether films can be made; nobody has to wait for it, as it is found out beside the window.
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

/// Opens the window, or closes it.
pub(crate) fn toggle(app: &mut App) {
    app.panels.film.target.forget();
    app.panels.film.open = !app.panels.film.open;
}

pub(super) fn show(app: &mut App, context: &egui::Context) {
    play(app, context);
    if !app.panels.film.open {
        return;
    }
    let mut open = true;
    let window = egui::Window::new("Film").open(&mut open).collapsible(false).resizable(false);
    window.default_pos(app.view_rect.right_top() + egui::vec2(-410.0, 10.0)).show(context, |ui| {
        ui.set_width(380.0);
        if let Some(recording) = &app.recording {
            ui.add(egui::ProgressBar::new(recording.fraction()).show_percentage());
            if ui.button("Stop").clicked() {
                output::stop(&mut app.recording);
            }
            return;
        }
        way(app, ui);
        ui.separator();
        let ready = has_way(app);
        ui.horizontal(|ui| {
            let film = &mut app.panels.film;
            ui.add(egui::DragValue::new(&mut film.seconds).range(0.1..=600.0).speed(0.1).suffix(" s"));
            ui.add(egui::DragValue::new(&mut film.rate).range(1..=120).suffix(" pictures a second"));
            let playing = film.played.is_some();
            let button = ui.add_enabled(ready, egui::Button::new(if playing { "Stop" } else { "Play" }));
            if button.clicked() {
                let began = context.input(|input| input.time);
                app.panels.film.played = (!playing).then(|| (cameras(app), began));
            }
        });
        ui.separator();
        target(app, ui, ready);
    });
    app.panels.film.open = open;
}

/// Which way the camera goes.
fn way(app: &mut App, ui: &mut egui::Ui) {
    ui.horizontal(|ui| {
        ui.radio_value(&mut app.panels.film.keyed, false, "Turntable");
        ui.radio_value(&mut app.panels.film.keyed, true, "Through keys");
    });
    if !app.panels.film.keyed {
        ui.add(egui::Slider::new(&mut app.panels.film.degrees, -720.0..=720.0).suffix("°").text("turn"));
        return;
    }
    let here = app.navigation.goal_camera();
    let mut change = None;
    ui.horizontal(|ui| {
        if ui.button("Add this view").clicked() {
            change = Some((app.keys.len(), Some(here)));
        }
        ui.weak(format!("{} keys", app.keys.len()));
    });
    egui::ScrollArea::vertical().max_height(140.0).show(ui, |ui| {
        for number in 0..app.keys.len() {
            ui.horizontal(|ui| {
                if ui.link(format!("Key {}", number + 1)).on_hover_text("Go there").clicked() {
                    let camera = app.keys[number];
                    app.navigation.go_to(&camera, false);
                }
                if ui.small_button("Replace").on_hover_text("By the present view").clicked() {
                    app.keys[number] = here;
                }
                if ui.small_button("×").on_hover_text("Remove this key").clicked() {
                    change = Some((number, None));
                }
            });
        }
    });
    match change {
        Some((_, Some(camera))) => app.keys.push(camera),
        Some((number, None)) => {
            app.keys.remove(number);
        }
        None => {}
    }
}

/// Whether the film has cameras.
fn has_way(app: &App) -> bool {
    !app.document().layers.is_empty() && (!app.panels.film.keyed || !app.keys.is_empty())
}

/// The cameras of the film, up to tens of thousands.
fn cameras(app: &App) -> Vec<Camera> {
    let film = &app.panels.film;
    let pictures = film.pictures();
    if app.document().layers.is_empty() {
        Vec::new()
    } else if film.keyed {
        path(&app.keys, pictures)
    } else {
        turntable(&app.navigation.goal_camera(), app.up(), film.degrees, pictures)
    }
}

/// Where it goes, if it is `ready` to go anywhere.
fn target(app: &mut App, ui: &mut egui::Ui, ready: bool) {
    let context = ui.ctx().clone();
    let film = &mut app.panels.film;
    ui.horizontal(|ui| {
        ui.add(egui::DragValue::new(&mut film.size[0]).range(16..=MAX_SIDE).suffix(" px"));
        ui.label("×");
        ui.add(egui::DragValue::new(&mut film.size[1]).range(16..=MAX_SIDE).suffix(" px"));
    });
    let ffmpeg = film.has_ffmpeg(&context);
    let pictures = film.pictures();
    if film.refused.take_if(|refused| *refused != pictures).is_some() {
        film.target.forget();
    }
    let problem = match Target::new(&film.target.path()) {
        Err(Error::Name { why, .. }) => Some(why[..1].to_uppercase() + &why[1..]),
        Err(error) => Some(error.to_string()),
        Ok(Target::Film(_)) if ffmpeg == Some(false) => {
            Some("ffmpeg is not installed; a name that ends in .png writes the pictures".into())
        }
        Ok(_) if !ready => Some("There is no way to go yet".into()),
        Ok(_) => None,
    };
    let words = Words { title: "Save film", name: "film.mp4", verb: "Write" };
    let Some(write) = film.target.show(ui, &words, &mut app.panels.entered, problem) else { return };
    let Ok(target) = Target::new(&write.path) else { return };
    // Of pictures the system's dialog knows one name only.
    let there = target.existing(pictures).filter(|there| !(write.answered || write.replace && *there == write.path));
    if let Some(there) = there {
        film.target.refuse(&write.path, format!("{} is there already", there.display()), true);
        film.refused = Some(pictures);
        return;
    }
    film.target.forget();
    film.played = None;
    let (size, rate) = (film.size, film.rate);
    app.recording = Some(Recording::start(cameras(app), size, rate, target, &context));
}

/// Goes on with what is being played.
fn play(app: &mut App, context: &egui::Context) {
    let Some((cameras, began)) = &app.panels.film.played else { return };
    let picture = (context.input(|input| input.time) - began) * f64::from(app.panels.film.rate);
    match cameras.get(picture as usize) {
        Some(camera) => {
            let camera = *camera;
            app.navigation.go_to(&camera, true);
            app.stir();
            context.request_repaint();
        }
        None => app.panels.film.played = None,
    }
}
