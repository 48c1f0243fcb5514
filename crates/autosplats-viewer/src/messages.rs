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
    /// Messages from threads.
    post: (MessageSender, Receiver<Result<String, String>>),
    /// Why the last picture could not be rendered.
    failure: Option<String>,
}

/// Sends messages from a thread: a note, or an error.
#[derive(Clone)]
pub(crate) struct MessageSender {
    sender: Sender<Result<String, String>>,
    context: egui::Context,
}

impl MessageSender {
    /// Sends the result of some work.
    pub(crate) fn send(&self, message: Result<String, String>) {
        let _ = self.sender.send(message);
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
    /// No messages. `context` is asked for a repaint when a thread sends one.
    pub(crate) fn new(context: egui::Context) -> Self {
        let (sender, receiver) = channel();
        Self { list: Vec::new(), post: (MessageSender { sender, context }, receiver), failure: None }
    }

    /// A sender for a thread.
    pub(crate) fn sender(&self) -> MessageSender {
        self.post.0.clone()
    }

    pub(crate) fn note(&mut self, text: impl Into<String>) {
        self.push(text.into(), false);
    }

    pub(crate) fn error(&mut self, text: impl Into<String>) {
        self.push(text.into(), true);
    }

    fn push(&mut self, text: String, error: bool) {
        self.list.retain(|message| message.text != text);
        self.list.push(Message { text, error, since: None });
        let surplus = self.list.len().saturating_sub(MAX_MESSAGES);
        self.list.drain(..surplus);
    }

    /// Shows why there is no picture, until there is one.
    pub(crate) fn failure(&mut self, text: String) {
        self.failure = Some(text);
    }

    /// Removes the failure, as there is a picture again.
    pub(crate) fn forget_failure(&mut self) {
        self.failure = None;
    }

    /// Draws the messages in the lower left corner of `rect`.
    pub(crate) fn show(&mut self, context: &egui::Context, rect: egui::Rect) {
        let posted: Vec<_> = self.post.1.try_iter().collect();
        for message in posted {
            match message {
                Ok(note) => self.note(note),
                Err(error) => self.error(error),
            }
        }
        let now = context.input(|input| input.time);
        self.list.retain(|message| message.error || message.since.is_none_or(|since| now - since < NOTE_S));
        if self.list.is_empty() && self.failure.is_none() {
            return;
        }
        let corner = rect.left_bottom() + egui::vec2(10.0, -44.0);
        let area = egui::Area::new(egui::Id::unique("messages")).fixed_pos(corner).pivot(egui::Align2::LEFT_BOTTOM);
        area.order(egui::Order::Foreground).show(context, |ui| {
            ui.set_max_width((rect.width() - 20.0).clamp(100.0, 520.0));
            if let Some(failure) = &self.failure {
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
