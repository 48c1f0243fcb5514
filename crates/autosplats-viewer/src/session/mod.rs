//! The session: what is open, and how it is edited, read and played. It knows no camera and draws nothing.

mod appearance;
pub(crate) mod document;
mod editing;
mod glance;
mod kept;
mod loading;
pub(crate) mod measure;
mod opening;
mod playing;
mod trees;

use std::collections::HashMap;
use std::path::PathBuf;

use autosplats::cloud::Axes;
use autosplats::cloud::glam::DVec3;
pub(crate) use autosplats_sources::Input;
use eframe::egui;

pub(crate) use self::appearance::Appearance;
pub(crate) use self::document::{
    ClipBox, Counts, Document, ExportError, ExportScope, Exported, Grip, History, Layer, LayerId, PickedPoint, Region,
    Replace, SelectMode, ShownCloud,
};
pub(crate) use self::editing::CachedCounts;
pub(crate) use self::glance::{FirstLook, SharedViewFrame, ViewFrame};
pub(crate) use self::kept::StoredInput;
pub(crate) use self::loading::{JobId, JobNews, Loader, Watch, read_options};
pub(crate) use self::measure::Ruler;
pub(crate) use self::opening::{Arrival, JobTarget};
pub(crate) use self::playing::{Clock, Playing, Reel, SPEEDS, WaitingInput};
pub use self::trees::TreeOptions;
pub(crate) use self::trees::{START_SIZE, Sight, TreeHandle, TreeStatus, Trees, refuse_edits};
use crate::messages::MessageSender;

/// What is open.
pub(crate) struct Session {
    pub(crate) history: History,
    /// Version of the document; every change increases it.
    pub(crate) version: u64,
    counted: CachedCounts,
    /// The clipping box before the unfinished change; the inner `None` is no box.
    clip_before: Option<Option<ClipBox>>,
    pub(crate) loader: Loader,
    /// What the points of each job are for.
    jobs: HashMap<JobId, JobTarget>,
    /// The watched files, which are read again when they change; `None` watches none.
    watches: Option<HashMap<PathBuf, Watch>>,
    pub(crate) playing: Playing,
    pub(crate) trees: Trees,
    /// The input that each layer was read from.
    pub(crate) inputs: HashMap<LayerId, Input>,
    /// Inputs that could not be read. A session keeps them.
    failed: Vec<(Input, Appearance)>,
    /// Recently opened inputs, newest first.
    pub(crate) recent: Vec<StoredInput>,
    /// File of the session, written on exit.
    pub(crate) file: Option<PathBuf>,
    /// The up axis that the user chose; `None` uses the guessed one.
    pub(crate) up_axis: Option<Axes>,
    pub(crate) guessed_axes: Option<Axes>,
    /// What the reading thread found about the only open input, and the document version that this holds for.
    pub(crate) glance: Option<(u64, FirstLook)>,
    /// The points that have arrived since the view was told.
    arrival: Arrival,
    pub(crate) messages: MessageSender,
}

impl Session {
    /// An empty session, to be stored in `file`. `context` is asked for a repaint when a thread has read something.
    pub(crate) fn new(
        file: Option<PathBuf>,
        watch: bool,
        recent: Vec<StoredInput>,
        trees: TreeOptions,
        messages: MessageSender,
        context: &egui::Context,
    ) -> Self {
        Self {
            history: History::default(),
            version: 1,
            counted: CachedCounts::default(),
            clip_before: None,
            loader: Loader::start(&trees, context.clone()),
            jobs: HashMap::new(),
            watches: watch.then(HashMap::new),
            playing: Playing::default(),
            trees: Trees::start(trees, context),
            inputs: HashMap::new(),
            failed: Vec::new(),
            recent,
            file,
            up_axis: None,
            guessed_axes: None,
            glance: None,
            arrival: Arrival::Nothing,
            messages,
        }
    }

    /// Whether nothing is open, being read or playing.
    pub(crate) fn is_empty(&self) -> bool {
        self.document().layers.is_empty() && self.loader.jobs().is_empty() && self.playing.is_empty()
    }

    /// The up axis: as chosen, else as guessed, else Z.
    pub(crate) fn axes(&self) -> Axes {
        self.up_axis.or(self.guessed_axes).unwrap_or(Axes::ZUp)
    }

    /// Chooses the next up axis: as guessed, then Z, Y, X, -Z, -Y, -X, and a camera's frame.
    pub(crate) fn change_up_axis(&mut self) {
        let next = match self.up_axis {
            None => 0,
            Some(axes) => Axes::ALL.iter().take_while(|&&other| other != axes).count() + 1,
        };
        self.up_axis = Axes::ALL.get(next).copied();
    }

    /// Unit vector upward, world space.
    pub(crate) fn up(&self) -> DVec3 {
        self.axes().up()
    }

    /// A ruler in the units of the first layer.
    pub(crate) fn ruler(&self) -> Ruler {
        let crs = self.document().layers.first().map(|layer| layer.cloud.crs().clone()).unwrap_or_default();
        Ruler::new(&crs, self.up())
    }
}
