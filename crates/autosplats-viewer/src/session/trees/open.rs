//! Opening inputs as octrees, on the thread that reads inputs.

use std::collections::HashMap;
use std::sync::Arc;

use autosplats::cloud::glam::{DMat4, DVec3};
use autosplats::cloud::{ErrorKind, Progress, Tree, Unit, Wanted};
use autosplats::{Coarsest, PlacedTree, guess_axes};
use autosplats_formats::ReadOptions;
use autosplats_sources::MIN_TREE_POINTS;

use super::TreeOptions;
use crate::session::Input;
use crate::session::document::OpenTree;

/// Most points that stand for all.
const SAMPLE_POINTS: usize = 1 << 17;

/// Opens octrees, and decides which inputs are read whole.
#[derive(Debug)]
pub(crate) struct TreeOpener {
    detail: Option<f64>,
    /// Numbers of points of the octrees that were read whole, by the name of the input.
    whole: HashMap<String, u64>,
}

impl TreeOpener {
    pub(crate) fn new(options: &TreeOptions) -> Self {
        Self { detail: options.detail, whole: HashMap::new() }
    }

    /// Opens an input and reads its coarsest points. `None` if it is to be read whole: as no octree, or as a file whose
    /// points and those of the files before are few.
    ///
    /// # Errors
    /// `None` if `progress` cancels; else why it cannot be read.
    pub(crate) fn open(
        &mut self,
        input: &Input,
        options: &ReadOptions,
        progress: &dyn Progress,
    ) -> Result<Option<Arc<OpenTree>>, Option<String>> {
        let why = |error: autosplats::Error| {
            (error.kind() != ErrorKind::Cancelled).then(|| match error {
                autosplats::Error::NothingVisible(why) => format!("{}: {why}", input.name),
                error => error.to_string(),
            })
        };
        let tree = match self.detail {
            Some(0.0) => None,
            _ => input.source.open_tree(options, progress).map_err(|error| why(error.into()))?,
        };
        if tree.is_none() && self.detail.is_some_and(|detail| detail > 0.0) {
            progress
                .note("--detail and --points-budget are ignored: it is no octree (COPC, EPT), so all points are read");
        }
        let Some(tree) = tree.filter(|tree| !self.reads_whole(input, &**tree)) else { return Ok(None) };
        let info = tree.info();
        info.notes.iter().for_each(|note| progress.note(note));
        let origin = Some(middle(&*tree));
        let fields = Some(Vec::new());
        let wanted = Wanted { colors: true, fields, keep: options.keep.clone(), origin, ..Wanted::default() };
        let placed = [PlacedTree { tree: Arc::clone(&tree), world_from_tree: DMat4::IDENTITY }];
        let Coarsest { wanted, nodes, mut sample } = Coarsest::load(&placed, wanted, progress).map_err(why)?;
        tree.take_notes().iter().for_each(|note| progress.note(note));
        let first = nodes.into_iter().map(|(node, cloud)| (node.key, Arc::new(cloud))).collect();
        let axes = guess_axes(&sample);
        let step = sample.len().div_ceil(SAMPLE_POINTS).max(1);
        sample.retain(|index| index % step == 0);
        let sample = Arc::new(sample.with_axes(axes));
        Ok(Some(Arc::new(OpenTree { tree, options: options.clone(), wanted, sample, first, axes })))
    }

    fn reads_whole(&mut self, input: &Input, tree: &dyn Tree) -> bool {
        // Only points that are read whole can be shown in degrees.
        let in_degrees = tree.info().crs.unit == Some(Unit::Degree);
        let name = input.source_name();
        let others: u64 = self.whole.iter().filter(|(other, _)| **other != name).map(|(_, points)| points).sum();
        let are_few = input.source.path().is_some() && others.saturating_add(tree.info().points) < MIN_TREE_POINTS;
        let whole = in_degrees || are_few && self.detail.is_none();
        if whole {
            self.whole.insert(name, tree.info().points);
        }
        whole
    }
}

/// A place of whole numbers in the middle of a tree, the origin of all its points.
fn middle(tree: &dyn Tree) -> DVec3 {
    let info = tree.info();
    let boxes = [info.bounds, info.cube];
    let middles = boxes.into_iter().map(|[low, high]| low.midpoint(high).round());
    middles.into_iter().find(|middle| middle.is_finite()).unwrap_or_default()
}
