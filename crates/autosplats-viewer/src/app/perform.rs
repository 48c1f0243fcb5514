//! The one place where commands and actions are performed.

use autosplats::cloud::glam::DMat4;
use autosplats::{Camera, ViewDirection};
use eframe::egui;

use super::App;
use crate::session::{Document, LayerId, refuse_edits};
use crate::ui::{Action, Command, Pose, Tool};

impl App {
    /// Performs all actions.
    pub(super) fn perform_all(&mut self, actions: Vec<Action>, context: &egui::Context) {
        if !actions.is_empty() {
            // What asked has been drawn already.
            context.request_repaint();
        }
        actions.into_iter().for_each(|action| self.perform(action, context));
    }

    /// Performs an action.
    fn perform(&mut self, action: Action, context: &egui::Context) {
        let Self { session, view, ui, .. } = self;
        match action {
            Action::Run(command) => self.run(command, context),
            Action::Open(input) => session.open(input),
            Action::OpenAgain(kept) => session.open_again(kept),
            Action::Reload(id) => session.reload_layer(id),
            Action::Keep(id, filter) => session.keep(id, filter),
            Action::GiveUpWaiting(number) => session.playing.give_up(number),
            Action::Remove(ids) => self.remove(ids),
            Action::RemoveEdited(ids) => session.remove(&ids),
            Action::SetVisible(id, visible) => session.settle(|document| document.set_visible(id, visible)),
            Action::ShowOnly(id) => session.settle(|document| {
                let ids: Vec<_> = document.layers.iter().map(|layer| layer.id).collect();
                for other in ids {
                    document.set_visible(other, other == id);
                }
            }),
            Action::SetTint(id, tint) => session.settle(|document| document.set_tint(id, tint)),
            Action::Rename(id, name) => session.edit("Rename an input", |document| document.rename(id, &name)),
            Action::Reorder(id, to) => session.edit("Reorder the inputs", |document| document.reorder(id, to)),
            Action::Place(id) => ui.panels.pose = session.document().layer(id).map(Pose::of),
            Action::PreviewPose { layer, pose } => {
                session.change(|document| document.set_pose(layer, pose));
            }
            Action::SettlePose { layer, before, made } => {
                session.change(|document| document.set_pose(layer, before));
                session.edit("Place an input", |document| document.set_pose(layer, made));
                view.measure_scene(session);
            }
            Action::PreviewClip(clip) => session.preview_clip(clip),
            Action::SettleClip => session.settle_clip(),
            Action::MoveSelected(way) => {
                let matrix = DMat4::from_translation(way);
                session.edit_points("Move", |document| document.move_selected(&matrix));
            }
            Action::TurnSelected { axis, radians } => {
                session.edit_points("Turn", |document| document.rotate_selected(axis, radians));
            }
            Action::MarkSaved { document, layers } => {
                layers.into_iter().for_each(|id| session.history.mark_saved(&document, id));
            }
            Action::SetClock(clock) => session.playing.clock = clock,
            Action::SetLook(look) => view.look = *look,
            Action::SetFov(fov_deg) => view.navigation.set_fov_deg(fov_deg),
            Action::Fit(id) => {
                let mut alone = Document::default();
                alone.layers.extend(session.document().layer(id).cloned());
                view.fit(session, &alone.overview());
            }
            Action::GoTo(camera) => view.navigation.go_to(&camera, false),
            Action::PasteView(text) => self.paste_view(&text),
            Action::SetKeys(keys) => view.keys = keys,
            Action::ShowMoment { camera, place } => {
                view.navigation.go_to(&camera, true);
                if let Some(place) = place {
                    session.playing.clock.playing = false;
                    session.playing.clock.seek(place);
                }
                view.note_movement();
            }
            Action::Record(recording) => view.recording = Some(*recording),
            Action::StopRecording => view.stop_recording(),
        }
    }

    /// Runs a command.
    pub(crate) fn run(&mut self, command: Command, context: &egui::Context) {
        let Self { session, view, ui, .. } = self;
        match command {
            Command::Open => ui.panels.dialogs.open(context),
            Command::Export => ui.panels.export.open(),
            Command::Screenshot => ui.panels.picture.open(),
            Command::Film => ui.panels.film.toggle(),
            Command::SaveState => ui.panels.session.open(session.file.as_deref()),
            Command::CloseAll => {
                session.give_up_waiting();
                let ids = session.document().layers.iter().map(|layer| layer.id).collect();
                self.remove(ids);
            }
            Command::Quit => context.send_viewport_cmd(egui::ViewportCommand::Close),
            Command::Undo => match session.undo() {
                Some(label) => session.messages.note(format!("Undone: {label}")),
                None => session.messages.note("There is nothing to undo"),
            },
            Command::Redo => match session.redo() {
                Some(label) => session.messages.note(format!("Redone: {label}")),
                None => session.messages.note("There is nothing to redo"),
            },
            Command::SelectAll | Command::InvertSelection => {
                if let Some(shown) = view.shown(session) {
                    if shown.hits_tree(|_| true) {
                        refuse_edits(&session.messages);
                    }
                    session.change(|document| {
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
                let dragged = ui.tools.gizmo.cancel(session) || ui.tools.cancel_drag();
                if dragged || ui.panels.close_window() || ui.tools.cancel() {
                    return;
                }
                if ui.tools.current == Tool::Navigate {
                    session.change(|document| document.select_none());
                }
                ui.tools.current = Tool::Navigate;
            }
            Command::HideSelected => session.edit_points("Hide", |document| document.hide_selected()),
            Command::ShowAll => session.show_all(),
            Command::DeleteSelected => session.edit_points("Delete", |document| document.delete_selected()),
            Command::CropToSelected => session.edit_points("Crop away", |document| document.crop_to_selection()),
            Command::Clip => match session.switch_clip() {
                Some(shown) => ui.tools.gizmo.clip = shown,
                None => session.messages.note("There are no points to clip"),
            },
            Command::FitAll => {
                let cloud = session.document().overview();
                view.fit(session, &cloud);
            }
            Command::FitSelected => {
                let selected = session.document().selected_overview();
                let cloud = if selected.is_empty() { session.document().overview() } else { selected };
                view.fit(session, &cloud);
            }
            Command::View(ViewDirection::Auto) => view.first_view(session),
            Command::View(direction) => view.look_from(session, direction, false),
            Command::OppositeView => view.turn_round(session),
            Command::Projection => view.navigation.toggle_projection(),
            Command::UpAxis => {
                session.change_up_axis();
                view.look_from(session, ViewDirection::Iso, false);
            }
            Command::Level => view.navigation.level(),
            Command::CopyView => {
                let camera = view.navigation.goal_camera();
                match serde_json::to_string_pretty(&camera) {
                    Ok(text) => {
                        context.copy_text(text);
                        session.messages.note("The view was copied; 'autosplats render --camera' accepts it too");
                    }
                    Err(error) => session.messages.error(error.to_string()),
                }
            }
            Command::PasteView => context.send_viewport_cmd(egui::ViewportCommand::RequestPaste),
            Command::Dots => view.look.dots = !view.look.dots,
            Command::Play => session.playing.clock.toggle(),
            Command::StepBack => session.playing.step(false),
            Command::StepForward => session.playing.step(true),
            Command::PlayFromHere => session.playing.clock.begin_here(),
            Command::PlayToHere => session.playing.clock.end_here(),
            Command::Inputs => ui.panels.inputs.open = !ui.panels.inputs.open,
            Command::Look => ui.panels.look = !ui.panels.look,
            Command::Statistics => ui.panels.statistics = !ui.panels.statistics,
            Command::Help => ui.panels.help = !ui.panels.help,
            Command::NextPart => ui.panels.focus.next_part(view.rect, context, false),
            Command::PreviousPart => ui.panels.focus.next_part(view.rect, context, true),
            Command::Tool(tool) => {
                ui.tools.cancel();
                ui.tools.current = tool;
            }
        }
    }

    /// Removes layers as an undo step. Asks first if edits would be lost.
    fn remove(&mut self, ids: Vec<LayerId>) {
        if ids.iter().any(|&id| self.session.history.is_unsaved(id)) {
            self.ui.panels.removal = ids;
        } else {
            self.session.remove(&ids);
        }
    }

    /// Moves to a copied camera.
    fn paste_view(&mut self, text: &str) {
        match serde_json::from_str::<Camera>(text).map_err(|error| error.to_string()) {
            Ok(camera) => match camera.check() {
                Ok(()) => self.view.navigation.go_to(&camera, false),
                Err(error) => self.session.messages.error(format!("The copied view is invalid: {error}")),
            },
            Err(_) => self.session.messages.note("The clipboard holds no view; Copy view puts one there"),
        }
    }
}
