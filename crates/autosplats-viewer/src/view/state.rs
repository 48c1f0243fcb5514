//! A session in a file: what is open and how it is shown.

use std::path::{Path, PathBuf};

use autosplats::Camera;
use autosplats::cloud::Axes;
use autosplats_sources::Source;
use serde::{Deserialize, Serialize};

use crate::files;
use crate::session::{Appearance, ClipBox, Clock, Session, StoredInput};
use crate::view::{Look, View};

/// A session. Points and edits are not part of it; they are saved by exporting.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct State {
    inputs: Vec<StoredInput>,
    camera: Option<Camera>,
    up: Option<Up>,
    look: Look,
    /// Key cameras of a film.
    keys: Vec<Camera>,
    #[serde(skip_serializing_if = "Option::is_none")]
    clip: Option<ClipBox>,
    /// Time, speed and range of the playing inputs.
    #[serde(skip_serializing_if = "Option::is_none")]
    clock: Option<Clock>,
}

/// The up axis, stored as its name.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
struct Up(Axes);

impl TryFrom<String> for Up {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        Axes::from_name(&name).map(Self).ok_or_else(|| format!("no axes are called '{name}'"))
    }
}

impl From<Up> for String {
    fn from(Up(axes): Up) -> Self {
        axes.name().into()
    }
}

impl State {
    /// What is open in `session`, and how `view` shows it. Inputs that are still to be read are part of it.
    pub(crate) fn of(session: &Session, view: &View) -> Self {
        let layers = session.document().layers.iter().filter_map(|layer| {
            let appearance = Appearance { visible: layer.visible, tint: layer.tint };
            let mut kept = StoredInput::of(session.inputs.get(&layer.id)?, appearance);
            kept.pose = layer.pose;
            Some(kept)
        });
        let absent = session.without_layer().map(|(input, appearance)| StoredInput::of(input, appearance));
        // Points from a pipe cannot be read again.
        let again = |kept: &StoredInput| !matches!(Source::parse(&kept.source), Ok(Source::StandardInput));
        let inputs: Vec<StoredInput> = layers.chain(absent).filter(again).collect();
        Self {
            camera: (!inputs.is_empty()).then(|| view.navigation.goal_camera()),
            clock: inputs.iter().any(StoredInput::moves).then(|| session.playing.clock.clone()),
            inputs,
            up: session.up_axis.map(Up),
            look: view.look.clone(),
            keys: view.keys.clone(),
            clip: session.document().clip,
        }
    }

    /// Reads a session.
    ///
    /// # Errors
    /// A message with the file's name and what is wrong.
    pub(crate) fn read(path: &Path) -> Result<Self, String> {
        let text = autosplats::cloud::read_text(path).map_err(|error| format!("{}: {error}", path.display()))?;
        // Only an object is accepted: an empty list would deserialize as a session of defaults.
        let state = serde_json::from_str::<serde_json::Map<_, _>>(&text)
            .and_then(|fields| serde_json::from_value::<Self>(fields.into()))
            .map_err(|error| format!("{}: not a session file: {error}", path.display()))?;
        state.look.settings.check().map_err(|error| format!("{}: {error}", path.display()))?;
        for camera in state.camera.iter().chain(&state.keys) {
            camera.check().map_err(|error| format!("{}: {error}", path.display()))?;
        }
        if state.clip.as_ref().is_some_and(|clip| !clip.is_box()) {
            return Err(format!("{}: the clipping box is invalid", path.display()));
        }
        if let Some(problem) = state.inputs.iter().find_map(StoredInput::problem) {
            return Err(format!("{}: {problem}", path.display()));
        }
        if state.clock.as_ref().is_some_and(|clock| !clock.is_clock()) {
            return Err(format!("{}: the times or the speed of the clock are invalid", path.display()));
        }
        Ok(state)
    }

    /// Writes the session.
    ///
    /// # Errors
    /// A message with the file's name and why writing failed.
    pub(crate) fn write(&self, path: &Path) -> Result<(), String> {
        files::write(path, |writer| {
            serde_json::to_writer_pretty(&mut *writer, self).map_err(std::io::Error::other)?;
            writeln!(writer)
        })
        .map_err(|error| format!("{}: {error}", path.display()))
    }

    /// Opens what the session holds. Relative paths are resolved against `folder`.
    pub(crate) fn restore(self, session: &mut Session, view: &mut View, folder: &Path) {
        let Self { inputs, camera, up, look, keys, clip, clock } = self;
        view.look = look;
        view.keys = keys;
        session.up_axis = up.map(|Up(axes)| axes);
        if clip.is_some() {
            session.settle(|document| document.clip = clip);
        }
        if let Some(clock) = clock {
            session.playing.clock = clock;
            session.playing.clock.hold();
        }
        for kept in inputs {
            match kept.open(folder) {
                Ok((input, appearance)) => {
                    // Inputs named on the command line may be in the session too.
                    let name = input.source_name();
                    let named = session.loader.jobs().iter().any(|job| job.input.source_name() == name);
                    if !named && !session.playing.has(&name) {
                        session.open_as(input, appearance);
                    }
                }
                Err(error) => session.messages.error(error.to_string()),
            }
        }
        if let Some(camera) = camera {
            view.set_camera(&camera);
        }
    }
}

/// The folder that a session's relative paths start from.
pub(crate) fn folder(path: &Path) -> PathBuf {
    path.parent().map_or_else(PathBuf::new, Path::to_path_buf)
}

#[cfg(test)]
mod tests {
    use autosplats::Background;
    use autosplats::cloud::glam::{DMat4, DQuat, DVec3};
    use autosplats_formats::ReadOptions;

    use super::*;
    use crate::Input;
    use crate::app::App;

    #[test]
    fn states_come_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("state.json");
        let inputs = ["a.ply", "b.mcap"].map(|name| StoredInput::named(name.into())).to_vec();
        let clip = ClipBox { rotation: DQuat::from_rotation_z(0.7), ..ClipBox::new(DVec3::ZERO, DVec3::ONE) };
        let mut clock = Clock::default();
        (clock.speed, clock.looped) = (0.25, false);
        let state = State { inputs, up: Some(Up(Axes::YUp)), clip: Some(clip), clock: Some(clock), ..State::default() };
        state.write(&path).expect("written");
        assert_eq!(State::read(&path), Ok(state), "as it was");
        let older = r#"{"inputs": [{"source": "a.ply"}], "camera": null, "up": "z-up", "keys": []}"#;
        std::fs::write(&path, older).expect("written");
        let read = State::read(&path).expect("a file from before there were boxes, options and clocks");
        assert_eq!((read.clip, read.clock), (None, None), "none were told");
        assert_eq!(read.inputs, [StoredInput::named("a.ply".into())], "nothing but the name");
    }

    #[test]
    fn a_session_is_had_again_with_its_box_and_the_ways_inputs_are_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("state.json");
        let context = eframe::egui::Context::default();
        let app = || App::new(crate::Options::default(), Look::default(), Vec::new(), &context);
        let mut first = app();
        let file = folder.path().join("columns.txt");
        std::fs::write(&file, "1 9 2 3\n0 0 0 0\n4 9 5 6\n").expect("written");
        let columns = Some(["x", "-", "y", "z"].map(String::from).to_vec());
        let options = ReadOptions { columns, keep_no_returns: true, ..ReadOptions::default() };
        let world_from_input = DMat4::from_translation(DVec3::X);
        first.session.open(Input { options, world_from_input, ..Input::file(file) });
        let clip = ClipBox::new(DVec3::NEG_ONE, DVec3::ONE);
        first.session.change(|document| document.clip = Some(clip));
        let kept = State::of(&first.session, &first.view);
        kept.write(&path).expect("written");
        let mut second = app();
        State::read(&path).expect("read").restore(&mut second.session, &mut second.view, folder.path());
        // The navigation keeps orientations as quaternions, whose conversion rounds.
        let without = |state: State| State { camera: None, ..state };
        let kept = without(kept);
        assert_eq!(
            without(State::of(&second.session, &second.view)),
            kept,
            "what was still to be read is no less a part of it"
        );
        let start = std::time::Instant::now();
        while second.session.document().layers.is_empty() || !second.session.loader.jobs().is_empty() {
            assert!(start.elapsed().as_secs() < 60, "it is read");
            second.session.follow(0.0);
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        assert_eq!(without(State::of(&second.session, &second.view)), kept, "nor what was read");
        assert_eq!(second.session.document().clip, Some(clip), "the box clips");
        let layer = &second.session.document().layers[0];
        assert_eq!(layer.cloud.len(), 3, "the sensor's own place is kept");
        assert_eq!(layer.position(2), DVec3::new(5.0, 5.0, 6.0), "by the columns that were told, where it stood");
    }

    #[test]
    fn what_is_no_state_is_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("state.json");
        for text in [
            "",
            "[]",
            "{\"inputs\": 3}",
            "{\"unknown\": 1}",
            "{\"look\": {\"settings\": {\"reconstruction\": {\"k\": 0}}}}",
            "{\"look\": {\"settings\": {\"shading\": {\"background\": \"whit\"}}}}",
            "{\"inputs\": [{\"source\": \"a\", \"options\": {\"colums\": []}}]}",
            "{\"inputs\": [{\"source\": \"a\", \"play\": {\"topic\": []}}]}",
            "{\"inputs\": [{\"source\": \"a\", \"play\": {\"decay\": -2}}]}",
            "{\"clock\": {\"speed\": 0}}",
            "{\"clock\": {\"span\": [3, 2]}}",
            r#"{"clip": {"min": [0,0,0], "max": [-1,1,1], "rotation": [0,0,0,1], "enabled": true}}"#,
        ] {
            std::fs::write(&path, text).expect("written");
            let error = State::read(&path).expect_err(text);
            assert!(error.contains("state.json"), "names the file: {error}");
        }
        assert!(State::read(&folder.path().join("none.json")).is_err(), "no file");
    }

    #[test]
    fn backgrounds_may_be_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("state.json");
        let background = |text: &str| {
            let text = format!("{{\"look\": {{\"settings\": {{\"shading\": {{\"background\": {text}}}}}}}}}");
            std::fs::write(&path, text).expect("written");
            State::read(&path).expect("a state").look.settings.shading.background
        };
        assert_eq!(background("\"white\""), Background::Color([255; 3]), "as the command line names it");
        assert_eq!(background("{\"gradient\": [[1, 2, 3], [4, 5, 6]]}"), Background::Gradient([1, 2, 3], [4, 5, 6]));
        for kept in [Background::Transparent, Background::Color([7; 3]), Background::Gradient([1; 3], [2; 3])] {
            assert_eq!(background(&serde_json::to_string(&kept).expect("JSON")), kept, "as it is written");
        }
    }
}
