//! Writes pictures and films.

use std::path::PathBuf;

use autosplats::Image;
use autosplats::cloud::{Existing, Output};
use autosplats_output::{PictureFormat, write_picture};

use super::View;
use crate::files;
use crate::threads::spawn;
use crate::view::{Goal, Task};

impl View {
    /// Hands a picture to its goal. `range` holds the ends of its colour map.
    pub(crate) fn photographed(&mut self, picture: Image, range: Option<[f64; 2]>, goal: Goal) {
        match goal {
            Goal::File(path, existing) => self.save_picture(picture, path, existing),
            Goal::Film(number) => {
                // A stopped film may have left a picture in work.
                if let Some(recording) = self.recording.as_mut().filter(|recording| recording.number == number) {
                    recording.arrived(picture, range);
                }
            }
        }
    }

    /// Writes a picture on a thread of its own and reports the result.
    pub(crate) fn save_picture(&self, picture: Image, path: PathBuf, existing: Existing) {
        let messages = self.messages.clone();
        spawn("picture", move || {
            let format = PictureFormat::of(&path).unwrap_or(PictureFormat::Png);
            let written =
                files::write(Output { path: &path, existing }, |writer| write_picture(&picture, format, true, writer));
            messages.result(match written {
                Ok(()) => Ok(format!("{} was written", path.display())),
                Err(error) => Err(format!("{}: {error}", path.display())),
            });
        });
    }

    /// Continues the film in progress.
    pub(crate) fn record(&mut self) {
        let Some(recording) = &mut self.recording else { return };
        if let Some(result) = recording.ended() {
            self.recording = None;
            self.messages.result(result);
            return;
        }
        let number = recording.number;
        match recording.wanted() {
            Ok(None) => {}
            Ok(Some(wish)) => self.render.task(Task::Photograph { wish: Box::new(wish), goal: Goal::Film(number) }),
            Err(why) => {
                recording.stop();
                self.messages.error(why);
            }
        }
    }

    /// Stops the film in progress.
    pub(crate) fn stop_recording(&mut self) {
        if let Some(recording) = &mut self.recording {
            recording.stop();
        }
    }
}
