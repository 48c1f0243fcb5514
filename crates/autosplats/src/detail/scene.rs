//! Scans of any size, of which what a picture needs is in memory.

use autosplats_cloud::{
    Axes, FieldValues, Key, Node, NodeKey, PointCloud, PointPool, Progress, SLOT_POINTS, Traffic, Wanted,
};
use glam::{DMat4, DVec3};

use super::{Choice, Detail, NodePoints, PlacedTree, SPARE_SLOTS, choose_loading, load_nodes};
use crate::Error;
use crate::camera::Camera;

/// Trees, of which the nodes of the last pictures are in memory.
///
/// ```no_run
/// use std::sync::Arc;
///
/// use autosplats::cloud::{Tree, Wanted, glam::DMat4};
/// use autosplats::{Camera, Detail, PlacedTree, Projection, Renderer, Settings, TreeScene, ViewDirection, guess_axes};
///
/// # fn picture(tree: Arc<dyn Tree>) -> Result<(), autosplats::Error> {
/// let trees = vec![PlacedTree { tree, world_from_tree: DMat4::IDENTITY }];
/// let wanted = Wanted { colors: true, fields: Some(Vec::new()), ..Wanted::default() };
/// let mut scene = TreeScene::open(trees, wanted, 500 << 20, 10_000_000, &())?;
/// let (axes, projection) = (guess_axes(scene.sample()), Projection::PerspectiveFovDeg(40.0));
/// let camera = Camera::fit(scene.sample(), axes, ViewDirection::Auto, 16.0 / 9.0, projection)?;
/// let shown = scene.show(&camera, [1920, 1080], &Detail::default(), &())?;
/// println!("{} points, {} pixels apart", shown.points, shown.spacing_px);
/// let frame = Renderer::new().render(scene.points(), &camera, [1920, 1080], &Settings::default())?;
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct TreeScene {
    trees: Vec<PlacedTree>,
    wanted: Wanted,
    pool: PointPool,
}

/// What is shown after [`TreeScene::show`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shown {
    /// Number of nodes.
    pub nodes: usize,
    /// Number of their points, as stated by the hierarchy.
    pub points: u64,
    /// See [`Choice::spacing_px`].
    pub spacing_px: f64,
    /// Number of nodes that were not in memory.
    pub loaded: usize,
    /// Number of their points, as stated by the hierarchy.
    pub loaded_points: u64,
    /// Number of nodes that cannot be decoded, and of their points.
    pub damaged: [u64; 2],
    /// Why the first of them cannot be decoded.
    pub damage: Option<String>,
}

/// The coarsest points of trees: those of the roots and of the nodes below these.
#[derive(Debug)]
pub struct Coarsest {
    /// What is wanted of all nodes: what was asked for, or all points if the usual filter leaves none of the coarsest.
    pub wanted: Wanted,
    /// The nodes, in the order of their keys, each with the columns that any of the trees has. None if finer nodes
    /// alone may have what the filter keeps.
    pub nodes: Vec<(NodeKey, PointCloud)>,
    /// Points that stand for all of the trees. Where there are no `nodes`, these are points that the filter leaves out.
    pub sample: PointCloud,
}

impl Coarsest {
    /// Reads the coarsest points.
    ///
    /// # Errors
    /// Those of reading; [`Error::NothingVisible`] if there are no points.
    pub fn load(trees: &[PlacedTree], wanted: Wanted, progress: &dyn Progress) -> Result<Self, Error> {
        let mut wanted = wanted;
        let mut nodes = coarsest(trees, &wanted, progress)?;
        let mut sample = sample_of(trees, &nodes);
        if let Some(filter) = wanted.keep.clone().filter(|_| !sample.has_finite(1)) {
            // Finer nodes may have what the filter keeps. All points tell where to look.
            let all = Wanted { keep: None, ..wanted.clone() };
            nodes = coarsest(trees, &all, progress)?;
            sample = sample_of(trees, &nodes);
            if filter.is_usual() {
                progress.note("all of the coarsest points are noise or withheld, so such points are kept");
                wanted = all;
            } else {
                nodes.clear();
            }
        }
        if !sample.has_finite(1) {
            return Err(Error::NothingVisible("the coarsest points have no finite coordinates".into()));
        }
        Ok(Self { wanted, nodes, sample })
    }
}

impl TreeScene {
    /// Reads the coarsest points of trees, and reserves up to `memory` bytes for the points of pictures, which have at
    /// most `max_points` each.
    ///
    /// # Errors
    /// Those of reading; [`Error::NothingVisible`] if there are no points; an error of the kind
    /// [`Memory`](autosplats_cloud::ErrorKind::Memory) if the memory is not there.
    pub fn open(
        trees: Vec<PlacedTree>,
        wanted: Wanted,
        memory: u64,
        max_points: usize,
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let Coarsest { wanted, nodes: first, sample } = Coarsest::load(&trees, wanted, progress)?;
        let fits = memory / PointPool::bytes_per_point(&sample) as u64 / SLOT_POINTS as u64;
        // Every picture may use half of the slots.
        let needed = 2 * Detail::of_points(1.0, max_points).max_slots as u64;
        let all = slots_of_all(&trees).map_or(u64::MAX, |slots| 2 * (slots + SPARE_SLOTS as u64));
        let most = u64::from(u32::MAX) / SLOT_POINTS as u64 - 1;
        let capacity = fits.min(needed).min(all).min(most) * SLOT_POINTS as u64;
        let mut pool = PointPool::new(&sample, capacity as usize)?;
        for (node, cloud) in &first {
            // What does not fit is loaded again when it is needed.
            pool.insert(*node, cloud);
        }
        Ok(Self { trees, wanted, pool })
    }

    /// Sets which axis points up.
    #[must_use]
    pub fn with_axes(self, axes: Axes) -> Self {
        Self { pool: self.pool.with_axes(axes), ..self }
    }

    /// The trees.
    pub fn trees(&self) -> &[PlacedTree] {
        &self.trees
    }

    /// Points that stand for all: the coarsest ones.
    pub fn sample(&self) -> &PointCloud {
        self.pool.sample()
    }

    /// The points to render: those of the last [choice](Self::show).
    pub fn points(&self) -> &PointPool {
        &self.pool
    }

    /// What a picture is made from, with the limits of the memory.
    ///
    /// # Errors
    /// Those of [`choose_loading`].
    pub fn choose(
        &self,
        camera: &Camera,
        size: [u32; 2],
        detail: &Detail,
        progress: &dyn Progress,
    ) -> Result<Choice, Error> {
        let max_slots = detail.max_slots.min(self.pool.capacity() / SLOT_POINTS / 2);
        choose_loading(&self.trees, camera, size, &Detail { max_slots, ..*detail }, progress)
    }

    /// Chooses the points of a picture of `size` pixels and loads those that are not in memory. The result depends on
    /// the trees, the camera, the size and the detail alone.
    ///
    /// # Errors
    /// Those of [`choose`](Self::choose) and of reading.
    pub fn show(
        &mut self,
        camera: &Camera,
        size: [u32; 2],
        detail: &Detail,
        progress: &dyn Progress,
    ) -> Result<Shown, Error> {
        let Choice { nodes, points, spacing_px, .. } = self.choose(camera, size, detail, progress)?;
        // What is there already must not leave to make room.
        let missing = self.pool.choose(&nodes);
        let (nodes_shown, loaded) = (nodes.len(), missing.len());
        let mut shown = Shown { nodes: nodes_shown, points, spacing_px, loaded, ..Shown::default() };
        let Self { trees, wanted, pool } = self;
        let stated = |node: &NodeKey| match trees[node.tree as usize].tree.node(node.key) {
            Node::Known { points, .. } => u64::from(points),
            Node::Absent | Node::Unknown => 0,
        };
        shown.loaded_points = missing.iter().map(stated).sum();
        load_nodes(trees, &missing, wanted, progress, |NodePoints { node, cloud, damage }| {
            if let Some(damage) = damage {
                shown.damaged[0] += 1;
                shown.damaged[1] += stated(&node);
                shown.damage.get_or_insert(damage);
            }
            let cloud = completed(cloud, pool.sample());
            // Half of the slots suffices for what is chosen, unless a single node is larger.
            if !pool.insert(node, &cloud) {
                let what = format!("the {} points of node {}", cloud.len(), node.key);
                return Err(autosplats_cloud::Error::OutOfMemory { what, bytes: cloud.byte_len() }.into());
            }
            Ok(())
        })?;
        pool.choose(&nodes);
        Ok(shown)
    }

    /// What decoding has found odd since the last call.
    pub fn take_notes(&self) -> Vec<String> {
        self.trees.iter().flat_map(|placed| placed.tree.take_notes()).collect()
    }

    /// What has been read so far.
    pub fn traffic(&self) -> Traffic {
        self.trees.iter().map(|placed| placed.tree.traffic()).fold(Traffic::default(), |sum, one| Traffic {
            requests: sum.requests + one.requests,
            bytes: sum.bytes + one.bytes,
        })
    }
}

/// Slots that all nodes take; `None` if not all are known, as in large trees.
fn slots_of_all(trees: &[PlacedTree]) -> Option<u64> {
    let mut slots = 0;
    for placed in trees {
        let mut keys = vec![Key::ROOT];
        while let Some(key) = keys.pop() {
            match placed.tree.node(key) {
                Node::Absent => {}
                Node::Unknown => return None,
                Node::Known { points, .. } => {
                    slots += u64::from(points).div_ceil(SLOT_POINTS as u64);
                    keys.extend(key.children());
                }
            }
        }
    }
    Some(slots)
}

/// The roots and their children, with the columns that any of the trees has.
fn coarsest(
    trees: &[PlacedTree],
    wanted: &Wanted,
    progress: &dyn Progress,
) -> Result<Vec<(NodeKey, PointCloud)>, Error> {
    let mut nodes = Vec::new();
    for (tree, placed) in trees.iter().enumerate() {
        let keys: Vec<Key> = std::iter::once(Key::ROOT).chain(Key::ROOT.children()).collect();
        placed.tree.load_pages(&keys[..1], progress)?;
        placed.tree.load_pages(&keys[1..], progress)?;
        let known = keys.into_iter().filter(|&key| matches!(placed.tree.node(key), Node::Known { points: 1.., .. }));
        nodes.extend(known.map(|key| NodeKey { key, tree: tree as u32 }));
    }
    let mut columns = PointCloud::new(DVec3::ZERO, Vec::new());
    let infos = || trees.iter().map(|placed| placed.tree.info());
    if wanted.colors && infos().any(|info| info.colors) {
        columns = columns.with_colors(Vec::new())?;
    }
    for field in infos().flat_map(|info| &info.fields).filter(|field| wanted.wants(field)) {
        if columns.field(field).is_none() {
            columns = columns.with_field(field, FieldValues::U8(Vec::new()))?;
        }
    }
    let (mut first, mut damaged) = (Vec::new(), None);
    load_nodes(trees, &nodes, wanted, progress, |NodePoints { node, cloud, damage }| {
        // A damaged node is told of when a picture needs it.
        match damage {
            None => first.push((node, completed(cloud, &columns))),
            Some(damage) => damaged = Some(damage),
        }
        Ok(())
    })?;
    match damaged.filter(|_| first.is_empty()) {
        Some(damage) => Err(Error::NothingVisible(damage)),
        None => Ok(first),
    }
}

/// Points that stand for all of the trees.
fn sample_of(trees: &[PlacedTree], first: &[(NodeKey, PointCloud)]) -> PointCloud {
    let parts: Vec<_> = first.iter().map(|(_, cloud)| (cloud, DMat4::IDENTITY)).collect();
    let sample = PointCloud::merged(&parts);
    // Poses may turn what the files state.
    let infos = || trees.iter().map(|placed| placed.tree.info());
    let axes = infos().next().and_then(|info| info.axes);
    let agree =
        infos().all(|info| info.axes == axes) && trees.iter().all(|placed| placed.world_from_tree == DMat4::IDENTITY);
    match axes.filter(|_| agree) {
        Some(axes) => sample.with_axes(axes),
        None => sample,
    }
}

/// A node with all columns of `like`. A tree leaves out what is zero at every point of a node.
fn completed(mut node: PointCloud, like: &PointCloud) -> PointCloud {
    let len = node.len();
    let fits = "one value for each point";
    if like.colors().is_some() && node.colors().is_none() {
        node = node.with_colors(vec![[0; 3]; len]).expect(fits);
    }
    for field in like.fields() {
        if node.field(&field.name).is_none() {
            node = node.with_field(&field.name, FieldValues::U8(vec![0; len])).expect(fits);
        }
    }
    node
}
