//! From keys to commands.

use eframe::egui::{self, Event, Key, Modifiers};

use crate::session::Input;
use crate::ui::{Action, Command, Ui};

/// Keys taken from egui.
#[derive(Default)]
pub(crate) struct Keys {
    /// Commands whose keys were taken.
    claimed: Vec<Command>,
    /// Whether Escape has just returned the focus to the picture; that Escape then does nothing else.
    left: bool,
}

/// Whether a menu or a modal question is open, which then receives all keys.
fn is_behind(context: &egui::Context) -> bool {
    context.memory(|memory| memory.top_modal_layer()).is_some() || egui::Popup::is_any_open(context)
}

impl Ui {
    /// Takes keys before egui does, which uses some of them itself. F6 moves the focus between parts of the window. Tab
    /// moves between controls; while no control has the focus, Tab switches between points and surface.
    pub(crate) fn claim(&mut self, context: &egui::Context, input: &mut egui::RawInput) {
        let Self { keys, panels, .. } = self;
        keys.left = false;
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
                    panels.focus.by_keys |= *key == Key::Tab;
                    panels.entered |= *pressed && *key == Key::Enter && modifiers.is_none() && !focused;
                    // Escape in a panel only returns the focus to the picture; in a dialog it closes the dialog.
                    keys.left |= *pressed && *key == Key::Escape && focused && !panels.has_window();
                    return true;
                }
            };
            if *pressed {
                keys.claimed.push(command);
            }
            false
        });
    }

    /// The commands whose keys were taken from egui. They may move the keyboard focus, so that they come first.
    pub(crate) fn claimed(&mut self) -> Vec<Command> {
        std::mem::take(&mut self.keys.claimed)
    }

    /// What the other pressed keys and the dropped files ask for.
    pub(crate) fn pressed(&mut self, context: &egui::Context) -> Vec<Action> {
        let mut actions = self.dropped(context);
        if is_behind(context) || context.egui_wants_keyboard_input() {
            return actions;
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
        actions.extend(copy.then_some(Command::CopyView.into()));
        actions.extend(paste.map(Action::PasteView));
        let pressed = context.input_mut(|input| {
            let mut commands = Command::ALL;
            // Shortcuts with more modifiers come first, since plain ones would match too.
            commands.sort_by_key(|command| {
                let modifiers = command.shortcut().map_or(Modifiers::NONE, |shortcut| shortcut.modifiers);
                2 - u8::from(modifiers.shift) - u8::from(modifiers.command)
            });
            let clipboard = [Command::CopyView, Command::PasteView];
            let left = self.keys.left;
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
            if input.consume_key(Modifiers::NONE, Key::Backspace) && self.tools.measured.pop().is_none() {
                pressed.push(Command::DeleteSelected);
            }
            // During a drag only Escape works, which cancels the drag.
            pressed.retain(|command| *command == Command::SelectNone || !self.tools.gizmo.is_dragging());
            pressed
        });
        actions.extend(pressed.into_iter().map(Action::Run));
        actions
    }

    /// The files that were dropped on the window.
    fn dropped(&self, context: &egui::Context) -> Vec<Action> {
        let files = context.input_mut(|input| std::mem::take(&mut input.raw.dropped_files));
        let mut actions = Vec::new();
        for file in files {
            match crate::files::dropped(&*file) {
                Some(path) => actions.push(Action::Open(Input::file(path))),
                None => {
                    let text = format!("{}: a dropped file needs a path", file.path().display());
                    self.messages.sender().error(text);
                }
            }
        }
        actions
    }
}

#[cfg(test)]
mod tests;
