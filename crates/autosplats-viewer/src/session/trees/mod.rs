//! Octrees: a thread of its own loads what the view needs, and the layers show it as it comes.
//!
//! # How it works
//!
//! The window posts what it looks at; the newest [`Wish`] counts. The thread [chooses](autosplats::choose) the nodes as
//! a render does, loads those that it lacks, those that show most first, and keeps others while there is room. What is
//! there becomes the cloud of the layer: when all is there, and before that when news has waited for a quarter of a
//! second. While the view moves, no more nodes are loaded than a moving picture can show.
//!
//! A picture that has to be complete, as one for a file, is an [`Order`]: it waits until all is there.

mod inspect;
mod limits;
mod loading;
mod mailbox;
mod open;
mod store;
mod thread;

use std::sync::Arc;

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::DMat4;
use autosplats::{Camera, ColorMode};
use eframe::egui;

use self::inspect::Inspection;
pub(crate) use self::limits::START_SIZE;
pub use self::limits::TreeOptions;
use self::mailbox::Shared;
pub(super) use self::open::TreeOpener;
use crate::messages::MessageSender;
use crate::session::document::{LayerTree, OpenTree};
use crate::session::{Document, LayerId, PickedPoint, Session, ShownCloud};

/// From where octrees are seen, and how.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sight {
    pub(crate) camera: Camera,
    /// Size of the picture, pixels.
    pub(crate) size: [u32; 2],
    /// The field that colours show.
    field: Option<String>,
    /// Most points of a picture while the view moves; `None` at rest.
    moving: Option<usize>,
}

impl Sight {
    /// A view at rest.
    pub(crate) fn new(camera: Camera, size: [u32; 2], color: &ColorMode) -> Self {
        let field = match color {
            ColorMode::Classification => Some("Classification".into()),
            ColorMode::Field(name) => Some(name.clone()),
            _ => None,
        };
        Self { camera, size, field, moving: None }
    }

    /// The same view while it moves, for pictures of at most `points`.
    #[must_use]
    pub(crate) fn moving(self, points: usize) -> Self {
        Self { moving: Some(points), ..self }
    }
}

/// An octree of a document.
#[derive(Clone, Debug)]
struct WishedTree {
    layer: LayerId,
    /// The octree, and what the layer showed of it at the time.
    tree: LayerTree,
    world_from_tree: DMat4,
    visible: bool,
}

impl WishedTree {
    fn open(&self) -> &Arc<OpenTree> {
        &self.tree.open
    }
}

impl PartialEq for WishedTree {
    fn eq(&self, other: &Self) -> bool {
        // Other nodes of the same octree are no other wish.
        let Self { layer, tree, world_from_tree, visible } = self;
        let same = *layer == other.layer && Arc::ptr_eq(&tree.open, other.open());
        same && *world_from_tree == other.world_from_tree && *visible == other.visible
    }
}

/// What the window wants to see of octrees.
#[derive(Clone, Debug, PartialEq)]
struct Wish {
    sight: Sight,
    trees: Vec<WishedTree>,
    /// Whether the layers' clouds are copied into another one to be shown.
    is_copied: bool,
}

impl Wish {
    fn new(document: &Document, sight: Sight) -> Self {
        let of_tree = |layer: &crate::session::Layer| {
            let tree = layer.tree.clone()?;
            Some(WishedTree { layer: layer.id, tree, world_from_tree: layer.pose, visible: layer.visible })
        };
        let plain = match document.layers.iter().filter(|layer| layer.visible).collect::<Vec<_>>()[..] {
            [only] => only.pose == DMat4::IDENTITY && only.tint.is_none(),
            _ => false,
        };
        let is_copied = !plain || document.clip.is_some_and(|clip| clip.enabled);
        Self { sight, trees: document.layers.iter().filter_map(of_tree).collect(), is_copied }
    }
}

/// Nodes of an octree, for its layer.
type ShownNodes = (LayerId, LayerTree, Arc<PointCloud>);

/// How much is there of what the view needs of octrees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TreeStatus {
    /// Number of needed points that are there.
    pub(crate) there: u64,
    /// Number of points that the view needs.
    pub(crate) needed: u64,
    /// Number of points of the octrees.
    pub(crate) stored: u64,
    /// Largest distance on the screen, in pixels, between points to which finer ones exist.
    pub(crate) spacing_px: f64,
    /// Whether the limits leave out points that the detail asks for.
    pub(crate) is_limited: bool,
    /// Whether all is there that a picture at rest needs.
    pub(crate) complete: bool,
}

/// The window's side of the thread that loads nodes.
pub(crate) struct Trees {
    shared: Arc<Shared>,
    inspection: Inspection,
}

/// Completes documents on other threads.
#[derive(Clone)]
pub(crate) struct TreeHandle(Arc<Shared>);

impl TreeHandle {
    /// The document with all nodes that a picture needs. Blocks until they are there.
    ///
    /// # Errors
    /// Why nodes are missing.
    pub(crate) fn completed(&self, document: &Document, sight: Sight) -> Result<Document, String> {
        let mut document = document.clone();
        if document.trees().next().is_some() {
            for (layer, tree, cloud) in self.0.order(Wish::new(&document, sight))? {
                document.show_nodes(layer, &tree, &cloud);
            }
        }
        Ok(document)
    }
}

impl Trees {
    /// Starts the thread. `context` is asked for a repaint with each piece of news.
    pub(crate) fn start(options: TreeOptions, context: &egui::Context) -> Self {
        let shared = Arc::new(Shared::new(context.clone()));
        let theirs = Arc::clone(&shared);
        crate::threads::spawn("trees", move || thread::run(&theirs, &options));
        Self { shared, inspection: Inspection::default() }
    }

    /// How much is there; `None` without visible octrees.
    pub(crate) fn status(&self) -> Option<TreeStatus> {
        self.shared.status()
    }

    pub(crate) fn handle(&self) -> TreeHandle {
        TreeHandle(Arc::clone(&self.shared))
    }

    /// Whether all that was wished is done, or has failed, and the view is at rest.
    #[cfg(test)]
    pub(crate) fn is_idle(&self) -> bool {
        self.shared.is_idle()
    }
}

impl Drop for Trees {
    fn drop(&mut self) {
        self.shared.close();
    }
}

impl Session {
    /// Loads what a view needs of octrees. Never waits.
    pub(crate) fn look(&self, sight: Sight) {
        self.trees.shared.wish(Wish::new(self.document(), sight));
    }

    /// Shows the nodes that have been loaded.
    pub(super) fn follow_trees(&mut self) {
        let (nodes, told) = self.trees.shared.news();
        told.into_iter().for_each(|told| match told {
            Ok(note) => self.messages.note(note),
            Err(error) => self.messages.error(error),
        });
        let replaced = nodes.iter().filter_map(|(layer, ..)| Some(Arc::clone(&self.document().layer(*layer)?.cloud)));
        let replaced: Vec<_> = replaced.collect();
        if !replaced.is_empty() {
            // To free so many points takes longer than a window frame may.
            crate::threads::spawn("free", move || drop(replaced));
        }
        for (layer, tree, cloud) in nodes {
            let is_looked_at = self.glance.as_ref().is_some_and(|(version, _)| *version == self.version);
            self.settle(|document| document.show_nodes(layer, &tree, &cloud));
            // The extent of an octree does not depend on what is loaded.
            if let Some((version, _)) = self.glance.as_mut().filter(|_| is_looked_at) {
                *version = self.version;
            }
        }
    }

    /// Starts to read the attributes of a picked point of an octree, which are in the file only.
    pub(crate) fn inspect(&mut self, point: &PickedPoint, shown: &ShownCloud) {
        let layer = shown.layer(point.layer).filter(|layer| layer.tree.is_some());
        self.trees.inspection.stop();
        if let Some(layer) = layer {
            self.trees.inspection.start(point.clone(), layer.clone(), self.loader.context().clone());
        }
    }

    /// The picked point with all its attributes, once they are read.
    pub(crate) fn inspected(&mut self) -> Option<PickedPoint> {
        match self.trees.inspection.result()? {
            Ok(point) => Some(point),
            Err(error) => {
                self.messages.error(error);
                None
            }
        }
    }
}

/// Tells that points of octrees cannot be edited.
pub(crate) fn refuse_edits(messages: &MessageSender) {
    messages
        .note("Points of an octree cannot be selected or edited; export a clipping box, and open the exported file");
}
