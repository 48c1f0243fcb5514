//! From keys to commands, and from commands to actions.

use autosplats::cloud::Axes;
use autosplats::cloud::glam::DVec3;
use autosplats::{Camera, ViewDirection};
use eframe::egui::{self, Event, Key, Modifiers};

use crate::app::App;
use crate::commands::{Command, Tool};
use crate::loading::Input;
use crate::panels;

/// Whether a menu or a modal question is open, which then receives all keys.
fn is_behind(context: &egui::Context) -> bool {
    context.memory(|memory| memory.top_modal_layer()).is_some() || egui::Popup::is_any_open(context)
}

/// Takes keys before egui does, which uses some of them itself. F6 moves the focus between parts of the window. Tab
/// moves between controls; while no control has the focus, Tab switches between points and surface.
pub(crate) fn claim(app: &mut App, context: &egui::Context, input: &mut egui::RawInput) {
    app.ui.panels.left = false;
    if is_behind(context) {
        return;
    }
    let focused = context.memory(|memory| memory.focused()).is_some();
    input.events.retain(|event| {
        let Event::Key { key, pressed, modifiers, .. } = event else { return true };
        let command = match key {
            Key::F6 if modifiers.is_none() => Command::NextPart,
            Key::F6 if modifiers.shift_only() => Command::PreviousPart,
            Key::Tab if modifiers.is_none() && !focused => Command::Dots,
            _ => {
                app.ui.panels.focus.by_keys |= *key == Key::Tab;
                app.ui.panels.entered |= *pressed && *key == Key::Enter && modifiers.is_none() && !focused;
                // Escape in a panel only returns the focus to the picture; in a dialog it closes the dialog.
                app.ui.panels.left |= *pressed && *key == Key::Escape && focused && !app.ui.panels.has_window();
                return true;
            }
        };
        if *pressed {
            app.ui.panels.claimed.push(command);
        }
        false
    });
}

/// Runs the commands of the keys that were pressed.
pub(crate) fn perform(app: &mut App, context: &egui::Context) {
    for command in std::mem::take(&mut app.ui.panels.claimed) {
        run(app, context, command);
    }
    dropped(app, context);
    if is_behind(context) || context.egui_wants_keyboard_input() {
        return;
    }
    // The clipboard's keys arrive as events of their own.
    let (copy, paste) = context.input(|input| {
        let copy = input.events.iter().any(|event| matches!(event, Event::Copy));
        let paste = input.events.iter().find_map(|event| match event {
            Event::Paste(text) => Some(text.clone()),
            _ => None,
        });
        (copy, paste)
    });
    if copy {
        run(app, context, Command::CopyView);
    }
    if let Some(text) = paste {
        paste_view(app, &text);
    }
    let pressed = context.input_mut(|input| {
        let mut commands = Command::ALL;
        // Shortcuts with more modifiers come first, since plain ones would match too.
        commands.sort_by_key(|command| {
            let modifiers = command.shortcut().map_or(Modifiers::NONE, |shortcut| shortcut.modifiers);
            2 - u8::from(modifiers.shift) - u8::from(modifiers.command)
        });
        let clipboard = [Command::CopyView, Command::PasteView];
        let left = app.ui.panels.left;
        let wanted = |command: &Command| !(clipboard.contains(command) || left && *command == Command::SelectNone);
        let hit = |command: &Command| command.shortcut().is_some_and(|shortcut| input.consume_shortcut(&shortcut));
        let mut pressed: Vec<_> = commands.into_iter().filter(wanted).filter(hit).collect();
        // '?' needs Shift on most keyboards.
        if input.events.iter().any(|event| matches!(event, Event::Text(text) if text == "?")) {
            pressed.push(Command::Help);
        }
        if input.consume_key(Modifiers::COMMAND, Key::Y) {
            pressed.push(Command::Redo);
        }
        if input.consume_key(Modifiers::NONE, Key::Backspace) && app.ui.tools.measured.pop().is_none() {
            pressed.push(Command::DeleteSelected);
        }
        // During a drag only Escape works, which cancels the drag.
        pressed.retain(|command| *command == Command::SelectNone || !app.ui.tools.gizmo.is_dragging());
        pressed
    });
    pressed.into_iter().for_each(|command| run(app, context, command));
}

/// Opens files that were dropped on the window.
fn dropped(app: &mut App, context: &egui::Context) {
    let files = context.input_mut(|input| std::mem::take(&mut input.raw.dropped_files));
    for file in files {
        match crate::files::dropped(&*file) {
            Some(path) => app.open(Input::file(path)),
            None => app.ui.messages.error(format!("{}: a dropped file needs a path", file.path().display())),
        }
    }
}

/// Runs a command.
pub(crate) fn run(app: &mut App, context: &egui::Context, command: Command) {
    match command {
        Command::Open => app.ui.panels.dialogs.open(context),
        Command::Export => panels::ask_for_export(app),
        Command::Screenshot => panels::ask_for_picture(app),
        Command::Film => panels::toggle_film(app),
        Command::SaveState => panels::ask_for_session(app),
        Command::CloseAll => {
            if app.document().layers.is_empty() {
                // Nothing can be undone, but inputs that are being read are cancelled.
                app.session.loader.cancel_all();
                app.session.playing.give_up_waiting();
            } else {
                panels::close_all(app);
            }
        }
        Command::Quit => context.send_viewport_cmd(egui::ViewportCommand::Close),
        Command::Undo => match app.undo() {
            Some(label) => app.ui.messages.note(format!("Undone: {label}")),
            None => app.ui.messages.note("There is nothing to undo"),
        },
        Command::Redo => match app.redo() {
            Some(label) => app.ui.messages.note(format!("Redone: {label}")),
            None => app.ui.messages.note("There is nothing to redo"),
        },
        Command::SelectAll | Command::InvertSelection => {
            if let Some(shown) = app.shown() {
                app.change(|document| {
                    if command == Command::SelectAll {
                        document.select_all(&shown);
                    } else {
                        document.select_inverse(&shown);
                    }
                });
            }
        }
        Command::SelectNone => {
            // Each Escape undoes one step: a drag, an open window, what the tool holds, the tool, the selection.
            let dragged = crate::gizmo::cancel(app) || app.ui.tools.cancel_drag();
            if dragged || app.ui.panels.close_window() || app.ui.tools.cancel() {
                return;
            }
            if app.ui.tool == Tool::Navigate {
                app.change(|document| document.select_none());
            }
            app.ui.tool = Tool::Navigate;
        }
        Command::HideSelected => app.edit_points("Hide", |document| document.hide_selected()),
        Command::ShowAll => app.edit_points("Show", |document| document.show_all()),
        Command::DeleteSelected => app.edit_points("Delete", |document| document.delete_selected()),
        Command::CropToSelected => app.edit_points("Crop away", |document| document.crop_to_selection()),
        Command::Clip => crate::gizmo::switch(app),
        Command::FitAll => {
            let cloud = app.document().overview();
            app.fit(&cloud);
        }
        Command::FitSelected => {
            let selected = app.document().selected_overview();
            let cloud = if selected.is_empty() { app.document().overview() } else { selected };
            app.fit(&cloud);
        }
        Command::View(ViewDirection::Auto) => app.first_view(),
        Command::View(direction) => app.look_from(direction, false),
        Command::OppositeView => {
            let camera = opposite(&app.view.navigation.goal_camera(), app.up());
            app.view.navigation.go_to(&camera, false);
        }
        Command::Projection => app.view.navigation.toggle_projection(),
        Command::UpAxis => {
            app.session.up_axis = match app.session.up_axis {
                None => Some(Axes::ZUp),
                Some(Axes::ZUp) => Some(Axes::YUp),
                Some(Axes::YUp) => Some(Axes::Camera),
                Some(Axes::Camera) => None,
            };
            app.look_from(ViewDirection::Iso, false);
        }
        Command::Level => app.view.navigation.level(),
        Command::CopyView => {
            let camera = app.view.navigation.goal_camera();
            match serde_json::to_string_pretty(&camera) {
                Ok(text) => {
                    context.copy_text(text);
                    app.ui.messages.note("The view was copied; 'autosplats render --camera' accepts it too");
                }
                Err(error) => app.ui.messages.error(error.to_string()),
            }
        }
        Command::PasteView => context.send_viewport_cmd(egui::ViewportCommand::RequestPaste),
        Command::Dots => app.view.look.dots = !app.view.look.dots,
        Command::Play => app.toggle_playing(),
        Command::StepBack => app.session.playing.step(false),
        Command::StepForward => app.session.playing.step(true),
        Command::PlayFromHere => app.session.playing.clock.begin_here(),
        Command::PlayToHere => app.session.playing.clock.end_here(),
        Command::Inputs => app.ui.panels.inputs = !app.ui.panels.inputs,
        Command::Look => app.ui.panels.look = !app.ui.panels.look,
        Command::Statistics => app.ui.panels.statistics = !app.ui.panels.statistics,
        Command::Help => app.ui.panels.help = !app.ui.panels.help,
        Command::NextPart => panels::focus_next_part(app, context, false),
        Command::PreviousPart => panels::focus_next_part(app, context, true),
        Command::Tool(tool) => {
            app.ui.tools.cancel();
            app.ui.tool = tool;
        }
    }
}

/// The camera turned by half a turn about the vertical through the point it looks at. A view straight down becomes one
/// straight up.
fn opposite(camera: &Camera, up: DVec3) -> Camera {
    let Camera { eye, look_at, .. } = *camera;
    let away = eye - look_at;
    let turned = |vector: DVec3| 2.0 * vector.project_onto(up) - vector;
    if away.reject_from(up).length() > 1e-3 * away.length() {
        Camera { eye: look_at + turned(away), up: turned(camera.up), ..*camera }
    } else {
        Camera { eye: look_at - away, ..*camera }
    }
}

/// Moves to a copied camera.
fn paste_view(app: &mut App, text: &str) {
    match serde_json::from_str::<Camera>(text).map_err(|error| error.to_string()) {
        Ok(camera) => match camera.check() {
            Ok(()) => app.view.navigation.go_to(&camera, false),
            Err(error) => app.ui.messages.error(format!("The copied view is invalid: {error}")),
        },
        Err(_) => app.ui.messages.note("The clipboard holds no view; Copy view puts one there"),
    }
}

#[cfg(test)]
mod tests;
