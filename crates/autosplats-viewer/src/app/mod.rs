//! The application: the work of each window frame. Nothing else sees all of it.

mod perform;
mod picture;

use std::cell::RefCell;
use std::rc::Rc;

use eframe::egui;

use crate::Options;
use crate::session::{Session, StoredInput, refuse_edits};
use crate::ui::Ui;
use crate::view::{Look, Outcome, Purpose, State, View, storage};

/// The state of the viewer.
pub(crate) struct App {
    pub(crate) session: Session,
    pub(crate) view: View,
    pub(crate) ui: Ui,
    /// Why the session could not be written at the end.
    pub(crate) unsaved: Rc<RefCell<Option<String>>>,
}

impl App {
    /// Creates the application and starts to read the inputs of `options`. `context` belongs to the window.
    pub(crate) fn new(options: Options, look: Look, recent: Vec<StoredInput>, context: &egui::Context) -> Self {
        let ui = Ui::new(context);
        let messages = ui.messages.sender();
        let session = Session::new(options.state, options.watch, recent, options.trees, messages.clone(), context);
        let view = View::new(look, session.trees.handle(), messages, context);
        let mut app = Self { session, view, ui, unsaved: Rc::default() };
        if let Some(backend) = options.backend {
            app.view.look.backend = backend;
        }
        options.inputs.into_iter().for_each(|input| app.session.open(input));
        app
    }

    /// Receives what the threads have sent.
    fn receive(&mut self, context: &egui::Context) {
        let now = context.input(|input| input.time);
        let arrival = self.session.follow(now);
        self.view.follow(&self.session, arrival);
        self.view.receive(now).into_iter().for_each(|outcome| self.done(outcome));
        if let Some(point) = self.session.inspected() {
            self.ui.tools.complete(point);
        }
    }

    /// Applies the outcome of a task.
    fn done(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Picked { purpose: Purpose::Pivot, point } => {
                if let Some(seen) = point {
                    self.view.navigation.set_pivot(seen.surface);
                }
            }
            Outcome::Picked { purpose, point } => self.ui.tools.picked(&mut self.session, purpose, point),
            Outcome::Selected { shown, hits, mode } => {
                if shown.hits_tree(|i| hits[i]) {
                    refuse_edits(&self.session.messages);
                }
                self.session.change(|document| document.select(&shown, |i| hits[i], mode));
            }
            Outcome::Photographed { image, range, goal } => self.view.photographed(*image, range, goal),
        }
    }

    /// Runs the commands of the keys that were pressed.
    pub(crate) fn keys(&mut self, context: &egui::Context) {
        self.ui.claimed().into_iter().for_each(|command| self.run(command, context));
        let actions = self.ui.pressed(context);
        self.perform_all(actions, context);
    }

    /// Counts the points for the panels, except during a drag that changes them.
    fn count(&mut self) {
        if !self.ui.tools.gizmo.is_dragging() {
            self.session.count();
        }
    }
}

impl eframe::App for App {
    fn raw_input_hook(&mut self, context: &egui::Context, input: &mut egui::RawInput) {
        self.ui.claim(context, input);
    }

    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        let context = ui.ctx().clone();
        self.receive(&context);
        self.keys(&context);
        self.count();
        let Ui { panels, tools, .. } = &mut self.ui;
        let actions = panels.beside(ui, &self.session, &self.view, tools);
        self.perform_all(actions, &context);
        self.picture(ui);
        self.count();
        let Ui { panels, tools, .. } = &mut self.ui;
        let actions = panels.over(&context, &self.session, &self.view, tools);
        self.perform_all(actions, &context);
        self.view.record();
        if let Some(outcome) = self.view.take_turns(&self.session, &context) {
            self.done(outcome);
        }
        if self.ui.panels.quit {
            context.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        storage::save(&self.session, &self.view, storage);
    }

    fn on_exit(&mut self) {
        if let Some(path) = &self.session.file
            && let Err(error) = State::of(&self.session, &self.view).write(path)
        {
            *self.unsaved.borrow_mut() = Some(error);
        }
    }
}
