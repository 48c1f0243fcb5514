//! Films in the making.
//!
//! # How it works
//! The render thread is asked for one picture after the other, so that the window goes on in between; a thread of its own
//! writes them, as PNG files or to ffmpeg, which makes a film.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

use autosplats::{Camera, Image};
use autosplats_film::{Film, Frames, Target};
use eframe::egui;

use crate::files;
use crate::threads::spawn;

/// Pictures that wait to be written.
const QUEUE: usize = 3;

/// How many recordings there have been.
static RECORDINGS: AtomicU64 = AtomicU64::new(0);

/// A film in the making.
pub(crate) struct Recording {
    /// Which one it is: no other has the same number.
    pub(crate) number: u64,
    cameras: Vec<Camera>,
    /// Picture that is asked for next.
    next: usize,
    pub(crate) size: [u32; 2],
    /// To the thread that writes.
    pictures: Option<SyncSender<Image>>,
    /// One that the writer had no room for yet.
    waiting: Option<Image>,
    /// Whether a picture is being made.
    asked: bool,
    result: Receiver<Result<String, String>>,
}

impl Recording {
    /// Begins to write pictures of `cameras`, so many a second, to `target`.
    pub(crate) fn start(
        cameras: Vec<Camera>,
        size: [u32; 2],
        rate: u32,
        target: Target,
        context: &egui::Context,
    ) -> Self {
        let (pictures, queue) = sync_channel::<Image>(QUEUE);
        let (sender, result) = sync_channel(1);
        let context = context.clone();
        let total = cameras.len();
        spawn("film", move || {
            let written = match target {
                Target::Frames(frames) => write_frames(&queue, &frames, total, &context),
                Target::Film(path) => Film::begin(&path, size, rate.into())
                    .map_err(|error| error.to_string())
                    .and_then(|film| write_film(&queue, film, total, &context)),
            };
            let _ = sender.send(written);
            context.request_repaint();
        });
        let number = RECORDINGS.fetch_add(1, Ordering::Relaxed);
        Self { number, cameras, next: 0, size, pictures: Some(pictures), waiting: None, asked: false, result }
    }

    /// Part that is done, 0 to 1.
    pub(crate) fn fraction(&self) -> f32 {
        self.next as f32 / self.cameras.len().max(1) as f32
    }

    /// The camera of the picture to be made now, if it is time.
    pub(crate) fn wanted(&mut self) -> Option<Camera> {
        if let Some(image) = self.waiting.take() {
            self.hand_over(image);
        }
        if self.asked || self.waiting.is_some() || self.pictures.is_none() {
            return None;
        }
        let camera = self.cameras.get(self.next).copied();
        match camera {
            Some(_) => {
                self.asked = true;
                self.next += 1;
            }
            // The writer ends when nobody can send any more.
            None => self.pictures = None,
        }
        camera
    }

    /// Takes in the picture that was wanted.
    pub(crate) fn arrived(&mut self, image: Image) {
        self.asked = false;
        self.hand_over(image);
    }

    fn hand_over(&mut self, image: Image) {
        let Some(pictures) = &self.pictures else { return };
        match pictures.try_send(image) {
            Ok(()) => {}
            Err(TrySendError::Full(image)) => self.waiting = Some(image),
            Err(TrySendError::Disconnected(_)) => self.pictures = None,
        }
    }

    /// Makes no more pictures.
    pub(crate) fn stop(&mut self) {
        self.pictures = None;
    }

    /// How it ended, once it has: what was written, or why not.
    pub(crate) fn ended(&self) -> Option<Result<String, String>> {
        self.result.try_recv().ok()
    }
}

/// Writes PNG files; those complete stay if the rest is not wanted any more.
fn write_frames(
    queue: &Receiver<Image>,
    frames: &Frames,
    total: usize,
    context: &egui::Context,
) -> Result<String, String> {
    let mut count = 0;
    for image in queue {
        let path = frames.file(count);
        files::write(&path, |writer| files::encode_png(&image, writer))
            .map_err(|error| format!("{}: {error}", path.display()))?;
        count += 1;
        context.request_repaint();
    }
    let place = frames.pattern();
    if count < total {
        Err(format!("{count} of {total} pictures were written: {}", place.display()))
    } else {
        Ok(format!("{count} pictures were written: {}", place.display()))
    }
}

/// Makes a film, which appears complete or not at all.
fn write_film(
    queue: &Receiver<Image>,
    mut film: Film,
    total: usize,
    context: &egui::Context,
) -> Result<String, String> {
    let mut count = 0;
    for image in queue {
        film.add(&image).map_err(|error| error.to_string())?;
        count += 1;
        context.request_repaint();
    }
    if count < total {
        return Err("The film was stopped; nothing was written".into());
    }
    film.finish().map_err(|error| error.to_string())?;
    Ok(format!("{count} pictures were written as a film"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::navigation::Navigation;

    #[test]
    fn no_two_recordings_are_mistaken_for_each_other() {
        let folder = tempfile::tempdir().expect("a folder");
        let target = Target::new(&folder.path().join("t.png")).expect("pictures");
        let context = egui::Context::default();
        let [one, other] = [(); 2].map(|()| Recording::start(Vec::new(), [1, 1], 25, target.clone(), &context).number);
        assert_ne!(one, other, "each has a number of its own");
    }

    #[test]
    fn pictures_are_written_one_by_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let target = Target::new(&folder.path().join("t.png")).expect("pictures");
        let context = egui::Context::default();
        let mut recording = Recording::start(vec![Navigation::new().camera(); 2], [2, 1], 25, target.clone(), &context);
        let result = loop {
            if recording.wanted().is_some() {
                recording.arrived(Image { width: 2, height: 1, pixels: vec![[1, 2, 3, 255]; 2], linear: Vec::new() });
            }
            if let Some(result) = recording.ended() {
                break result;
            }
            std::thread::yield_now();
        };
        assert!(result.is_ok(), "{result:?}");
        assert_eq!(target.existing(2), Some(folder.path().join("t_00000.png")), "the first is there");
        assert!(folder.path().join("t_00001.png").exists(), "and the second");
    }
}
