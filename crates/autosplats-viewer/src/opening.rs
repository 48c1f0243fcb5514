//! Inputs: opened, filled as their points arrive, read again, looked at.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use autosplats::cloud::{PointCloud, Source};
use autosplats::{Camera, Projection, ViewDirection, guess_axes};

use crate::app::App;
use crate::document::{Layer, LayerId};
use crate::loading::{Input, JobId, News};

/// Vertical field of view of the first picture, degrees.
const FOV_DEG: f64 = 40.0;
/// Files whose names are kept.
const RECENT: usize = 12;

impl App {
    /// Begins to read something.
    pub(crate) fn open(&mut self, input: Input) {
        self.open_as(input, true, None);
    }

    /// Begins to read something that is shown in a certain way.
    pub(crate) fn open_as(&mut self, input: Input, visible: bool, tint: Option<[u8; 3]>) {
        if let Some(path) = input.source.path() {
            self.recent.retain(|known| known != path);
            self.recent.insert(0, path.into());
            self.recent.truncate(RECENT);
            if self.watch && !self.watches.contains_key(path) {
                self.watches.insert(path.into(), self.loader.watch(path.into()));
            }
        }
        if input.moves() {
            let context = self.loader.context().clone();
            self.play(input, visible, tint, &context);
            return;
        }
        let job = self.loader.read(input);
        self.looks.insert(job, (visible, tint));
    }

    /// Takes in what has been read, and what has changed.
    pub(crate) fn follow_files(&mut self) {
        for (input, job, news) in self.loader.news() {
            match news {
                News::Preview(cloud) if !self.reloads.contains_key(&job) => {
                    self.fill_layer(&input, job, Arc::new(*cloud));
                }
                News::Preview(_) => {}
                News::Read(cloud, notes) => {
                    notes.into_iter().for_each(|note| self.messages.note(format!("{}: {note}", input.name)));
                    match self.reloads.remove(&job) {
                        Some(id) => self.read_again(&input, id, *cloud),
                        None => {
                            if let Some(id) = self.fill_layer(&input, job, Arc::new(*cloud)) {
                                self.loading.remove(&job);
                                self.settle(|document| document.complete(id));
                            }
                        }
                    }
                }
                News::Failed(why) => {
                    self.messages.error(why);
                    self.forget_job(job);
                    self.failed.push(input);
                }
                News::Cancelled => {
                    if !self.reloads.contains_key(&job) {
                        self.messages.note(format!("{}: not read to its end", input.name));
                    }
                    self.forget_job(job);
                }
            }
        }
        let changed: Vec<PathBuf> = self.loader.changed().collect();
        changed.iter().for_each(|path| self.reload(path));
    }

    /// Gives the points that have arrived to the layer of a job, which is made with the first of them. Undo takes none of this
    /// back. Says which layer it is, unless the user has removed it meanwhile.
    fn fill_layer(&mut self, input: &Input, job: JobId, cloud: Arc<PointCloud>) -> Option<LayerId> {
        let id = match self.loading.get(&job).copied() {
            Some(id) if self.document().layer(id).is_none() => {
                self.loader.cancel(job);
                self.loading.remove(&job);
                return None;
            }
            Some(id) => {
                self.fill(id, &cloud);
                self.look_anew(id, &cloud, false);
                id
            }
            None => {
                let path = input.source.path().map(Path::to_path_buf);
                let mut layer = Layer::new(&*input.name, path, Arc::clone(&cloud)).opened_at(input.world_from_input);
                layer.incomplete = true;
                (layer.visible, layer.tint) = self.looks.remove(&job).unwrap_or((true, None));
                let id = self.add_layer(layer, input);
                self.loading.insert(job, id);
                id
            }
        };
        Some(id)
    }

    /// Puts the first points of an input into the list, and stands where they are seen if they are the first of all.
    pub(crate) fn add_layer(&mut self, layer: Layer, input: &Input) -> LayerId {
        let first = self.document().layers.is_empty();
        let (id, cloud) = (layer.id, Arc::clone(&layer.cloud));
        self.inputs.insert(id, input.clone());
        self.settle(|document| {
            document.add(layer.clone());
        });
        if first {
            self.first_camera = None;
        }
        let fitted = first && !std::mem::take(&mut self.camera_given);
        self.look_anew(id, &cloud, fitted);
        id
    }

    /// After the points of a layer have changed: stands where all is seen, if that is asked for or nobody has moved.
    fn look_anew(&mut self, id: LayerId, cloud: &PointCloud, fitted: bool) {
        if self.document().layers.first().is_some_and(|layer| layer.id == id) {
            self.guessed_axes = Some(guess_axes(cloud));
        }
        if fitted || self.stands_by_itself() {
            self.first_view();
        } else {
            self.measure_scene();
        }
    }

    /// Takes the layer of a job away that will not be read to its end.
    fn forget_job(&mut self, job: JobId) {
        self.reloads.remove(&job);
        self.looks.remove(&job);
        if let Some(id) = self.loading.remove(&job) {
            self.settle(|document| {
                document.remove(id);
            });
        }
    }

    /// Gives up a layer that is still being read or played.
    pub(crate) fn give_up(&mut self, id: LayerId) {
        if self.playing.stop(id) {
            self.settle(|document| {
                document.remove(id);
            });
        }
        let job = self.loading.iter().find_map(|(&job, &layer)| (layer == id).then_some(job));
        if let Some(job) = job {
            self.loader.cancel(job);
            self.forget_job(job);
        }
    }

    /// Shows what a file has now. Edits that were made while it was read are of the points before.
    fn read_again(&mut self, input: &Input, id: LayerId, cloud: PointCloud) {
        if self.history.is_unsaved(id) {
            self.messages.note(format!("{} has changed; what was read is not shown, as it has edits here", input.name));
        } else if self.document().layer(id).is_some() {
            let cloud = Arc::new(cloud);
            self.fill(id, &cloud);
            self.messages.note(format!("{} was read again", input.name));
            self.look_anew(id, &cloud, false);
        }
    }

    /// Reads a file again that has changed.
    fn reload(&mut self, path: &Path) {
        let layers =
            self.document().layers.iter().filter(|layer| layer.path.as_deref() == Some(path) && !layer.incomplete);
        let ids: Vec<_> = layers.map(|layer| layer.id).collect();
        ids.into_iter().for_each(|id| self.reload_layer(id));
    }

    /// Reads the file of an input again; one with edits is only told about, as they are of the points it had.
    pub(crate) fn reload_layer(&mut self, id: LayerId) {
        let Some(input) = self.inputs.get(&id).cloned() else { return };
        if input.moves() {
            self.messages.note(format!("{} is played as it was opened; open it anew for what has changed", input.name));
            return;
        }
        if self.history.is_unsaved(id) {
            self.messages.note(format!("{} has changed; it was not read again, as it has edits here", input.name));
            return;
        }
        // A file that keeps changing is read once more, not once for each change.
        let before: Vec<JobId> = self.reloads.iter().filter(|(_, layer)| **layer == id).map(|(&job, _)| job).collect();
        before.into_iter().for_each(|job| self.loader.cancel(job));
        let job = self.loader.read(input);
        self.reloads.insert(job, id);
    }

    /// What an input was called when it was opened, as it could be typed.
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

    /// Stands at a place whatever is opened.
    pub(crate) fn stand_at(&mut self, camera: &Camera) {
        self.navigation.go_to(camera, true);
        self.camera_given = true;
    }

    /// Tells the navigation how large everything is.
    pub(crate) fn measure_scene(&mut self) {
        let bounds = self.document().shown_bounds();
        let up = self.up();
        if let Some([low, high]) = bounds {
            self.navigation.set_scene(low.midpoint(high), 0.5 * low.distance(high), up);
        }
    }

    /// Whether nobody has moved since the program chose where to stand.
    pub(crate) fn stands_by_itself(&self) -> bool {
        self.first_camera.is_some_and(|(camera, _)| camera == self.navigation.goal_camera())
    }

    /// Stands where a picture of the first input stands that names no camera.
    pub(crate) fn first_view(&mut self) {
        let scene = match self.document().layers.as_slice() {
            [only] => self.inputs.get(&only.id).and_then(|input| match &input.source {
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
                self.navigation.go_to(&camera, true);
            }
            None => self.look_from(ViewDirection::Auto, true),
        }
        self.first_camera = Some((self.navigation.goal_camera(), self.aspect));
    }

    /// Looks at everything from one side.
    pub(crate) fn look_from(&mut self, direction: ViewDirection, at_once: bool) {
        let cloud = self.document().overview();
        let fov = if direction == ViewDirection::Auto { FOV_DEG } else { self.navigation.fov_deg() };
        let projection = if self.navigation.is_orthographic() {
            Projection::OrthographicHeight(1.0)
        } else {
            Projection::PerspectiveFovDeg(fov)
        };
        self.measure_scene();
        match Camera::fit(&cloud, self.axes(), direction, self.aspect, projection) {
            Ok(camera) => self.navigation.go_to(&camera, at_once),
            Err(error) => self.messages.note(error.to_string()),
        }
    }

    /// Stands where all points of a cloud are seen, looking the same way.
    pub(crate) fn fit(&mut self, cloud: &PointCloud) {
        self.measure_scene();
        match self.navigation.goal_camera().showing(cloud, self.aspect) {
            Ok(camera) => self.navigation.go_to(&camera, false),
            Err(error) => self.messages.note(error.to_string()),
        }
    }
}
