//! What the user sees and touches around the picture: panels, tools and messages.

pub(crate) mod action;
pub(crate) mod commands;
pub(crate) mod gizmo;
pub(crate) mod keys;
pub(crate) mod panels;
pub(crate) mod pointer;
pub(crate) mod tools;

use eframe::egui;

use self::keys::Keys;
use self::panels::Panels;
use self::pointer::Pointer;
use self::tools::Tools;
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
