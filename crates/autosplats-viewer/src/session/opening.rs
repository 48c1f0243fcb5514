//! Inputs: opened, filled as their points arrive, read again, removed.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use autosplats::cloud::{PointCloud, PointFilter};
use autosplats_sources::Source;

use crate::session::document::{Bits, LayerTree};
use crate::session::{Appearance, FirstLook, Input, JobId, JobNews, Layer, LayerId, Session, StoredInput};

/// Number of recent inputs kept.
const MAX_RECENT_INPUTS: usize = 12;

/// What the points of a job are for.
pub(crate) enum JobTarget {
    /// A layer of this appearance, which the first points create.
    New(Appearance),
    /// A layer that has some of the points.
    Growing(LayerId),
    /// A layer whose points are replaced once all are read.
    Again(LayerId),
}

/// The points that have arrived, as far as they concern the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Arrival {
    /// None.
    #[default]
    Nothing,
    /// Points beside others.
    More,
    /// The first points of an empty document.
    First,
}

impl Session {
    /// Opens an input with the default appearance.
    pub(crate) fn open(&mut self, input: Input) {
        self.open_as(input, Appearance::default());
    }

    /// Opens an input with an appearance.
    pub(crate) fn open_as(&mut self, input: Input, appearance: Appearance) {
        if !matches!(input.source, Source::Scene(..) | Source::StandardInput) {
            let kept = StoredInput::of(&input, Appearance::default());
            self.recent.retain(|known| known.source != kept.source);
            self.recent.insert(0, kept);
            self.recent.truncate(MAX_RECENT_INPUTS);
        }
        if let (Some(path), Some(watches)) = (input.source.path(), &mut self.watches) {
            watches.entry(path.into()).or_insert_with(|| self.loader.watch(path.into()));
        }
        self.forget_failure_of(&input);
        if input.moves() {
            self.play(input, appearance);
            return;
        }
        let job = self.loader.read(input);
        self.jobs.insert(job, JobTarget::New(appearance));
    }

    /// Opens a stored input, read and played as before.
    pub(crate) fn open_again(&mut self, kept: StoredInput) {
        match kept.open(Path::new("")) {
            Ok((input, appearance)) => self.open_as(input, appearance),
            Err(error) => self.messages.error(error.to_string()),
        }
    }

    /// Remembers an input that could not be read, for the session.
    pub(crate) fn fail(&mut self, input: Input, appearance: Appearance) {
        self.forget_failure_of(&input);
        self.failed.push((input, appearance));
    }

    /// Removes an input from the failed ones, since it is opened again and a session stores each input once.
    fn forget_failure_of(&mut self, input: &Input) {
        let name = input.source_name();
        self.failed.retain(|(failed, _)| failed.source_name() != name);
    }

    /// Receives what has been read and played up to window time `now`, seconds. Returns what has arrived.
    pub(crate) fn follow(&mut self, now: f64) -> Arrival {
        self.follow_files();
        self.follow_trees();
        self.follow_streams(now);
        std::mem::take(&mut self.arrival)
    }

    /// Receives what has been read and which files have changed.
    fn follow_files(&mut self) {
        for (input, job, news) in self.loader.news() {
            let again = match self.jobs.get(&job) {
                Some(JobTarget::Again(id)) => Some(*id),
                _ => None,
            };
            match news {
                JobNews::Preview(..) if again.is_some() => {}
                JobNews::Preview(cloud, glance) => {
                    if let Some(id) = self.fill_layer(&input, job, &cloud) {
                        self.examined(id, glance);
                    }
                }
                JobNews::Read(cloud, glance, notes, hidden) => {
                    notes.into_iter().for_each(|note| self.messages.note(format!("{}: {note}", input.name)));
                    if let Some(id) = again {
                        self.jobs.remove(&job);
                        self.read_again(&input, id, &cloud, glance, &hidden);
                    } else if let Some(id) = self.fill_layer(&input, job, &cloud) {
                        self.jobs.remove(&job);
                        self.settle(|document| {
                            document.complete(id);
                            document.set_hidden(id, &hidden);
                        });
                        self.examined(id, glance);
                    }
                }
                JobNews::Opened(tree, cloud, glance, notes) => {
                    notes.into_iter().for_each(|note| self.messages.note(format!("{}: {note}", input.name)));
                    self.open_tree(&input, job, &tree, &cloud, glance);
                }
                JobNews::Failed(why) => {
                    self.messages.error(why);
                    let appearance = self.forget_job(job);
                    // A failed reload keeps the old points.
                    if again.is_none() {
                        self.fail(input, appearance);
                    }
                }
                JobNews::Cancelled => {
                    if again.is_none() {
                        self.messages.note(format!("{}: reading was cancelled", input.name));
                    }
                    self.forget_job(job);
                }
            }
        }
        let changed: Vec<PathBuf> = self.loader.changed().collect();
        changed.iter().for_each(|path| self.reload(path));
    }

    /// Shows the coarsest points of an octree. Edits made while it was opened again are kept, and the octree dropped.
    fn open_tree(&mut self, input: &Input, job: JobId, tree: &LayerTree, cloud: &Arc<PointCloud>, glance: FirstLook) {
        let id = match self.jobs.remove(&job) {
            Some(JobTarget::Again(id) | JobTarget::Growing(id)) => {
                if self.history.is_unsaved(id) {
                    self.tell_kept_edits(input);
                    return;
                }
                if self.document().layer(id).is_none() {
                    return;
                }
                self.messages.note(format!("{} was opened again", input.name));
                self.inputs.insert(id, input.clone());
                id
            }
            Some(JobTarget::New(appearance)) => self.add_layer(input, cloud, appearance, false),
            None => return,
        };
        self.settle(|document| document.set_tree(id, tree, cloud));
        self.examined(id, glance);
    }

    fn tell_kept_edits(&self, input: &Input) {
        let name = &input.name;
        self.messages.note(format!("{name} has changed; its new points are not shown, because it has unsaved edits"));
    }

    /// Puts the points of a job into its layer, which the first points create. Undo does not revert this. Returns the
    /// layer, or `None` if the user has removed it.
    fn fill_layer(&mut self, input: &Input, job: JobId, cloud: &Arc<PointCloud>) -> Option<LayerId> {
        let appearance = match self.jobs.get(&job) {
            Some(&JobTarget::Growing(id)) if self.document().layer(id).is_none() => {
                self.loader.cancel(job);
                self.jobs.remove(&job);
                return None;
            }
            Some(&JobTarget::Growing(id)) => {
                self.fill(id, cloud);
                return Some(id);
            }
            Some(JobTarget::New(appearance)) => *appearance,
            _ => Appearance::default(),
        };
        let id = self.add_layer(input, cloud, appearance, true);
        self.jobs.insert(job, JobTarget::Growing(id));
        Some(id)
    }

    /// Adds a layer with the first points of an input. `incomplete` says whether points are still to come or to change.
    pub(crate) fn add_layer(
        &mut self,
        input: &Input,
        cloud: &Arc<PointCloud>,
        appearance: Appearance,
        incomplete: bool,
    ) -> LayerId {
        let path = input.source.path().map(Path::to_path_buf);
        let mut layer = Layer::new(&*input.name, path, Arc::clone(cloud)).opened_at(input.world_from_input);
        Appearance { visible: layer.visible, tint: layer.tint } = appearance;
        layer.incomplete = incomplete;
        if self.document().layers.is_empty() {
            self.arrival = Arrival::First;
        }
        let id = layer.id;
        // Forgets the inputs of layers that undo can no longer bring back.
        self.inputs.retain(|&known, _| self.history.holds(known));
        self.inputs.insert(id, input.clone());
        self.settle(|document| document.add(layer.clone()));
        id
    }

    /// Receives what a first look at the new points of a layer has found.
    pub(crate) fn examined(&mut self, id: LayerId, glance: FirstLook) {
        self.arrival = self.arrival.max(Arrival::More);
        if self.document().layers.first().is_some_and(|layer| layer.id == id) {
            self.guessed_axes = Some(glance.axes);
        }
        let document = self.document();
        let alone = match document.layers.as_slice() {
            [only] => only.visible && only.pose == only.opened_at,
            _ => false,
        };
        let whole = !document.clip.as_ref().is_some_and(|clip| clip.enabled);
        self.glance = Some((self.version, glance)).filter(|_| alone && whole);
    }

    /// The first look at the only input, if the document has not changed since.
    pub(crate) fn glance(&self) -> Option<&FirstLook> {
        self.glance.as_ref().filter(|(version, _)| *version == self.version).map(|(_, glance)| glance)
    }

    /// Removes the layer of a job that will not be finished. Returns the appearance of the layer, or the intended one.
    fn forget_job(&mut self, job: JobId) -> Appearance {
        match self.jobs.remove(&job) {
            Some(JobTarget::New(appearance)) => appearance,
            Some(JobTarget::Growing(id)) => {
                let layer = self.document().layer(id);
                let appearance = layer.map(|layer| Appearance { visible: layer.visible, tint: layer.tint });
                self.settle(|document| document.remove(id));
                appearance.unwrap_or_default()
            }
            Some(JobTarget::Again(_)) | None => Appearance::default(),
        }
    }

    /// Cancels a layer that is still being read or played.
    pub(crate) fn give_up(&mut self, id: LayerId) {
        if self.playing.stop(id) {
            self.settle(|document| document.remove(id));
        }
        let grows = |target: &JobTarget| matches!(target, JobTarget::Growing(layer) if *layer == id);
        let job = self.jobs.iter().find_map(|(&job, target)| grows(target).then_some(job));
        if let Some(job) = job {
            self.loader.cancel(job);
            self.forget_job(job);
        }
    }

    /// Cancels all inputs that have no points yet.
    pub(crate) fn give_up_waiting(&mut self) {
        self.loader.cancel_all();
        self.playing.give_up_waiting();
    }

    /// Removes layers as an undo step. Layers that are still being read or played are cancelled.
    pub(crate) fn remove(&mut self, ids: &[LayerId]) {
        let incomplete = |id: &LayerId| self.document().layer(*id).is_some_and(|layer| layer.incomplete);
        let (unread, ids): (Vec<LayerId>, Vec<LayerId>) = ids.iter().copied().partition(incomplete);
        unread.into_iter().for_each(|id| self.give_up(id));
        if ids.is_empty() {
            return;
        }
        let label = if let [_] = ids[..] { "Remove an input" } else { "Close all" };
        self.edit(label, |document| {
            ids.iter().for_each(|&id| {
                document.remove(id);
            });
        });
    }

    /// Shows the new points of a file. Edits made meanwhile apply to the old points, so that the new ones are dropped.
    fn read_again(&mut self, input: &Input, id: LayerId, cloud: &Arc<PointCloud>, glance: FirstLook, hidden: &Bits) {
        if self.history.is_unsaved(id) {
            self.tell_kept_edits(input);
        } else if self.document().layer(id).is_some() {
            self.fill(id, cloud);
            self.settle(|document| document.set_hidden(id, hidden));
            self.inputs.insert(id, input.clone());
            self.messages.note(format!("{} was read again", input.name));
            self.examined(id, glance);
        }
    }

    /// Reads the layers of a changed file again.
    fn reload(&mut self, path: &Path) {
        let whole = |layer: &&Layer| !layer.incomplete || self.playing.shows(layer.id);
        let layers = self.document().layers.iter().filter(|layer| layer.path.as_deref() == Some(path)).filter(whole);
        let ids: Vec<_> = layers.map(|layer| layer.id).collect();
        ids.into_iter().for_each(|id| self.reload_layer(id));
    }

    /// Reads the input of a layer again. A layer with unsaved edits is kept, with a note, since the edits apply to the
    /// old points.
    pub(crate) fn reload_layer(&mut self, id: LayerId) {
        if let Some(input) = self.inputs.get(&id).cloned() {
            self.read_anew(id, input);
        }
    }

    /// Chooses which points of a layer are shown. All points are shown at once; for any other choice the input is read
    /// again.
    pub(crate) fn keep(&mut self, id: LayerId, filter: PointFilter) {
        let Some(input) = self.inputs.get_mut(&id) else { return };
        let is_tree = self.history.current().layer(id).is_some_and(|layer| layer.tree.is_some());
        if filter.is_all() && !input.moves() && !is_tree {
            input.options.keep = Some(filter);
            self.settle(|document| document.set_hidden(id, &Bits::default()));
            return;
        }
        let mut input = input.clone();
        input.options.keep = Some(filter);
        self.read_anew(id, input);
    }

    /// Shows all hidden points as an undo step. A session remembers that nothing is left out.
    pub(crate) fn show_all(&mut self) {
        let hiding = self.document().layers.iter().filter(|layer| !layer.edits.hidden.is_empty());
        let ids: Vec<LayerId> = hiding.map(|layer| layer.id).collect();
        for id in ids {
            if let Some(input) = self.inputs.get_mut(&id) {
                input.options.keep = Some(PointFilter::all());
            }
        }
        self.edit_points("Show", |document| document.show_all());
    }

    /// Reads a layer from an input that differs from its own in options.
    fn read_anew(&mut self, id: LayerId, input: Input) {
        if self.history.is_unsaved(id) {
            self.messages
                .note(format!("{} has changed; it was not read again, because it has unsaved edits", input.name));
            return;
        }
        if input.moves() {
            self.inputs.insert(id, input.clone());
            self.play_anew(id, input);
            return;
        }
        // A file that keeps changing cancels its earlier reload.
        let again = |target: &JobTarget| matches!(target, JobTarget::Again(layer) if *layer == id);
        self.jobs.iter().filter(|(_, target)| again(target)).for_each(|(&job, _)| self.loader.cancel(job));
        let job = self.loader.read(input);
        self.jobs.insert(job, JobTarget::Again(id));
    }

    /// The inputs without a layer, and how they will be shown: still to be read, without points, or failed.
    pub(crate) fn without_layer(&self) -> impl Iterator<Item = (&Input, Appearance)> {
        let unread = self.loader.jobs().iter().filter_map(|job| match self.jobs.get(&job.id)? {
            JobTarget::New(appearance) => Some((&job.input, *appearance)),
            JobTarget::Growing(_) | JobTarget::Again(_) => None,
        });
        let waiting = self.playing.waiting().map(|waiting| (waiting.input, waiting.appearance));
        unread.chain(waiting).chain(self.failed.iter().map(|(input, appearance)| (input, *appearance)))
    }
}
