//! What the user sees and touches around the picture: panels, tools and messages.

mod action;
mod commands;
mod gizmo;
mod keys;
pub(crate) mod panels;
mod pointer;
mod tools;

use eframe::egui;

pub(crate) use self::action::Action;
pub(crate) use self::commands::{Command, Tool};
pub(crate) use self::gizmo::Gizmo;
pub(crate) use self::keys::Keys;
pub(crate) use self::panels::{Panels, Pose};
pub(crate) use self::pointer::Pointer;
pub(crate) use self::tools::Tools;
use crate::messages::Messages;

/// Panels, tools and messages.
pub(crate) struct Ui {
    pub(crate) tools: Tools,
    pub(crate) panels: Panels,
    pub(crate) keys: Keys,
    pub(crate) pointer: Pointer,
    pub(crate) messages: Messages,
}

impl Ui {
    /// The window as it opens. `context` is asked for a repaint when a thread sends a message.
    pub(crate) fn new(context: &egui::Context) -> Self {
        Self {
            tools: Tools::default(),
            panels: Panels::default(),
            keys: Keys::default(),
            pointer: Pointer::default(),
            messages: Messages::new(context.clone()),
        }
    }
}
