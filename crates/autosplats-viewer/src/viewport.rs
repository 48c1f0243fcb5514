//! The picture in the window, and what the mouse does there.

use std::sync::Arc;

use autosplats::cloud::glam::{DVec2, DVec3};
use eframe::egui::{self, Color32, MouseWheelSource, PointerButton, Sense};

use crate::app::App;
use crate::commands::Tool;
use crate::look::TwoFingers;
use crate::render::Purpose;
use crate::screen::OnScreen;
use crate::{gizmo, legend, overlay, tools};

/// Zoom per point scrolled: natural logarithm of the factor.
const ZOOM_PER_SCROLL: f64 = 0.0024;

/// Shows the picture and handles the mouse.
pub(crate) fn show(app: &mut App, ui: &mut egui::Ui) {
    egui::CentralPanel::default().frame(egui::Frame::NONE).show(ui, |ui| {
        let rect = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(rect, Sense::CLICK | Sense::DRAG);
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Surface of the points"));
        let scale = ui.ctx().pixels_per_point();
        let side = |points: f32| ((points * scale).round() as u32).clamp(1, autosplats::MAX_SIDE);
        let size = [side(rect.width()), side(rect.height())];
        app.view.rect = rect;
        app.view.aspect = f64::from(size[0]) / f64::from(size[1]);
        let busy = handle(app, &response, size);
        app.ask(ui.ctx(), size, busy);
        let painter = ui.painter_at(rect);
        if let Some(picture) = &app.view.shot {
            if let Some(format) = app.view.format {
                let on_screen = OnScreen { image: Arc::clone(&picture.image), sharp: picture.dots, format };
                painter.add(eframe::egui_wgpu::Callback::new_paint_callback(rect, on_screen));
            }
        } else {
            painter.rect_filled(rect, 0.0, Color32::from_rgb(0x2b, 0x30, 0x37));
            if app.document().layers.is_empty()
                && app.session.loader.jobs().is_empty()
                && app.session.playing.is_empty()
            {
                welcome(app, ui, rect);
            } else if let Some(waiting) = app.session.playing.waiting().next() {
                let text = format!("{}: {}", waiting.input.name, waiting.why);
                let (font, color) = (egui::FontId::proportional(15.0), Color32::from_gray(190));
                painter.text(rect.center(), egui::Align2::CENTER_CENTER, text, font, color);
            }
        }
        tools::show(app, ui, rect, size);
        gizmo::show(app, ui, rect, size);
        if app.view.look.overlay {
            overlay::show(app, ui, rect);
        }
        legend::show(app, ui, rect);
        app.ui.messages.show(ui.ctx(), rect);
    });
}

/// Shows the welcome of an empty window.
fn welcome(app: &mut App, ui: &mut egui::Ui, rect: egui::Rect) {
    let mut chosen = None;
    let middle = egui::Rect::from_center_size(rect.center(), egui::vec2(360.0_f32.min(rect.width()), 320.0));
    ui.scope_builder(egui::UiBuilder::new().max_rect(middle), |ui| {
        ui.vertical_centered(|ui| {
            ui.heading("Drop point clouds here");
            ui.label("or open them with Ctrl+O. H shows all keys and mouse actions.");
            ui.add_space(12.0);
            if ui.button("Open…").clicked() {
                chosen = Some(None);
            }
            if !app.session.recent.is_empty() {
                ui.add_space(12.0);
                ui.weak("Recently opened");
            }
            for kept in app.session.recent.iter().take(8) {
                if ui.link(kept.short_name()).on_hover_text(&kept.source).clicked() {
                    chosen = Some(Some(kept.clone()));
                }
            }
        });
    });
    match chosen {
        Some(Some(kept)) => app.open_again(kept),
        Some(None) => crate::keys::run(app, &ui.ctx().clone(), crate::commands::Command::Open),
        None => {}
    }
}

/// Handles the pointer. Returns whether the pointer moves the view.
fn handle(app: &mut App, response: &egui::Response, size: [u32; 2]) -> bool {
    if gizmo::handle(app, response, size) {
        return true;
    }
    let rect = response.rect;
    let context = &response.ctx;
    let modifiers = context.input(|input| input.modifiers);
    // The way of the pointer before the drag was recognized belongs to the drag.
    let dragged = response.total_drag_delta().unwrap_or_default();
    let drag = if response.dragged() { dragged - app.ui.panels.dragged } else { egui::Vec2::ZERO };
    app.ui.panels.dragged = dragged;
    let drag = DVec2::new(drag.x.into(), drag.y.into()) / f64::from(rect.height().max(1.0));
    let mut busy = false;
    if response.drag_started() {
        let pressed = context.input(|input| input.pointer.press_origin()).or(response.interact_pointer_pos());
        app.ui.panels.grabbed = pressed.and_then(|place| under(app, rect, place)).map(|(_, depth)| depth);
        // Takes the keyboard focus from any control, so that keys fly.
        response.request_focus();
        response.surrender_focus();
    }
    let left = response.dragged_by(PointerButton::Primary);
    let turns = app.ui.tool == Tool::Navigate || !app.ui.tool.selects() || modifiers.alt;
    if left && turns && !modifiers.shift && !modifiers.command {
        app.view.navigation.orbit(drag);
        busy = true;
    } else if left && turns && modifiers.command {
        app.view.navigation.look(drag);
        busy = true;
    } else if response.dragged_by(PointerButton::Secondary) || left && turns && modifiers.shift {
        app.view.navigation.pan(drag, app.ui.panels.grabbed);
        busy = true;
    } else if response.dragged_by(PointerButton::Middle) {
        if app.ui.tool.selects() {
            app.view.navigation.orbit(drag);
        } else {
            app.view.navigation.pan(drag, app.ui.panels.grabbed);
        }
        busy = true;
    } else if app.ui.tool.selects() {
        tools::drag(app, response, size);
    }
    let pixel = |place: egui::Pos2| {
        let scale = size[0] as f32 / rect.width();
        [(place.x - rect.left()) * scale, (place.y - rect.top()) * scale]
    };
    if let Some(place) = response.interact_pointer_pos() {
        if response.double_clicked() && app.ui.tool != Tool::Measure {
            app.pick(size, pixel(place), Purpose::Pivot);
        } else if response.clicked() {
            match app.ui.tool {
                Tool::Inspect => app.pick(size, pixel(place), Purpose::Inspect),
                Tool::Measure => app.pick(size, pixel(place), Purpose::Measure),
                _ => {}
            }
        }
    }
    if response.hovered() {
        let (scroll, pinch) = context.input(|input| (input.smooth_scroll_delta(), input.zoom_delta()));
        app.ui.panels.fingers = context.input(|input| by_fingers(&input.events)).unwrap_or(app.ui.panels.fingers);
        let way = DVec2::new(scroll.x.into(), scroll.y.into()) / f64::from(rect.height().max(1.0));
        let fingers = app.ui.panels.fingers && way != DVec2::ZERO;
        let mut factor = f64::from(pinch);
        match app.view.look.two_fingers {
            TwoFingers::Orbit if fingers => app.view.navigation.orbit(way),
            TwoFingers::Pan if fingers => {
                let depth = context.pointer_hover_pos().and_then(|place| under(app, rect, place));
                app.view.navigation.pan(way, depth.map(|(_, depth)| depth));
            }
            _ => factor *= (f64::from(scroll.y) * ZOOM_PER_SCROLL).exp(),
        }
        if factor != 1.0 {
            let target = context.pointer_hover_pos().and_then(|place| zoom_target(app, context, rect, place));
            app.view.navigation.zoom(factor, target);
        }
        busy |= factor != 1.0 || way != DVec2::ZERO;
    }
    if let Some(touch) = context.multi_touch().filter(|_| response.contains_pointer()) {
        let drag = touch.translation_delta / rect.height();
        app.view.navigation.pan(DVec2::new(drag.x.into(), drag.y.into()), app.ui.panels.grabbed);
        busy = true;
    }
    busy
}

/// The start of a turn of the wheel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Zoomed {
    /// Time of the last click of the wheel, seconds.
    time: f64,
    place: egui::Pos2,
    world: DVec3,
}

/// The point that a wheel zooms to: the one under the pointer when the turn began, while the wheel turns and the
/// pointer stays. Pictures rendered meanwhile lag behind, and a GPU's moving pictures have no depths.
fn zoom_target(app: &mut App, context: &egui::Context, rect: egui::Rect, place: egui::Pos2) -> Option<DVec3> {
    /// Longest pause between clicks of one turn, seconds.
    const MAX_WHEEL_PAUSE_S: f64 = 0.4;
    /// Largest movement of the pointer that counts as staying, screen points.
    const MAX_TREMBLE_POINTS: f32 = 3.0;
    let time = context.input(|input| input.time);
    let last = app
        .ui
        .panels
        .zoomed
        .filter(|last| time - last.time < MAX_WHEEL_PAUSE_S && last.place.distance(place) < MAX_TREMBLE_POINTS);
    let world = last.map(|last| last.world).or_else(|| under(app, rect, place).map(|(world, _)| world));
    app.ui.panels.zoomed = world.map(|world| Zoomed { time, place, world });
    world
}

/// Whether fingers on a touchpad scroll, by the last event that tells. Where the system does not name the source,
/// scrolling in pixels means fingers; X11 scrolls in lines for both.
fn by_fingers(events: &[egui::Event]) -> Option<bool> {
    events.iter().rev().find_map(|event| match event {
        egui::Event::MouseWheel { source: MouseWheelSource::Trackpad | MouseWheelSource::Momentum, .. } => Some(true),
        egui::Event::MouseWheel { source: MouseWheelSource::Wheel, .. } => Some(false),
        egui::Event::MouseWheel { unit, .. } => Some(*unit == egui::MouseWheelUnit::Point),
        _ => None,
    })
}

/// World position and depth under a position in the window: on the surface where there is one, else at the depth of the
/// pivot.
fn under(app: &App, rect: egui::Rect, place: egui::Pos2) -> Option<(DVec3, f64)> {
    let share =
        DVec2::new(((place.x - rect.left()) / rect.width()).into(), ((place.y - rect.top()) / rect.height()).into());
    let camera = app.view.navigation.camera();
    let picture = app.view.shot.as_ref();
    let surface = picture.and_then(|picture| picture.depths.world(&picture.camera, share));
    let [_, _, forward] = camera.axes().ok()?;
    let world = surface.or_else(|| {
        let depth = forward.dot(camera.look_at - camera.eye);
        let size = [1000.0 * app.view.aspect, 1000.0].map(|side| side.round().max(1.0) as u32);
        camera.unproject(share * DVec2::new(size[0].into(), size[1].into()), depth, size).ok()
    })?;
    Some((world, forward.dot(world - camera.eye)))
}
