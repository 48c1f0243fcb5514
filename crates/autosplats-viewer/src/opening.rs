//! Inputs: opened, filled as their points arrive, read again, looked at.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use autosplats::cloud::PointCloud;
use autosplats::{Camera, Projection, ViewDirection};
use autosplats_sources::Source;

use crate::app::App;
use crate::document::{Layer, LayerId};
use crate::glance::{FOV_DEG, FirstLook, ViewFrame};
use crate::kept::StoredInput;
use crate::loading::{Appearance, Input, JobId, JobNews};

/// Number of recent inputs kept.
const MAX_RECENT_INPUTS: usize = 12;

impl App {
    /// Opens an input with the default appearance.
    pub(crate) fn open(&mut self, input: Input) {
        self.open_as(input, Appearance::default());
    }

    /// Opens an input with an appearance.
    pub(crate) fn open_as(&mut self, input: Input, appearance: Appearance) {
        if !matches!(input.source, Source::Scene(..) | Source::StandardInput) {
            let kept = StoredInput::of(&input, Appearance::default());
            self.session.recent.retain(|known| known.source != kept.source);
            self.session.recent.insert(0, kept);
            self.session.recent.truncate(MAX_RECENT_INPUTS);
        }
        if let Some(path) = input.source.path()
            && self.session.watch
            && !self.session.watches.contains_key(path)
        {
            self.session.watches.insert(path.into(), self.session.loader.watch(path.into()));
        }
        self.forget_failure_of(&input);
        if input.moves() {
            let context = self.session.loader.context().clone();
            self.play(input, appearance, &context);
            return;
        }
        let job = self.session.loader.read(input);
        self.session.appearances.insert(job, appearance);
    }

    /// Opens a stored input, read and played as before.
    pub(crate) fn open_again(&mut self, kept: StoredInput) {
        match kept.open(Path::new("")) {
            Ok((input, appearance)) => self.open_as(input, appearance),
            Err(error) => self.ui.messages.error(error.to_string()),
        }
    }

    /// Remembers an input that could not be read, for the session.
    pub(crate) fn fail(&mut self, input: Input, appearance: Appearance) {
        self.forget_failure_of(&input);
        self.session.failed.push((input, appearance));
    }

    /// Removes an input from the failed ones, since it is opened again and a session stores each input once.
    fn forget_failure_of(&mut self, input: &Input) {
        let name = Self::source_name(input);
        self.session.failed.retain(|(failed, _)| Self::source_name(failed) != name);
    }

    /// Receives what has been read and which files have changed.
    pub(crate) fn follow_files(&mut self) {
        for (input, job, news) in self.session.loader.news() {
            match news {
                JobNews::Preview(cloud, glance) if !self.session.reloads.contains_key(&job) => {
                    self.fill_layer(&input, job, &cloud, glance);
                }
                JobNews::Preview(..) => {}
                JobNews::Read(cloud, glance, notes) => {
                    notes.into_iter().for_each(|note| self.ui.messages.note(format!("{}: {note}", input.name)));
                    match self.session.reloads.remove(&job) {
                        Some(id) => self.read_again(&input, id, &cloud, glance),
                        None => {
                            if let Some(id) = self.fill_layer(&input, job, &cloud, glance) {
                                self.session.loading.remove(&job);
                                self.settle(|document| document.complete(id));
                            }
                        }
                    }
                }
                JobNews::Failed(why) => {
                    self.ui.messages.error(why);
                    let reloads = self.session.reloads.contains_key(&job);
                    let appearance = self.forget_job(job);
                    // A failed reload keeps the old points.
                    if !reloads {
                        self.fail(input, appearance);
                    }
                }
                JobNews::Cancelled => {
                    if !self.session.reloads.contains_key(&job) {
                        self.ui.messages.note(format!("{}: reading was cancelled", input.name));
                    }
                    self.forget_job(job);
                }
            }
        }
        let changed: Vec<PathBuf> = self.session.loader.changed().collect();
        changed.iter().for_each(|path| self.reload(path));
    }

    /// Puts the points of a job into its layer, which the first points create. Undo does not revert this. Returns the
    /// layer, or `None` if the user has removed it.
    fn fill_layer(&mut self, input: &Input, job: JobId, cloud: &Arc<PointCloud>, glance: FirstLook) -> Option<LayerId> {
        let id = match self.session.loading.get(&job).copied() {
            Some(id) if self.document().layer(id).is_none() => {
                self.session.loader.cancel(job);
                self.session.loading.remove(&job);
                return None;
            }
            Some(id) => {
                self.fill(id, cloud);
                self.update_view(id, glance, false);
                id
            }
            None => {
                let path = input.source.path().map(Path::to_path_buf);
                let mut layer = Layer::new(&*input.name, path, Arc::clone(cloud)).opened_at(input.world_from_input);
                layer.incomplete = true;
                Appearance { visible: layer.visible, tint: layer.tint } =
                    self.session.appearances.remove(&job).unwrap_or_default();
                let id = self.add_layer(layer, input, glance);
                self.session.loading.insert(job, id);
                id
            }
        };
        Some(id)
    }

    /// Adds the layer of an input. The camera moves to show the points if they are the first ones.
    pub(crate) fn add_layer(&mut self, layer: Layer, input: &Input, glance: FirstLook) -> LayerId {
        let first = self.document().layers.is_empty();
        let id = layer.id;
        // Forgets the inputs of layers that undo can no longer bring back.
        self.session.inputs.retain(|&known, _| self.session.history.holds(known));
        self.session.inputs.insert(id, input.clone());
        self.settle(|document| {
            document.add(layer.clone());
        });
        if first {
            self.view.first_camera = None;
        }
        let fitted = first && !std::mem::take(&mut self.view.camera_given);
        self.update_view(id, glance, fitted);
        id
    }

    /// Updates the view after the points of a layer have changed. The camera moves if `fitted`, or if the user has not
    /// moved it yet.
    fn update_view(&mut self, id: LayerId, glance: FirstLook, fitted: bool) {
        if self.document().layers.first().is_some_and(|layer| layer.id == id) {
            self.session.guessed_axes = Some(glance.axes);
        }
        let document = self.document();
        let alone = match document.layers.as_slice() {
            [only] => only.visible && only.pose == only.opened_at,
            _ => false,
        };
        let whole = !document.clip.as_ref().is_some_and(|clip| clip.enabled);
        self.session.glance = Some((self.session.version, glance)).filter(|_| alone && whole);
        if fitted || self.is_first_view() {
            self.first_view();
        } else {
            self.measure_scene();
        }
    }

    /// Removes the layer of a job that will not be finished. Returns the appearance of the layer, or the intended one.
    fn forget_job(&mut self, job: JobId) -> Appearance {
        self.session.reloads.remove(&job);
        let mut appearance = self.session.appearances.remove(&job).unwrap_or_default();
        if let Some(id) = self.session.loading.remove(&job) {
            if let Some(layer) = self.document().layer(id) {
                appearance = Appearance { visible: layer.visible, tint: layer.tint };
            }
            self.settle(|document| {
                document.remove(id);
            });
        }
        appearance
    }

    /// Cancels a layer that is still being read or played.
    pub(crate) fn give_up(&mut self, id: LayerId) {
        if self.session.playing.stop(id) {
            self.settle(|document| {
                document.remove(id);
            });
        }
        let job = self.session.loading.iter().find_map(|(&job, &layer)| (layer == id).then_some(job));
        if let Some(job) = job {
            self.session.loader.cancel(job);
            self.forget_job(job);
        }
    }

    /// Shows the new points of a file. Edits made meanwhile apply to the old points, so that the new ones are dropped.
    fn read_again(&mut self, input: &Input, id: LayerId, cloud: &Arc<PointCloud>, glance: FirstLook) {
        if self.session.history.is_unsaved(id) {
            self.ui.messages.note(format!(
                "{} has changed; its new points are not shown, because it has unsaved edits",
                input.name
            ));
        } else if self.document().layer(id).is_some() {
            self.fill(id, cloud);
            self.ui.messages.note(format!("{} was read again", input.name));
            self.update_view(id, glance, false);
        }
    }

    /// Reads the layers of a changed file again.
    fn reload(&mut self, path: &Path) {
        let whole = |layer: &&Layer| !layer.incomplete || self.session.playing.shows(layer.id);
        let layers = self.document().layers.iter().filter(|layer| layer.path.as_deref() == Some(path)).filter(whole);
        let ids: Vec<_> = layers.map(|layer| layer.id).collect();
        ids.into_iter().for_each(|id| self.reload_layer(id));
    }

    /// Reads the input of a layer again. A layer with unsaved edits is kept, with a note, since the edits apply to the
    /// old points.
    pub(crate) fn reload_layer(&mut self, id: LayerId) {
        let Some(input) = self.session.inputs.get(&id).cloned() else { return };
        if self.session.history.is_unsaved(id) {
            self.ui
                .messages
                .note(format!("{} has changed; it was not read again, because it has unsaved edits", input.name));
            return;
        }
        if input.moves() {
            self.play_anew(id, input);
            return;
        }
        // A file that keeps changing cancels its earlier reload.
        let before: Vec<JobId> =
            self.session.reloads.iter().filter(|(_, layer)| **layer == id).map(|(&job, _)| job).collect();
        before.into_iter().for_each(|job| self.session.loader.cancel(job));
        let job = self.session.loader.read(input);
        self.session.reloads.insert(job, id);
    }

    /// Name of an input's source, as a user could type it.
    pub(crate) fn source_name(input: &Input) -> String {
        match &input.source {
            Source::File(path) | Source::Recording(path) => {
                std::path::absolute(path).unwrap_or_else(|_| path.clone()).display().to_string()
            }
            Source::Sequence(name) => std::path::absolute(name).unwrap_or_else(|_| name.into()).display().to_string(),
            Source::Remote(address) => address.clone(),
            Source::Scene(..) | Source::StandardInput => input.name.clone(),
        }
    }

    /// Places the camera; the first input then does not move it.
    pub(crate) fn set_camera(&mut self, camera: &Camera) {
        self.view.navigation.go_to(camera, true);
        self.view.camera_given = true;
    }

    /// What the first view depends on besides the points.
    pub(crate) fn frame(&self) -> ViewFrame {
        ViewFrame { aspect: self.view.aspect, up: self.session.up_axis }
    }

    /// The first look at the only input, if the document has not changed since.
    fn glance(&self) -> Option<&FirstLook> {
        self.session.glance.as_ref().filter(|(version, _)| *version == self.session.version).map(|(_, glance)| glance)
    }

    /// Passes the extent of the document and the up axis to the navigation.
    pub(crate) fn measure_scene(&mut self) {
        let bounds = self.glance().map_or_else(|| self.document().shown_bounds(), |glance| glance.bounds);
        let up = self.up();
        if let Some([low, high]) = bounds {
            self.view.navigation.set_scene(low.midpoint(high), 0.5 * low.distance(high), up);
        }
    }

    /// Whether the user has not moved since the program chose the camera.
    pub(crate) fn is_first_view(&self) -> bool {
        self.view.first_camera.is_some_and(|(camera, _)| camera == self.view.navigation.goal_camera())
    }

    /// Moves to the first view: that of the scene, or the one that a render without a camera uses.
    pub(crate) fn first_view(&mut self) {
        let scene = match self.document().layers.as_slice() {
            [only] => self.session.inputs.get(&only.id).and_then(|input| match &input.source {
                Source::Scene(scene, _) => Some(scene.view()),
                _ => None,
            }),
            _ => None,
        };
        match scene {
            Some(view) => {
                let projection = Projection::PerspectiveFovDeg(view.fov_degrees);
                let camera = Camera { eye: view.eye, look_at: view.look_at, up: view.up, projection };
                self.measure_scene();
                self.view.navigation.go_to(&camera, true);
            }
            None => self.look_from(ViewDirection::Auto, true),
        }
        self.view.first_camera = Some((self.view.navigation.goal_camera(), self.view.aspect));
    }

    /// Looks at everything from one side.
    pub(crate) fn look_from(&mut self, direction: ViewDirection, at_once: bool) {
        let known = self.glance().filter(|glance| {
            let usual = direction == ViewDirection::Auto && !self.view.navigation.is_orthographic();
            usual && glance.frame == self.frame()
        });
        if let Some(camera) = known.and_then(|glance| glance.camera) {
            self.measure_scene();
            self.view.navigation.go_to(&camera, at_once);
            return;
        }
        let cloud = self.document().overview();
        let fov = if direction == ViewDirection::Auto { FOV_DEG } else { self.view.navigation.fov_deg() };
        let projection = if self.view.navigation.is_orthographic() {
            Projection::OrthographicHeight(1.0)
        } else {
            Projection::PerspectiveFovDeg(fov)
        };
        self.measure_scene();
        match Camera::fit(&cloud, self.axes(), direction, self.view.aspect, projection) {
            Ok(camera) => self.view.navigation.go_to(&camera, at_once),
            Err(error) => self.ui.messages.note(error.to_string()),
        }
    }

    /// Moves the camera to show all points of a cloud, in the same direction.
    pub(crate) fn fit(&mut self, cloud: &PointCloud) {
        self.measure_scene();
        match self.view.navigation.goal_camera().showing(cloud, self.view.aspect) {
            Ok(camera) => self.view.navigation.go_to(&camera, false),
            Err(error) => self.ui.messages.note(error.to_string()),
        }
    }
}
