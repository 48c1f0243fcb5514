//! All attributes of a picked point, read by a thread of its own.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};

use autosplats::cloud::{Error, Progress};
use eframe::egui;

use crate::session::{Layer, PickedPoint};

/// The newest picked point of an octree.
#[derive(Default)]
pub(super) struct Inspection(Option<Reading>);

/// A point whose node is being read.
struct Reading {
    listener: Arc<Listener>,
    answer: Receiver<Result<PickedPoint, Error>>,
}

/// Cancels reading.
#[derive(Default)]
struct Listener(AtomicBool);

impl Progress for Listener {
    fn report(&self, _fraction: f32) {}

    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

impl Inspection {
    /// Starts to read a point's node.
    pub(super) fn start(&mut self, point: PickedPoint, layer: Layer, context: egui::Context) {
        let listener = Arc::new(Listener::default());
        let (sender, answer) = channel();
        let theirs = Arc::clone(&listener);
        crate::threads::spawn("inspect", move || {
            let _ = sender.send(point.with_attributes(&layer, &*theirs));
            context.request_repaint();
        });
        self.0 = Some(Reading { listener, answer });
    }

    /// Gives up the point in work.
    pub(super) fn stop(&mut self) {
        if let Some(reading) = self.0.take() {
            reading.listener.0.store(true, Ordering::Relaxed);
        }
    }

    /// The point, or why its attributes cannot be read, once that is known.
    pub(super) fn result(&mut self) -> Option<Result<PickedPoint, String>> {
        let result = self.0.as_ref()?.answer.try_recv().ok()?;
        self.0 = None;
        match result {
            Err(Error::Cancelled) => None,
            result => Some(result.map_err(|error| format!("the attributes of the point cannot be read: {error}"))),
        }
    }
}

impl Drop for Inspection {
    fn drop(&mut self) {
        self.stop();
    }
}
