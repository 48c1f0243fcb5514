//! Turntables and ways of the camera, played and written.

use std::path::PathBuf;
use std::sync::mpsc::Receiver;

use autosplats::{Camera, MAX_SIDE};
use eframe::egui;

use crate::animation::{Recording, Target, has_ffmpeg, path, turntable};
use crate::app::App;
use crate::files::ask_for_output;
use crate::output;

/// What is being asked and what is being played.
pub(crate) struct Film {
    pub(crate) open: bool,
    keyed: bool,
    seconds: f64,
    degrees: f64,
    rate: u32,
    size: [u32; 2],
    name: String,
    chosen: Option<Receiver<Option<PathBuf>>>,
    replace: bool,
    /// Whether films can be made, once somebody has looked.
    ffmpeg: Option<bool>,
    /// Cameras that are being played, and when that began.
    played: Option<(Vec<Camera>, f64)>,
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
            name: "turntable.mp4".into(),
            chosen: None,
            replace: false,
            ffmpeg: None,
            played: None,
        }
    }
}

pub(super) fn show(app: &mut App, context: &egui::Context) {
    play(app, context);
    if let Some(Ok(chosen)) = app.panels.film.chosen.as_ref().map(Receiver::try_recv) {
        app.panels.film.chosen = None;
        if let Some(path) = chosen {
            app.panels.film.name = path.display().to_string();
        }
    }
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
        let cameras = cameras(app);
        ui.horizontal(|ui| {
            let film = &mut app.panels.film;
            ui.add(egui::DragValue::new(&mut film.seconds).range(0.1..=600.0).speed(0.1).suffix(" s"));
            ui.add(egui::DragValue::new(&mut film.rate).range(1..=120).suffix(" pictures a second"));
            let playing = film.played.is_some();
            let button = ui.add_enabled(!cameras.is_empty(), egui::Button::new(if playing { "Stop" } else { "Play" }));
            if button.clicked() {
                film.played = (!playing).then(|| (cameras.clone(), context.input(|input| input.time)));
            }
        });
        ui.separator();
        target(app, ui, cameras);
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

/// The cameras of the film.
fn cameras(app: &App) -> Vec<Camera> {
    let film = &app.panels.film;
    let pictures = (film.seconds * f64::from(film.rate)).round().max(1.0) as usize;
    if app.document().layers.is_empty() {
        Vec::new()
    } else if film.keyed {
        path(&app.keys, pictures)
    } else {
        turntable(&app.navigation.goal_camera(), app.up(), film.degrees, pictures)
    }
}

/// Where it goes.
fn target(app: &mut App, ui: &mut egui::Ui, cameras: Vec<Camera>) {
    let context = ui.ctx().clone();
    let film = &mut app.panels.film;
    ui.horizontal(|ui| {
        ui.add(egui::DragValue::new(&mut film.size[0]).range(16..=MAX_SIDE).suffix(" px"));
        ui.label("×");
        ui.add(egui::DragValue::new(&mut film.size[1]).range(16..=MAX_SIDE).suffix(" px"));
    });
    ui.horizontal(|ui| {
        if ui.add(egui::TextEdit::singleline(&mut film.name).desired_width(280.0).hint_text("film.mp4")).changed() {
            film.replace = false;
        }
        if ui.button("Browse…").clicked() && film.chosen.is_none() {
            film.chosen = Some(ask_for_output(&context, "Save film", "film.mp4"));
        }
    });
    let ffmpeg = *film.ffmpeg.get_or_insert_with(has_ffmpeg);
    let target = Target::new(&PathBuf::from(film.name.trim()));
    let problem = match &target {
        Err(problem) => Some(problem.clone()),
        Ok(Target::Film(_)) if !ffmpeg => {
            Some("ffmpeg is not installed; a name that ends in .png writes the pictures".into())
        }
        Ok(_) if cameras.is_empty() => Some("There is no way to go yet".into()),
        Ok(target) if !film.replace => {
            target.existing(cameras.len()).map(|path| format!("{} is there already", path.display()))
        }
        Ok(_) => None,
    };
    let mut start = false;
    if let Some(problem) = &problem {
        ui.colored_label(ui.visuals().warn_fg_color, problem);
    }
    ui.horizontal(|ui| {
        start = ui.add_enabled(problem.is_none(), egui::Button::new("Write")).clicked();
        let there = target.as_ref().is_ok_and(|target| target.existing(cameras.len()).is_some());
        if there && !film.replace && ui.button("Replace it").clicked() {
            film.replace = true;
        }
    });
    if let (true, Ok(target)) = (start, target) {
        film.replace = false;
        film.played = None;
        let (size, rate) = (film.size, film.rate);
        app.recording = Some(Recording::start(cameras, size, rate, target, &context));
    }
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
