//! The moving points of a film.
//!
//! A thread opens all inputs again, so that the film does not depend on what the window plays meanwhile. It reads the
//! frames of the next picture ahead.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};

use autosplats::cloud::{Error, PointCloud, Progress};
use autosplats_sources::Player;
use eframe::egui;

use crate::messages::MessageSender;
use crate::session::{Input, LayerId, read_options};

/// Pictures whose points are read ahead, besides the one in work.
const AHEAD: usize = 1;

/// An input of a film, and the frame of its timeline for each picture.
pub(crate) struct Track {
    pub(crate) layer: LayerId,
    pub(crate) input: Input,
    pub(crate) frames: Vec<usize>,
}

/// The layers that change from one picture to the next, and their new points.
pub(crate) type PictureChanges = Vec<(LayerId, Arc<PointCloud>)>;

/// Reads the points of a film, picture by picture.
pub(crate) struct Reel {
    changes: Receiver<Result<PictureChanges, String>>,
    cancelled: Arc<AtomicBool>,
}

impl Reel {
    /// Starts to read. Notes go to `mail`; `context` is asked for a repaint when points are ready for a picture.
    pub(crate) fn start(tracks: Vec<Track>, mail: MessageSender, context: egui::Context) -> Self {
        let (sender, changes) = sync_channel(AHEAD);
        let cancelled = Arc::new(AtomicBool::new(false));
        let theirs = Arc::clone(&cancelled);
        crate::threads::spawn("reel", move || {
            let send = |changes| {
                let wanted = sender.send(changes).is_ok();
                context.request_repaint();
                wanted
            };
            let work = std::panic::AssertUnwindSafe(|| read(&tracks, &mail, &theirs, &|changes| send(Ok(changes))));
            let ended = std::panic::catch_unwind(work);
            match ended {
                Ok(Ok(()) | Err(Error::Cancelled)) => {}
                Ok(Err(error)) => {
                    send(Err(error.to_string()));
                }
                Err(_) => {
                    send(Err("reading the film's points failed, which is a bug in this program".into()));
                }
            }
        });
        Self { changes, cancelled }
    }

    /// The changes for the next picture; `None` while they are being read.
    ///
    /// # Errors
    /// Why there are no more pictures.
    pub(crate) fn next(&self) -> Result<Option<PictureChanges>, String> {
        match self.changes.try_recv() {
            Ok(changes) => changes.map(Some),
            Err(TryRecvError::Empty) => Ok(None),
            // All results have been received.
            Err(TryRecvError::Disconnected) => Err("the film has no more pictures".into()),
        }
    }
}

impl Drop for Reel {
    fn drop(&mut self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }
}

/// Receives progress and notes from a reader.
struct Follower<'a> {
    input: &'a Input,
    mail: &'a MessageSender,
    cancelled: &'a AtomicBool,
}

impl Progress for Follower<'_> {
    fn report(&self, _fraction: f32) {}

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    fn note(&self, note: &str) {
        self.mail.note(format!("{}: {note}", self.input.name));
    }
}

/// Reads all frames in order and passes them to `send`, which returns whether more are wanted.
fn read(
    tracks: &[Track],
    mail: &MessageSender,
    cancelled: &AtomicBool,
    send: &dyn Fn(PictureChanges) -> bool,
) -> Result<(), Error> {
    let followers: Vec<_> = tracks.iter().map(|track| Follower { input: &track.input, mail, cancelled }).collect();
    let open = |follower: &Follower<'_>| {
        let Input { source, play, .. } = follower.input;
        source.play(play, &read_options(follower.input), follower)
    };
    let mut players = followers.iter().map(open).collect::<Result<Vec<Player>, Error>>()?;
    let pictures = tracks.iter().map(|track| track.frames.len()).max().unwrap_or_default();
    for picture in 0..pictures {
        let mut changes = PictureChanges::new();
        for ((track, player), follower) in tracks.iter().zip(&mut players).zip(&followers) {
            let frame = track.frames.get(picture).copied();
            let before = picture.checked_sub(1).and_then(|before| track.frames.get(before).copied());
            if let Some(frame) = frame.filter(|_| frame != before) {
                changes.push((track.layer, player.frame(frame, follower)?));
            }
        }
        if !send(changes) {
            return Ok(());
        }
    }
    Ok(())
}
