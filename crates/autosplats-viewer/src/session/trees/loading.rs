//! Loading the nodes of a picture.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use autosplats::cloud::glam::DMat4;
use autosplats::cloud::{Error as CloudError, Key, Node, NodeKey, Progress as _, Wanted, usual_memory};
use autosplats::{Choice, Detail, Error, NodePoints, PlacedTree, choose, load_nodes};
use rayon::{ThreadPool, ThreadPoolBuilder, current_num_threads};

use super::limits::Limits;
use super::mailbox::{Follower, Shared};
use super::store::{Store, id_of};
use super::{ShownNodes, TreeOptions, TreeStatus, Wish, WishedTree};
use crate::session::LayerId;
use crate::session::document::{LayerTree, OpenTree};

/// Time that news waits before it is shown while more is to come.
const NEWS_WAIT: Duration = Duration::from_millis(250);
/// Time until what could not be read is tried again.
const RETRY_AFTER: Duration = Duration::from_secs(5);
/// Points that are loaded of several octrees in turn.
const TURN_POINTS: u64 = 1_000_000;

/// What is loaded, shown, and could not be read.
pub(super) struct Loading<'a> {
    shared: &'a Shared,
    options: TreeOptions,
    /// Bytes for points and pictures.
    memory: u64,
    store: Store,
    /// What each layer shows.
    shown: HashMap<LayerId, Shown>,
    shown_at: Option<Instant>,
    /// Whether something waits to be shown.
    is_waiting: bool,
    /// Number of points that the picture in work needs and that are there.
    there: u64,
    failures: HashMap<usize, Failure>,
    /// Threads that decode, so that a picture in work does not wait for nodes. `None` if there is no room for them.
    decoders: Option<Arc<ThreadPool>>,
}

/// What a layer shows: an octree, the field that the nodes have, and the nodes.
#[derive(Debug, PartialEq)]
struct Shown(usize, Option<String>, Vec<Key>);

impl Shown {
    fn of(LayerTree { open, nodes, field }: &LayerTree) -> Self {
        Self(id_of(open), field.clone(), nodes.iter().map(|node| node.key).collect())
    }
}

/// Why an octree could not be read.
struct Failure {
    again: Instant,
    why: String,
}

/// A picture of visible octrees.
pub(super) struct TreePicture<'w> {
    wish: &'w Wish,
    pub(super) trees: Vec<&'w WishedTree>,
    placed: Vec<PlacedTree>,
    detail: Detail,
    limits: Limits,
}

impl TreePicture<'_> {
    fn open(&self, node: NodeKey) -> &Arc<OpenTree> {
        self.trees[node.tree as usize].open()
    }

    /// Number of points of a node, as stated.
    fn points(&self, node: NodeKey) -> u64 {
        match self.open(node).tree.node(node.key) {
            Node::Known { points, .. } => points.into(),
            Node::Unknown | Node::Absent => 0,
        }
    }

    /// The nodes to be loaded next, by octree. All of one octree; of several, the first ones.
    fn turn(&self, missing: &[NodeKey]) -> Vec<(usize, Vec<NodeKey>)> {
        let mut points = 0;
        let fits = |node: &&NodeKey| {
            let before = points;
            points += self.points(**node);
            self.trees.len() == 1 || before == 0 || points <= TURN_POINTS
        };
        let now: Vec<NodeKey> = missing.iter().take_while(fits).copied().collect();
        let of = |tree: usize| now.iter().filter(move |node| node.tree as usize == tree).map(|node| node.key.into());
        let turns = (0..self.trees.len()).map(|tree| (tree, of(tree).collect()));
        turns.filter(|(_, nodes): &(usize, Vec<NodeKey>)| !nodes.is_empty()).collect()
    }
}

impl<'a> Loading<'a> {
    pub(super) fn new(shared: &'a Shared, options: &TreeOptions) -> Self {
        let memory = options.memory.unwrap_or_else(usual_memory);
        Self {
            shared,
            options: *options,
            memory,
            store: Store::default(),
            shown: HashMap::new(),
            shown_at: None,
            is_waiting: false,
            there: 0,
            failures: HashMap::new(),
            decoders: ThreadPoolBuilder::new().num_threads(current_num_threads()).build().ok().map(Arc::new),
        }
    }

    /// When to go on with the same wish: to show what waits, or to try again what could not be read.
    pub(super) fn due_at(&self) -> Option<Instant> {
        let shows = self.shown_at.filter(|_| self.is_waiting).map(|shown_at| shown_at + NEWS_WAIT);
        self.failures.values().map(|failure| failure.again).chain(shows).min()
    }

    /// Tries at once what could not be read.
    pub(super) fn retry_now(&mut self) {
        self.failures.values_mut().for_each(|failure| failure.again = Instant::now());
    }

    /// Why an octree could not be read.
    pub(super) fn failure(&self, tree: &WishedTree) -> Option<&str> {
        self.failures.get(&id_of(tree.open())).map(|failure| &*failure.why)
    }

    fn waits(&self, open: &Arc<OpenTree>) -> bool {
        self.failures.get(&id_of(open)).is_some_and(|failure| failure.again > Instant::now())
    }

    /// The picture of a wish; `None` if it shows no octree.
    pub(super) fn picture<'w>(&mut self, wish: &'w Wish) -> Option<TreePicture<'w>> {
        self.is_waiting = false;
        let ids: Vec<usize> = wish.trees.iter().map(|tree| id_of(tree.open())).collect();
        let is_seen = wish.trees.iter().any(|tree| tree.visible);
        self.failures.retain(|id, _| is_seen && ids.contains(id));
        self.shown.retain(|layer, _| wish.trees.iter().any(|tree| tree.layer == *layer));
        self.store.prepare(wish.trees.iter().map(WishedTree::open), wish.sight.field.as_deref());
        let trees: Vec<_> = wish.trees.iter().filter(|tree| tree.visible).collect();
        let point_bytes = trees.iter().map(|tree| tree.open().tree.point_bytes(&self.wanted(tree.open()))).max()?;
        let limits = Limits::new(self.memory, wish.sight.size, self.options.max_points, point_bytes, wish.is_copied);
        let max_points = limits.max_points.min(wish.sight.moving.unwrap_or(usize::MAX));
        let spacing_px = self.options.detail.unwrap_or(Detail::default().spacing_px);
        let detail = Detail::of_points(spacing_px, max_points);
        let place = |tree: &&WishedTree| PlacedTree {
            tree: Arc::clone(&tree.open().tree),
            world_from_tree: tree.world_from_tree,
        };
        Some(TreePicture { wish, placed: trees.iter().map(place).collect(), trees, detail, limits })
    }

    /// What is wanted of the nodes of an octree.
    fn wanted(&self, open: &OpenTree) -> Wanted {
        Wanted { fields: Some(self.store.field().map(str::to_owned).into_iter().collect()), ..open.wanted.clone() }
    }

    /// Loads what a picture needs, except of octrees that cannot be read. Shows what is there from time to time if
    /// `shows`. Returns the choice.
    pub(super) fn load(
        &mut self,
        picture: &TreePicture<'_>,
        follower: &Follower<'_>,
        shows: bool,
    ) -> Result<Choice, Error> {
        loop {
            if follower.cancelled() {
                return Err(Error::Cancelled);
            }
            let sight = &picture.wish.sight;
            let choice = choose(&picture.placed, &sight.camera, sight.size, &picture.detail)?;
            self.store.choose();
            let missing = choice.by_need.iter().copied().filter(|node| !self.store.need(picture.open(*node), node.key));
            let mut missing: Vec<NodeKey> = missing.collect();
            self.there = choice.points - missing.iter().map(|node| picture.points(*node)).sum::<u64>();
            let lacking = missing.iter().chain(&choice.unknown).map(|node| id_of(picture.open(*node)));
            let lacking: HashSet<usize> = lacking.collect();
            self.failures.retain(|id, _| lacking.contains(id));
            missing.retain(|node| !self.waits(picture.open(*node)));
            if shows {
                self.report(picture, &choice);
                self.show_in_time(picture, &choice);
            }
            let unknown = choice.unknown.iter().filter(|node| !self.waits(picture.open(**node)));
            let unknown: Vec<NodeKey> = unknown.copied().collect();
            if !unknown.is_empty() {
                for (index, placed) in picture.placed.iter().enumerate() {
                    let own = unknown.iter().filter(|node| node.tree as usize == index);
                    let keys: Vec<Key> = own.map(|node| node.key).collect();
                    let loaded = placed.tree.load_pages(&keys, follower).map_err(Error::from);
                    self.follow(picture.trees[index].open(), loaded)?;
                }
                follower.come();
                continue;
            }
            if missing.is_empty() {
                return Ok(choice);
            }
            for (index, nodes) in picture.turn(&missing) {
                self.load_of(picture, index, &nodes, &choice, follower, shows)?;
            }
        }
    }

    /// Loads nodes of one octree.
    fn load_of(
        &mut self,
        picture: &TreePicture<'_>,
        index: usize,
        nodes: &[NodeKey],
        choice: &Choice,
        follower: &Follower<'_>,
        shows: bool,
    ) -> Result<(), Error> {
        let open = picture.trees[index].open();
        let own = [PlacedTree { tree: Arc::clone(&open.tree), world_from_tree: DMat4::IDENTITY }];
        let wanted = self.wanted(open);
        let mut damaged = [0, 0];
        let mut first_damage = None;
        let decoders = self.decoders.clone();
        let take = |NodePoints { node, cloud, damage }: NodePoints| {
            let points = picture.points(NodeKey { tree: index as u32, ..node });
            if let Some(damage) = damage {
                damaged = [damaged[0] + 1, damaged[1] + points];
                first_damage.get_or_insert(damage);
            }
            self.there += points;
            self.store.insert(open, node.key, Arc::new(cloud));
            self.store.trim(picture.limits.stored_bytes);
            follower.come();
            if shows {
                self.report(picture, choice);
                self.show_in_time(picture, choice);
            }
            Ok(())
        };
        let loaded = match &decoders {
            Some(decoders) => decoders.install(|| load_nodes(&own, nodes, &wanted, follower, take)),
            None => load_nodes(&own, nodes, &wanted, follower, take),
        };
        let name = open.tree.name().file_name().unwrap_or_default().to_string_lossy();
        if let Some(damage) = first_damage {
            let [nodes, points] = damaged;
            let what = format!("{points} points in {nodes} nodes are damaged and missing; the first: {damage}");
            self.shared.tell(Err(format!("{name}: {what}")));
        }
        open.tree.take_notes().iter().for_each(|note| self.shared.tell(Ok(format!("{name}: {note}"))));
        self.follow(open, loaded)
    }

    /// Notes whether an octree could be read. It is told once why not.
    fn follow(&mut self, open: &Arc<OpenTree>, outcome: Result<(), Error>) -> Result<(), Error> {
        let Err(error) = outcome else {
            self.failures.remove(&id_of(open));
            return Ok(());
        };
        if matches!(error, Error::Cancelled | Error::Reading(CloudError::Cancelled)) {
            return Err(Error::Cancelled);
        }
        let (why, again) = (error.to_string(), Instant::now() + RETRY_AFTER);
        let before = self.failures.insert(id_of(open), Failure { again, why: why.clone() });
        if before.is_none_or(|before| before.why != why) {
            self.shared.tell(Err(format!("{why}; what is missing is tried again every few seconds")));
        }
        Ok(())
    }

    /// Tells how much is there.
    fn report(&self, picture: &TreePicture<'_>, choice: &Choice) {
        let there = self.there;
        let at_rest = picture.wish.sight.moving.is_none();
        self.shared.set_status(TreeStatus {
            there,
            needed: choice.points,
            stored: picture.trees.iter().map(|tree| tree.open().tree.info().points).sum(),
            spacing_px: choice.spacing_px,
            is_limited: at_rest && choice.spacing_px > picture.detail.spacing_px,
            complete: at_rest && there == choice.points && choice.unknown.is_empty(),
        });
    }

    /// Shows all that is there. A view that moves is followed by others, so that what it needs waits as news does.
    pub(super) fn finish(&mut self, picture: &TreePicture<'_>, choice: &Choice) {
        if picture.wish.sight.moving.is_some() {
            self.show_in_time(picture, choice);
        } else {
            self.show(picture, choice);
        }
    }

    fn show_in_time(&mut self, picture: &TreePicture<'_>, choice: &Choice) {
        if self.shown_at.is_none_or(|shown_at| shown_at.elapsed() >= NEWS_WAIT) {
            self.show(picture, choice);
        } else {
            self.is_waiting = true;
        }
    }

    /// The nodes of an octree that are there, in the order of their keys, with their ranks.
    fn nodes(&self, picture: &TreePicture<'_>, index: usize, choice: &Choice) -> Vec<(Key, usize)> {
        let open = picture.trees[index].open();
        let own = choice.by_need.iter().enumerate().filter(|(_, node)| node.tree as usize == index);
        let mut nodes: Vec<_> = own.map(|(rank, node)| (node.key, rank)).collect();
        nodes.retain(|(key, _)| self.store.get(open, *key).is_some());
        nodes.sort_unstable();
        nodes
    }

    fn cloud(&self, tree: &WishedTree, nodes: &[(Key, usize)]) -> ShownNodes {
        let open = tree.open();
        let there = nodes.iter().filter_map(|(key, rank)| Some((*key, *rank, &**self.store.get(open, *key)?)));
        let (nodes, cloud) = open.cloud(there, self.store.field());
        (tree.layer, nodes, cloud)
    }

    /// The clouds of all octrees.
    pub(super) fn clouds(&self, picture: &TreePicture<'_>, choice: &Choice) -> Vec<ShownNodes> {
        let trees = picture.trees.iter().enumerate();
        trees.map(|(index, tree)| self.cloud(tree, &self.nodes(picture, index, choice))).collect()
    }

    /// Shows what is there, where it differs from what is shown. A layer out of view keeps its nodes.
    pub(super) fn show(&mut self, picture: &TreePicture<'_>, choice: &Choice) {
        self.is_waiting = false;
        let mut new = Vec::new();
        for (index, tree) in picture.trees.iter().enumerate() {
            let nodes = self.nodes(picture, index, choice);
            let keys = nodes.iter().map(|(key, _)| *key).collect();
            let shown = Shown(id_of(tree.open()), self.store.field().map(str::to_owned), keys);
            let before = self.shown.entry(tree.layer).or_insert_with(|| Shown::of(&tree.tree));
            if nodes.is_empty() || *before == shown {
                continue;
            }
            *before = shown;
            let cloud = self.cloud(tree, &nodes);
            if !cloud.2.is_empty() {
                new.push(cloud);
            }
        }
        if !new.is_empty() {
            self.shared.show(new);
            self.shown_at = Some(Instant::now());
        }
    }
}
