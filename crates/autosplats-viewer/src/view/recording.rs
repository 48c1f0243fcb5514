//! Recording of films.
//!
//! # How it works
//! The render thread is asked for one picture at a time, so that the window stays usable. A thread of its own writes
//! the pictures as files, or sends them to ffmpeg for a film. Everything stays as at the start of the film, except
//! the camera and, where time runs, the points that a [`Reel`] reads.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

use autosplats::{Camera, Image};
use autosplats_output::{Film, Frames, Target, write_picture};
use eframe::egui;

use crate::files;
use crate::session::Reel;
use crate::threads::spawn;
use crate::view::RenderRequest;

/// Pictures that may wait for the writer.
const MAX_WAITING_PICTURES: usize = 3;

/// Number of recordings started so far.
static RECORDINGS: AtomicU64 = AtomicU64::new(0);

/// A film in progress.
pub(crate) struct Recording {
    /// Unique number of the recording.
    pub(crate) number: u64,
    /// The request for the last picture; the next one differs by camera and moving points only.
    wish: RenderRequest,
    /// One camera per picture.
    cameras: Vec<Camera>,
    /// Source of the moving points, where time runs.
    reel: Option<Reel>,
    /// Index of the next picture.
    next: usize,
    /// Channel to the writer.
    pictures: Option<SyncSender<Image>>,
    /// A picture that the writer had no room for.
    waiting: Option<Image>,
    /// Whether a picture is being rendered.
    asked: bool,
    result: Receiver<Result<String, String>>,
}

impl Recording {
    /// Starts a film of the scene in `wish`, with one picture per camera, at `rate` pictures per second, into `target`.
    /// With a `reel`, time runs.
    pub(crate) fn start(
        wish: RenderRequest,
        cameras: Vec<Camera>,
        reel: Option<Reel>,
        rate: u32,
        target: Target,
        context: &egui::Context,
    ) -> Self {
        let size = wish.size;
        let (pictures, queue) = sync_channel::<Image>(MAX_WAITING_PICTURES);
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
        Self { number, wish, cameras, reel, next: 0, pictures: Some(pictures), waiting: None, asked: false, result }
    }

    /// Progress, 0 to 1.
    pub(crate) fn fraction(&self) -> f32 {
        self.next as f32 / self.cameras.len().max(1) as f32
    }

    /// The request for the next picture; `None` while one is in work, or when all are done.
    ///
    /// # Errors
    /// Why there are no more pictures.
    pub(crate) fn wanted(&mut self) -> Result<Option<RenderRequest>, String> {
        if let Some(image) = self.waiting.take() {
            self.hand_over(image);
        }
        if self.asked || self.waiting.is_some() || self.pictures.is_none() {
            return Ok(None);
        }
        let Some(&camera) = self.cameras.get(self.next) else {
            // The writer ends when the channel closes.
            self.stop();
            return Ok(None);
        };
        if let Some(reel) = &self.reel {
            let Some(changes) = reel.next()? else { return Ok(None) };
            changes.iter().for_each(|(layer, cloud)| self.wish.document.reload(*layer, cloud));
        }
        self.asked = true;
        self.next += 1;
        self.wish.camera = camera;
        Ok(Some(self.wish.clone()))
    }

    /// Takes a finished picture and the ends of its colour map.
    pub(crate) fn arrived(&mut self, image: Image, range: Option<[f64; 2]>) {
        self.asked = false;
        if self.next == 1 {
            // All pictures keep the range of the first one.
            let known = &mut self.wish.settings.shading.range;
            *known = known.or(range);
        }
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

    /// Stops; no further pictures are rendered.
    pub(crate) fn stop(&mut self) {
        (self.pictures, self.reel) = (None, None);
    }

    /// The result, once the film has ended: what was written, or why nothing was.
    pub(crate) fn ended(&self) -> Option<Result<String, String>> {
        self.result.try_recv().ok()
    }
}

/// Writes PNG files. After a stop, the complete files stay.
fn write_frames(
    queue: &Receiver<Image>,
    frames: &Frames,
    total: usize,
    context: &egui::Context,
) -> Result<String, String> {
    let mut count = 0;
    for image in queue {
        let path = frames.file(count);
        files::write(&path, |writer| write_picture(&image, frames.format(), true, writer))
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

/// Writes a film, which appears complete or not at all.
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
    use autosplats::{Backend, Settings};

    use super::*;
    use crate::session::Document;
    use crate::view::Navigation;

    fn recording(pictures: usize, target: &Target) -> Recording {
        let camera = Navigation::new().camera();
        let (document, settings, backend) = (Document::default(), Settings::default(), Backend::Cpu);
        let wish = RenderRequest {
            document,
            camera,
            size: [2, 1],
            settings,
            dots: None,
            backend,
            axes: None,
            budget_ms: None,
            moving_ms: 33.0,
        };
        Recording::start(wish, vec![camera; pictures], None, 25, target.clone(), &egui::Context::default())
    }

    #[test]
    fn no_two_recordings_are_mistaken_for_each_other() {
        let folder = tempfile::tempdir().expect("a folder");
        let target = Target::new(&folder.path().join("t.png")).expect("pictures");
        let [one, other] = [(); 2].map(|()| recording(0, &target).number);
        assert_ne!(one, other, "each has a number of its own");
    }

    #[test]
    fn pictures_are_written_one_by_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let target = Target::new(&folder.path().join("t.png")).expect("pictures");
        let mut recording = recording(2, &target);
        let mut ranges = Vec::new();
        let result = loop {
            if let Some(wish) = recording.wanted().expect("nothing moves") {
                ranges.push(wish.settings.shading.range);
                let image = Image { width: 2, height: 1, pixels: vec![[1, 2, 3, 255]; 2], linear: Vec::new() };
                recording.arrived(image, Some([ranges.len() as f64, 5.0]));
            }
            if let Some(result) = recording.ended() {
                break result;
            }
            std::thread::yield_now();
        };
        assert!(result.is_ok(), "{result:?}");
        assert_eq!(ranges, [None, Some([1.0, 5.0])], "colours mean what they mean in the first picture");
        assert_eq!(target.existing(2), Some(folder.path().join("t_00000.png")), "the first is there");
        assert!(folder.path().join("t_00001.png").exists(), "and the second");
    }
}
