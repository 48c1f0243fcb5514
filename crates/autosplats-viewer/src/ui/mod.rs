//! What the user sees and touches around the picture: panels, tools and messages.

use eframe::egui;

use crate::commands::Tool;
use crate::messages::Messages;
use crate::panels::Panels;
use crate::tools::Tools;

/// Panels, tools and messages.
pub(crate) struct Ui {
    pub(crate) tool: Tool,
    pub(crate) tools: Tools,
    pub(crate) panels: Panels,
    pub(crate) messages: Messages,
    pub(crate) quit: bool,
}

impl Ui {
    /// The window as it opens. `context` is asked for a repaint when a thread sends a message.
    pub(crate) fn new(context: &egui::Context) -> Self {
        Self {
            tool: Tool::default(),
            tools: Tools::default(),
            panels: Panels::default(),
            messages: Messages::new(context.clone()),
            quit: false,
        }
    }
}
