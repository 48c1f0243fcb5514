//! A session in a file: what is open and how it is seen, to be had again.

use std::path::{Path, PathBuf};

use autosplats::Camera;
use autosplats::cloud::Axes;
use autosplats::cloud::glam::DMat4;
use serde::{Deserialize, Serialize};

use crate::app::App;
use crate::files;
use crate::loading::Input;
use crate::look::Look;

/// Everything but the points and what was done to them, which is exported.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct State {
    inputs: Vec<InputState>,
    camera: Option<Camera>,
    up: Option<Up>,
    look: Look,
    /// Cameras that a film goes through.
    keys: Vec<Camera>,
}

/// An input of the list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct InputState {
    /// Path of a file, from the state's own folder if it is no absolute one, or the name of a scene.
    source: String,
    #[serde(default = "yes")]
    visible: bool,
    #[serde(default)]
    tint: Option<[u8; 3]>,
    /// From its own to world coordinates, by columns.
    #[serde(default)]
    pose: DMat4,
}

fn yes() -> bool {
    true
}

/// Which way is up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
enum Up {
    #[serde(rename = "z_up")]
    Z,
    #[serde(rename = "y_up")]
    Y,
    #[serde(rename = "camera")]
    Camera,
}

impl State {
    /// What is open in `app`, or was to be.
    pub(crate) fn of(app: &App) -> Self {
        let layers = app.document().layers.iter().filter_map(|layer| {
            let source = App::source_name(app.inputs.get(&layer.id)?);
            Some(InputState { source, visible: layer.visible, tint: layer.tint, pose: layer.pose })
        });
        // What could not be read this time, or is still being read, is no less a part of the session.
        let started = |id| app.loading.contains_key(&id) || app.reloads.contains_key(&id);
        let waiting = app.loader.jobs().iter().filter(|job| !started(job.id)).map(|job| {
            let (visible, tint) = app.looks.get(&job.id).copied().unwrap_or((true, None));
            (&job.input, visible, tint)
        });
        let absent = waiting.chain(app.failed.iter().map(|input| (input, true, None)));
        let absent = absent.map(|(input, visible, tint)| InputState {
            source: App::source_name(input),
            visible,
            tint,
            pose: input.world_from_input,
        });
        let inputs: Vec<InputState> = layers.chain(absent).collect();
        let up = app.up_axis.map(|axes| match axes {
            Axes::ZUp => Up::Z,
            Axes::YUp => Up::Y,
            Axes::Camera => Up::Camera,
        });
        Self {
            camera: (!inputs.is_empty()).then(|| app.navigation.goal_camera()),
            inputs,
            up,
            look: app.look.clone(),
            keys: app.keys.clone(),
        }
    }

    /// Reads a state.
    ///
    /// # Errors
    /// What is wrong with the file, by its name and place.
    pub(crate) fn read(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        // An empty list would pass for a state of which everything is missing.
        let state = serde_json::from_str::<serde_json::Map<_, _>>(&text)
            .and_then(|fields| serde_json::from_value::<Self>(fields.into()))
            .map_err(|error| format!("{}: no saved state: {error}", path.display()))?;
        state.look.settings.check().map_err(|error| format!("{}: {error}", path.display()))?;
        for camera in state.camera.iter().chain(&state.keys) {
            camera.check().map_err(|error| format!("{}: {error}", path.display()))?;
        }
        Ok(state)
    }

    /// Writes the state.
    ///
    /// # Errors
    /// Why it could not be written, with the file's name.
    pub(crate) fn write(&self, path: &Path) -> Result<(), String> {
        files::write(path, |writer| {
            serde_json::to_writer_pretty(&mut *writer, self).map_err(std::io::Error::other)?;
            writeln!(writer)
        })
        .map_err(|error| format!("{}: {error}", path.display()))
    }

    /// Opens what the state has; paths are from `folder`.
    pub(crate) fn restore(self, app: &mut App, folder: &Path) {
        let Self { inputs, camera, up, look, keys } = self;
        app.look = look;
        app.keys = keys;
        app.up_axis = up.map(|up| match up {
            Up::Z => Axes::ZUp,
            Up::Y => Axes::YUp,
            Up::Camera => Axes::Camera,
        });
        for InputState { source, visible, tint, pose } in inputs {
            let name = if source.starts_with("scene:") { source } else { folder.join(source).display().to_string() };
            match Input::parse(&name) {
                // Named when the program was started, too.
                Ok(input)
                    if app.loader.jobs().iter().any(|job| App::source_name(&job.input) == App::source_name(&input)) => {
                }
                Ok(input) => app.open_as(Input { world_from_input: pose, ..input }, visible, tint),
                Err(error) => app.messages.error(error.to_string()),
            }
        }
        if let Some(camera) = camera {
            app.stand_at(&camera);
        }
    }
}

/// The folder that a state's paths are from.
pub(crate) fn folder(path: &Path) -> PathBuf {
    path.parent().map_or_else(PathBuf::new, Path::to_path_buf)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_come_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("state.json");
        let input = InputState { source: "a.ply".into(), visible: false, tint: Some([1, 2, 3]), pose: DMat4::IDENTITY };
        let state = State { inputs: vec![input], up: Some(Up::Y), ..State::default() };
        state.write(&path).expect("written");
        assert_eq!(State::read(&path), Ok(state), "as it was");
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
        ] {
            std::fs::write(&path, text).expect("written");
            let error = State::read(&path).expect_err(text);
            assert!(error.contains("state.json"), "names the file: {error}");
        }
        assert!(State::read(&folder.path().join("none.json")).is_err(), "no file");
    }
}
