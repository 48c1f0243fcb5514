//! Messages to the user, over the picture. Errors stay until they are closed; notes disappear by themselves.

use std::sync::mpsc::{Receiver, Sender, channel};

use eframe::egui;

/// Seconds that a note is shown.
const NOTE_S: f64 = 8.0;
/// Number of messages kept; the oldest are dropped first.
const MAX_MESSAGES: usize = 6;

/// The messages that are shown.
pub(crate) struct Messages {
    list: Vec<Message>,
    sender: MessageSender,
    receiver: Receiver<Message>,
}

/// Sends messages, from any thread.
#[derive(Clone)]
pub(crate) struct MessageSender {
    sender: Sender<Message>,
    context: egui::Context,
}

impl MessageSender {
    /// Sends a note, which disappears by itself.
    pub(crate) fn note(&self, text: impl Into<String>) {
        self.send(text.into(), false);
    }

    /// Sends an error, which stays until the user closes it.
    pub(crate) fn error(&self, text: impl Into<String>) {
        self.send(text.into(), true);
    }

    /// Sends the result of some work: a note, or an error.
    pub(crate) fn result(&self, result: Result<String, String>) {
        match result {
            Ok(note) => self.note(note),
            Err(error) => self.error(error),
        }
    }

    fn send(&self, text: String, error: bool) {
        // The receiver is gone once the window is closed.
        let _ = self.sender.send(Message { text, error, since: None });
        self.context.request_repaint();
    }
}

struct Message {
    text: String,
    error: bool,
    /// Time when the message was first shown, seconds.
    since: Option<f64>,
}

impl Messages {
    /// No messages. `context` is asked for a repaint with each one.
    pub(crate) fn new(context: egui::Context) -> Self {
        let (sender, receiver) = channel();
        Self { list: Vec::new(), sender: MessageSender { sender, context }, receiver }
    }

    /// A sender of messages.
    pub(crate) fn sender(&self) -> MessageSender {
        self.sender.clone()
    }

    fn receive(&mut self) {
        for message in self.receiver.try_iter() {
            self.list.retain(|known| known.text != message.text);
            self.list.push(message);
            let surplus = self.list.len().saturating_sub(MAX_MESSAGES);
            self.list.drain(..surplus);
        }
    }

    /// Draws the messages in the lower left corner of `rect`, and above them why there is no picture.
    pub(crate) fn show(&mut self, context: &egui::Context, rect: egui::Rect, failure: Option<&str>) {
        self.receive();
        let now = context.input(|input| input.time);
        self.list.retain(|message| message.error || message.since.is_none_or(|since| now - since < NOTE_S));
        if self.list.is_empty() && failure.is_none() {
            return;
        }
        let corner = rect.left_bottom() + egui::vec2(10.0, -44.0);
        let area = egui::Area::new(egui::Id::unique("messages")).fixed_pos(corner).pivot(egui::Align2::LEFT_BOTTOM);
        area.order(egui::Order::Foreground).show(context, |ui| {
            ui.set_max_width((rect.width() - 20.0).clamp(100.0, 520.0));
            if let Some(failure) = failure {
                egui::Frame::popup(ui.style()).show(ui, |ui| {
                    ui.colored_label(ui.visuals().error_fg_color, failure);
                });
            }
            let mut closed = None;
            for (number, message) in self.list.iter_mut().enumerate() {
                message.since.get_or_insert(now);
                egui::Frame::popup(ui.style()).show(ui, |ui| {
                    ui.horizontal(|ui| {
                        if ui.small_button("×").on_hover_text("Close this message").clicked() {
                            closed = Some(number);
                        }
                        let color = if message.error { ui.visuals().error_fg_color } else { ui.visuals().text_color() };
                        ui.add(egui::Label::new(egui::RichText::new(&message.text).color(color)).wrap());
                    });
                });
            }
            if let Some(number) = closed {
                self.list.remove(number);
            }
        });
        if self.list.iter().any(|message| !message.error) {
            context.request_repaint_after(std::time::Duration::from_millis(500));
        }
    }
}
