//! What the user sees and touches around the picture: panels, tools and messages.

use eframe::egui;

use crate::keys::Keys;
use crate::messages::Messages;
use crate::panels::Panels;
use crate::pointer::Pointer;
use crate::tools::Tools;

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
