//! Writes pictures and films.

use std::path::PathBuf;

use autosplats::Image;

use crate::app::App;
use crate::files;
use crate::recording::Recording;
use crate::render::Task;
use crate::threads::spawn;

/// What a rendered picture is for.
pub(crate) enum Goal {
    /// A file.
    File(PathBuf),
    /// A picture of the film with this number.
    Film(u64),
}

/// Hands a picture to its goal.
pub(crate) fn photographed(app: &mut App, picture: Image, range: Option<[f64; 2]>, goal: Goal) {
    match goal {
        Goal::File(path) => save_picture(app, picture, path),
        Goal::Film(number) => {
            // A stopped film may have left a picture in work.
            if let Some(recording) = app.view.recording.as_mut().filter(|recording| recording.number == number) {
                recording.arrived(picture, range);
            }
        }
    }
}

/// Writes a picture on a thread of its own and reports the result.
pub(crate) fn save_picture(app: &mut App, picture: Image, path: PathBuf) {
    let messages = app.ui.messages.sender();
    spawn("picture", move || {
        let written = files::write(&path, |writer| files::encode_png(&picture, writer));
        messages.send(match written {
            Ok(()) => Ok(format!("{} was written", path.display())),
            Err(error) => Err(format!("{}: {error}", path.display())),
        });
    });
}

/// Continues the film in progress.
pub(crate) fn record(app: &mut App) {
    let Some(recording) = &mut app.view.recording else { return };
    if let Some(result) = recording.ended() {
        app.view.recording = None;
        match result {
            Ok(note) => app.ui.messages.note(note),
            Err(error) => app.ui.messages.error(error),
        }
        return;
    }
    let number = recording.number;
    match recording.wanted() {
        Ok(None) => {}
        Ok(Some(wish)) => app.view.render.task(Task::Photograph { wish: Box::new(wish), goal: Goal::Film(number) }),
        Err(why) => {
            recording.stop();
            app.ui.messages.error(why);
        }
    }
}

/// Stops the film in progress.
pub(crate) fn stop(recording: &mut Option<Recording>) {
    if let Some(recording) = recording {
        recording.stop();
    }
}
