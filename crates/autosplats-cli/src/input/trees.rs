//! Inputs of which a part is read: octrees.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use autosplats::PlacedTree;
use autosplats_cloud::glam::{DMat4, DVec3};
use autosplats_cloud::{Error, PointCloud};
use autosplats_formats::Part;
use autosplats_sources::{Input, MIN_TREE_POINTS, read_tree};

use super::distant::note_distant_inputs;
use super::{Inputs, failure, is_made, read_whole};
use crate::args::PartArgs;
use crate::console::Console;
use crate::exit::Failure;
use crate::progress::Bar;

impl Inputs {
    /// Reads a part of all inputs into one cloud, which may be empty. Returns the number of points of which it is a
    /// part, too.
    pub(crate) fn read_part(&self, part: &PartArgs, console: &Console) -> Result<(PointCloud, u64), Failure> {
        let &PartArgs { bounds, spacing, salvage: _ } = part;
        let all = AtomicU64::new(0);
        let mut cloud = self.read_each(console, bounds.is_some(), |input, progress| {
            let is_partial = bounds.is_some() || spacing.is_some();
            // The box is in the world: where a pose turns the input, no box of the input's is the same.
            let is_placed = input.world_from_input != DMat4::IDENTITY;
            let tree = if is_partial && !is_placed && !is_made(input) {
                input.source.open_tree(&input.options, progress)?
            } else {
                None
            };
            if let Some(tree) = tree {
                all.fetch_add(tree.info().points, Ordering::Relaxed);
                return read_tree(&*tree, &Part { bounds, spacing, ..Part::default() }, &input.options, progress);
            }
            if spacing.is_some() {
                let what = if is_placed { "has a pose" } else { "is no octree (COPC, EPT)" };
                let what = format!("--spacing: it {what}, so all of it is read; leave --spacing out, or use --voxel");
                return Err(Error::unsupported(Path::new(&input.name), what));
            }
            let cloud = read_whole(input, progress)?;
            all.fetch_add(cloud.len() as u64, Ordering::Relaxed);
            Ok(cloud)
        })?;
        bounds.iter().for_each(|&[min, max]| cloud.crop(min, max));
        Ok((cloud, all.into_inner()))
    }

    /// Whether the only input is a file that may be an octree, by its name.
    pub(crate) fn only_tree(&self) -> bool {
        matches!(self.list.as_slice(), [input] if input.name.to_ascii_lowercase().ends_with(".copc.laz"))
    }

    /// Opens the inputs as octrees, with their poses. `None` if they are to be read whole: one of them is no octree, or
    /// all are files with few points and `always` is not set.
    pub(crate) fn trees(&self, always: bool, console: &Console) -> Result<Option<Vec<PlacedTree>>, Failure> {
        let open = |input: &Input| {
            let bar = Bar::on_file("opening", Path::new(&input.name), console);
            if is_made(input) {
                return Ok(None);
            }
            let tree = input.source.open_tree(&input.options, &bar).map_err(|error| failure(input, error))?;
            Ok(tree.map(|tree| PlacedTree { tree, world_from_tree: input.world_from_input }))
        };
        let trees: Vec<Option<PlacedTree>> = self.list.iter().map(open).collect::<Result<_, Failure>>()?;
        let Some(trees) = trees.into_iter().collect::<Option<Vec<_>>>() else {
            if always {
                console.note("--detail and --points-budget are ignored: not all inputs are octrees (COPC, EPT), so all points are read");
            }
            return Ok(None);
        };
        let points: u64 = trees.iter().map(|placed| placed.tree.info().points).sum();
        let is_near = self.list.iter().all(|input| input.source.path().is_some());
        if is_near && points < MIN_TREE_POINTS && !always {
            return Ok(None);
        }
        let corners = |placed: &PlacedTree| {
            let [low, high] = placed.tree.info().bounds;
            let corner = |at: usize| {
                let [x, y, z] = [0, 1, 2].map(|axis| if at >> axis & 1 == 0 { low[axis] } else { high[axis] });
                placed.world_from_tree.transform_point3(DVec3::new(x, y, z))
            };
            let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
            (0..8).map(corner).fold(none, |[low, high], at| [low.min(at), high.max(at)])
        };
        let boxes: Vec<[DVec3; 2]> = trees.iter().map(corners).collect();
        note_distant_inputs(&boxes, |at, note| console.note(format_args!("{}: {note}", self.list[at].name)));
        Ok(Some(trees))
    }
}
