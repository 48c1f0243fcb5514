//! The session: what is open, and how it is edited, read and played. It knows no camera and no window.

use std::collections::HashMap;
use std::path::PathBuf;

use autosplats::cloud::Axes;
use eframe::egui;

use crate::document::{History, LayerId};
use crate::editing::CachedCounts;
use crate::glance::FirstLook;
use crate::kept::StoredInput;
use crate::loading::{Appearance, Input, JobId, Loader, Watch};
use crate::playing::Playing;

/// What is open.
pub(crate) struct Session {
    pub(crate) history: History,
    pub(crate) loader: Loader,
    pub(crate) playing: Playing,
    /// The layer that receives the points of a job, once the layer exists.
    pub(crate) loading: HashMap<JobId, LayerId>,
    /// How each input that is being read will be shown.
    pub(crate) appearances: HashMap<JobId, Appearance>,
    /// Jobs that read a file again, and the layer that receives the points.
    pub(crate) reloads: HashMap<JobId, LayerId>,
    /// Recently opened inputs, newest first.
    pub(crate) recent: Vec<StoredInput>,
    /// File of the session, written on exit.
    pub(crate) file: Option<PathBuf>,
    /// Whether files are read again when they change.
    pub(crate) watch: bool,
    pub(crate) watches: HashMap<PathBuf, Watch>,
    /// The input that each layer was read from.
    pub(crate) inputs: HashMap<LayerId, Input>,
    /// The up axis that the user chose; `None` uses the guessed one.
    pub(crate) up_axis: Option<Axes>,
    pub(crate) guessed_axes: Option<Axes>,
    /// What the reading thread found about the only open input, and the document version that this holds for.
    pub(crate) glance: Option<(u64, FirstLook)>,
    /// Version of the document; every change increases it.
    pub(crate) version: u64,
    pub(crate) counted: CachedCounts,
    /// Inputs that could not be read. A session keeps them.
    pub(crate) failed: Vec<(Input, Appearance)>,
}

impl Session {
    /// An empty session. `context` is asked for a repaint when a thread has read something.
    pub(crate) fn new(file: Option<PathBuf>, watch: bool, recent: Vec<StoredInput>, context: &egui::Context) -> Self {
        Self {
            history: History::default(),
            loader: Loader::start(context.clone()),
            playing: Playing::default(),
            loading: HashMap::new(),
            appearances: HashMap::new(),
            reloads: HashMap::new(),
            recent,
            file,
            watch,
            watches: HashMap::new(),
            inputs: HashMap::new(),
            up_axis: None,
            guessed_axes: None,
            glance: None,
            version: 1,
            counted: CachedCounts::default(),
            failed: Vec::new(),
        }
    }
}
