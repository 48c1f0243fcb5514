//! Keys to commands, and commands to what is done.

use autosplats::cloud::Axes;
use autosplats::{Camera, ViewDirection};
use eframe::egui::{self, Event, Key, Modifiers};

use crate::app::App;
use crate::commands::{Command, Tool};
use crate::loading::Input;

/// Takes keys that egui would use itself: Tab, which otherwise goes from button to button, as long as none has the focus.
pub(crate) fn claim(app: &mut App, context: &egui::Context, input: &mut egui::RawInput) {
    if context.memory(|memory| memory.focused()).is_some() {
        return;
    }
    input.events.retain(|event| match event {
        Event::Key { key: Key::Tab, pressed, modifiers, .. } if modifiers.is_none() => {
            if *pressed {
                app.panels.claimed.push(Command::Dots);
            }
            false
        }
        _ => true,
    });
}

/// Does what keys ask for.
pub(crate) fn perform(app: &mut App, context: &egui::Context) {
    for command in std::mem::take(&mut app.panels.claimed) {
        run(app, context, command);
    }
    dropped(app, context);
    if context.egui_wants_keyboard_input() {
        return;
    }
    // The clipboard's keys come as events of their own.
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
        // Those with more modifiers first: the plain ones would match, too.
        commands.sort_by_key(|command| {
            let modifiers = command.shortcut().map_or(Modifiers::NONE, |shortcut| shortcut.modifiers);
            2 - u8::from(modifiers.shift) - u8::from(modifiers.command)
        });
        let clipboard = [Command::CopyView, Command::PasteView];
        let hit = |command: &Command| command.shortcut().is_some_and(|shortcut| input.consume_shortcut(&shortcut));
        let mut pressed: Vec<_> =
            commands.into_iter().filter(|command| !clipboard.contains(command)).filter(hit).collect();
        // '?' needs Shift on most keyboards.
        if input.events.iter().any(|event| matches!(event, Event::Text(text) if text == "?")) {
            pressed.push(Command::Help);
        }
        if input.consume_key(Modifiers::COMMAND, Key::Y) {
            pressed.push(Command::Redo);
        }
        if input.consume_key(Modifiers::NONE, Key::Backspace) {
            pressed.push(Command::DeleteSelected);
        }
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
            None => app.messages.error(format!("{}: this cannot be read from here", file.path().display())),
        }
    }
}

/// Has a command done.
pub(crate) fn run(app: &mut App, context: &egui::Context, command: Command) {
    match command {
        Command::Open => app.panels.dialogs.open(context),
        Command::Export => app.panels.export.open = true,
        Command::Screenshot => app.panels.picture.open = true,
        Command::Film => app.panels.film.open = !app.panels.film.open,
        Command::SaveState => app.panels.dialogs.save_state(context),
        Command::CloseAll => crate::panels::close_all(app),
        Command::Quit => context.send_viewport_cmd(egui::ViewportCommand::Close),
        Command::Undo => match app.undo() {
            Some(label) => app.messages.note(format!("Undone: {label}")),
            None => app.messages.note("There is nothing to undo"),
        },
        Command::Redo => match app.redo() {
            Some(label) => app.messages.note(format!("Done again: {label}")),
            None => app.messages.note("There is nothing to do again"),
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
            // Escape goes back a step each time: a window, what is being drawn, the tool, the selection.
            if app.panels.close_window() || app.tools.cancel() {
                return;
            }
            if app.tool == Tool::Navigate {
                app.change(|document| document.select_none());
            }
            app.tool = Tool::Navigate;
        }
        Command::HideSelected => app.edit_points("Hide", |document| document.hide_selected()),
        Command::ShowAll => app.edit_points("Show", |document| document.show_all()),
        Command::DeleteSelected => app.edit_points("Delete", |document| document.delete_selected()),
        Command::CropToSelected => app.edit_points("Crop away", |document| document.crop_to_selection()),
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
            let camera = app.navigation.goal_camera();
            let Camera { eye, look_at, .. } = camera;
            let up = app.up();
            // Turned about the vertical through the pivot; straight down becomes straight up.
            let away = eye - look_at;
            let eye = if away.reject_from(up).length() > 1e-3 * away.length() {
                look_at - away.reject_from(up) + away.project_onto(up)
            } else {
                look_at - away
            };
            app.navigation.go_to(&Camera { eye, ..camera }, false);
        }
        Command::Projection => app.navigation.toggle_projection(),
        Command::UpAxis => {
            app.up_axis = match app.up_axis {
                None => Some(Axes::ZUp),
                Some(Axes::ZUp) => Some(Axes::YUp),
                Some(Axes::YUp) => Some(Axes::Camera),
                Some(Axes::Camera) => None,
            };
            app.look_from(ViewDirection::Iso, false);
        }
        Command::Level => app.navigation.level(),
        Command::CopyView => {
            let camera = app.navigation.goal_camera();
            match serde_json::to_string_pretty(&camera) {
                Ok(text) => {
                    context.copy_text(text);
                    app.messages.note("The view was copied; 'autosplats render --camera' takes it, too");
                }
                Err(error) => app.messages.error(error.to_string()),
            }
        }
        Command::PasteView => context.send_viewport_cmd(egui::ViewportCommand::RequestPaste),
        Command::Dots => app.look.dots = !app.look.dots,
        Command::Inputs => app.panels.inputs = !app.panels.inputs,
        Command::Look => app.panels.look = !app.panels.look,
        Command::Statistics => app.panels.statistics = !app.panels.statistics,
        Command::Help => app.panels.help = !app.panels.help,
        Command::Tool(tool) => {
            app.tools.cancel();
            app.tool = tool;
        }
    }
}

/// Stands where a copied camera stood.
fn paste_view(app: &mut App, text: &str) {
    match serde_json::from_str::<Camera>(text).map_err(|error| error.to_string()) {
        Ok(camera) => match camera.check() {
            Ok(()) => app.navigation.go_to(&camera, false),
            Err(error) => app.messages.error(format!("The copied view cannot see: {error}")),
        },
        Err(_) => app.messages.note("What is on the clipboard is no view; Copy view puts one there"),
    }
}
