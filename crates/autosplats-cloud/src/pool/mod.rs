//! Points of many nodes in one store of limited size, for scans larger than memory.
//!
//! # How it works
//! The store has the columns of a cloud, cut into slots of [`SLOT_POINTS`] points. A node takes as many slots as it
//! needs, anywhere, and keeps them until it is removed. So the index of a point is an address in the store, which stays
//! the same while the point's node stays. Positions are about the origin of their node, not of the scan: far from the
//! scan's origin they keep their digits. See docs/decisions/0041-runs-and-slots.md.
//!
//! What the scan is, and what is loaded of it, are two things. Axes, coordinate system, exposure and the origins of
//! values come from a [sample](PointPool::sample) once, so that no picture flickers as nodes come and go.

#[cfg(test)]
mod tests;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use glam::DVec3;

use crate::identity::Identity;
use crate::merge::GREY;
use crate::reserve::reserving;
use crate::{Axes, Error, FieldValues, NodeKey, PointCloud, RelativeValues, ValueOrigin, check_memory};

/// Points in a slot.
pub const SLOT_POINTS: usize = 1 << SLOT_SHIFT;
/// Binary logarithm of [`SLOT_POINTS`]: the slot of a point is its index shifted right by this.
pub const SLOT_SHIFT: u32 = 12;
/// Most points of the sample of a scan.
const SAMPLE_POINTS: usize = 1 << 17;

/// A run of points in the store of a cloud or a pool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointRun {
    /// Index of the first point.
    pub first: u32,
    /// Number of points.
    pub len: u32,
    /// Origin of their positions, in world coordinates.
    pub origin: DVec3,
}

/// Points of many nodes in one store of limited size. A renderer draws those of the [chosen](Self::choose) nodes.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{Key, NodeKey, PointCloud, PointPool, glam::DVec3};
///
/// let root = PointCloud::new(DVec3::new(5e6, 0.0, 0.0), vec![[0.25, 0.0, 0.0]; 5000]);
/// let mut pool = PointPool::new(&root, 100_000)?;
/// let node = |level| NodeKey::from(Key { level, ..Key::ROOT });
/// assert!(pool.insert(node(0), &root));
/// assert_eq!(pool.choose(&[node(0), node(1)]), [node(1)], "which has to be inserted yet");
/// let index = pool.index_of(node(0), 4999).expect("a point");
/// assert_eq!(pool.place_of(index), Some((node(0), 4999)));
/// assert_eq!(pool.world_position(index), Some(DVec3::new(5_000_000.25, 0.0, 0.0)));
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
#[derive(Debug)]
pub struct PointPool {
    /// At most [`SAMPLE_POINTS`] points that stand for all of the scan.
    sample: PointCloud,
    identity: Identity,
    /// Largest number of slots.
    capacity: usize,
    /// Columns of all slots in use so far.
    positions: Vec<[f32; 3]>,
    colors: Option<Vec<[u8; 3]>>,
    fields: Vec<PoolField>,
    slots: Vec<Slot>,
    /// Slots in use before that hold nothing.
    free: BTreeSet<u32>,
    nodes: BTreeMap<NodeKey, Node>,
    /// Keys of the chosen nodes, ascending.
    chosen: Vec<NodeKey>,
    /// Number of choices so far.
    choices: u64,
    generation: u64,
}

/// A scalar field of all slots, in `f32` about one origin.
#[derive(Debug)]
struct PoolField {
    name: String,
    about: ValueOrigin,
    values: FieldValues,
}

#[derive(Clone, Copy, Debug, Default)]
struct Slot {
    /// Generation of the last write.
    written: u64,
    /// Node that holds the slot, and which of its slots this is.
    owner: Option<(NodeKey, u32)>,
}

#[derive(Debug)]
struct Node {
    origin: DVec3,
    points: usize,
    slots: Vec<u32>,
    /// Choice that last contained the node, or that preceded its insertion.
    used: u64,
    is_chosen: bool,
}

impl Node {
    /// The runs of the node, one a slot, in the order of its points.
    fn runs(&self) -> impl Iterator<Item = PointRun> {
        self.slots.iter().zip((0..self.points).step_by(SLOT_POINTS)).map(|(slot, first)| PointRun {
            first: slot << SLOT_SHIFT,
            len: SLOT_POINTS.min(self.points - first) as u32,
            origin: self.origin,
        })
    }
}

impl PointPool {
    /// Makes an empty pool for a scan. The `capacity` in points is rounded down to whole slots of [`SLOT_POINTS`].
    /// Address space for all of the store is taken at once, memory as slots are used.
    ///
    /// The `sample` stands for all of the scan, like the root of a tree. From it come axes, coordinate system, exposure
    /// and origin, and the columns: which fields there are, and whether there are colours.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] if the store does not fit into the free memory; [`Error::BadValue`] for a capacity beyond
    /// 32-bit indices, or for a scan in units so large or small that only a copy in other units could be rendered.
    pub fn new(sample: &PointCloud, capacity: usize) -> Result<Self, Error> {
        let value = capacity as f64;
        if capacity >= u32::MAX as usize {
            return Err(Error::BadValue { name: "points in memory", value, rule: "below 4,294,967,295" });
        }
        let scale = sample.computing_scale();
        if scale != 1.0 {
            let rule = "6e-8 to 3e7 units, unless all points are read at once";
            return Err(Error::BadValue { name: "size of the scan", value: 1.0 / scale, rule });
        }
        let capacity = capacity >> SLOT_SHIFT;
        let points = capacity << SLOT_SHIFT;
        let bytes = points as u64 * Self::bytes_per_point(sample) as u64;
        check_memory("the points in memory", bytes)?;
        let full = |_| Error::OutOfMemory { what: "the points in memory".into(), bytes: bytes as usize };
        let mut positions = Vec::new();
        reserving(|| positions.try_reserve_exact(points)).map_err(full)?;
        let mut colors = sample.colors().map(|_| Vec::new());
        reserving(|| colors.iter_mut().try_for_each(|colors| colors.try_reserve_exact(points))).map_err(full)?;
        let mut fields = Vec::new();
        for field in sample.fields() {
            let mut values = Vec::new();
            reserving(|| values.try_reserve_exact(points)).map_err(full)?;
            let about = RelativeValues::new(&field.values).about();
            fields.push(PoolField { name: field.name.clone(), about, values: FieldValues::F32(values) });
        }
        let mut sample = sample.clone().with_scans(Vec::new());
        let step = sample.len().div_ceil(SAMPLE_POINTS).max(1);
        sample.retain(|index| index % step == 0);
        Ok(Self {
            sample,
            identity: Identity::default(),
            capacity,
            positions,
            colors,
            fields,
            slots: Vec::new(),
            free: BTreeSet::new(),
            nodes: BTreeMap::new(),
            chosen: Vec::new(),
            choices: 0,
            generation: 0,
        })
    }

    /// Sets which axis points up.
    #[must_use]
    pub fn with_axes(mut self, axes: Axes) -> Self {
        self.sample = self.sample.with_axes(axes);
        self
    }

    /// Bytes that a point takes in a pool with the columns of `sample`.
    pub fn bytes_per_point(sample: &PointCloud) -> usize {
        let color = sample.colors().map_or(0, |_| size_of::<[u8; 3]>());
        size_of::<[f32; 3]>() + color + sample.fields().len() * size_of::<f32>()
    }

    /// Copies a node into free slots. If too few are free, nodes that are not chosen leave: the least recently chosen
    /// first, among these the finest. Returns whether the node is in the pool; a node that is there already stays as it
    /// is. If the chosen nodes leave too little room, nothing changes.
    ///
    /// Points of a node without colours are grey if the pool has colours, as in
    /// [merged](PointCloud::merge) clouds. A field that the node lacks has no values (NaN) there. Other columns,
    /// residuals and scans are not kept.
    pub fn insert(&mut self, key: NodeKey, node: &PointCloud) -> bool {
        if self.nodes.contains_key(&key) {
            return true;
        }
        let needed = node.len().div_ceil(SLOT_POINTS);
        if !self.make_room(needed) {
            return false;
        }
        self.generation += 1;
        let slots: Vec<u32> = (0..needed).map(|_| self.take_slot()).collect();
        for (number, (&slot, first)) in slots.iter().zip((0..node.len()).step_by(SLOT_POINTS)).enumerate() {
            self.slots[slot as usize] = Slot { written: self.generation, owner: Some((key, number as u32)) };
            self.write(slot, node, first..node.len().min(first + SLOT_POINTS));
        }
        let (origin, points, used) = (node.origin(), node.len(), self.choices);
        self.nodes.insert(key, Node { origin, points, slots, used, is_chosen: false });
        true
    }

    /// Removes nodes until `needed` slots are free. Returns false, and removes none, if that is impossible.
    fn make_room(&mut self, needed: usize) -> bool {
        let free = self.free.len() + self.capacity - self.slots.len();
        let Some(mut missing) = needed.checked_sub(free).filter(|&missing| missing > 0) else { return true };
        let idle = self.nodes.iter().filter(|(_, node)| !node.is_chosen && !node.slots.is_empty());
        let mut idle: Vec<_> = idle.map(|(&key, node)| (node.used, Reverse(key), node.slots.len())).collect();
        if idle.iter().map(|(.., slots)| slots).sum::<usize>() < missing {
            return false;
        }
        idle.sort_unstable();
        for (_, Reverse(key), slots) in idle {
            if missing == 0 {
                break;
            }
            self.remove(key);
            missing = missing.saturating_sub(slots);
        }
        true
    }

    /// The lowest free slot. There is one.
    fn take_slot(&mut self) -> u32 {
        self.free.pop_first().unwrap_or_else(|| {
            let slot = self.slots.len();
            self.slots.push(Slot::default());
            // Within the reserved capacity: nothing moves.
            let len = (slot + 1) << SLOT_SHIFT;
            self.positions.resize(len, [0.0; 3]);
            if let Some(colors) = &mut self.colors {
                colors.resize(len, GREY);
            }
            for field in &mut self.fields {
                field.values_mut().resize(len, f32::NAN);
            }
            slot as u32
        })
    }

    /// Copies points of a node to the start of a slot.
    fn write(&mut self, slot: u32, node: &PointCloud, points: Range<usize>) {
        let first = (slot as usize) << SLOT_SHIFT;
        let to = first..first + points.len();
        self.positions[to.clone()].copy_from_slice(&node.positions()[points.clone()]);
        if let Some(colors) = &mut self.colors {
            match node.colors() {
                Some(own) => colors[to.clone()].copy_from_slice(&own[points.clone()]),
                None => colors[to.clone()].fill(GREY),
            }
        }
        for field in &mut self.fields {
            let about = field.about.origin;
            let own = node.field(&field.name);
            let values = &mut field.values_mut()[to.clone()];
            match own {
                Some(own) => values.iter_mut().zip(points.clone()).for_each(|(value, index)| {
                    *value = (own.values.get(index) - about) as f32;
                }),
                None => values.fill(f32::NAN),
            }
        }
    }

    /// Removes a node, also a chosen one. Returns whether it was there.
    pub fn remove(&mut self, key: NodeKey) -> bool {
        let Some(node) = self.nodes.remove(&key) else { return false };
        for slot in node.slots {
            self.slots[slot as usize].owner = None;
            self.free.insert(slot);
        }
        self.chosen.retain(|&chosen| chosen != key);
        true
    }

    /// Chooses the nodes that the next frames show, in place of those chosen before. No chosen node leaves to make
    /// room. Returns those of `keys` that are not in the pool, ascending.
    pub fn choose(&mut self, keys: &[NodeKey]) -> Vec<NodeKey> {
        self.choices += 1;
        for key in std::mem::take(&mut self.chosen) {
            self.nodes.get_mut(&key).expect("chosen nodes stay").is_chosen = false;
        }
        let keys: BTreeSet<NodeKey> = keys.iter().copied().collect();
        let (present, missing) = keys.into_iter().partition(|key| self.nodes.contains_key(key));
        self.chosen = present;
        for key in &self.chosen {
            let node = self.nodes.get_mut(key).expect("present");
            (node.used, node.is_chosen) = (self.choices, true);
        }
        missing
    }

    /// Whether a node is in the pool.
    pub fn contains(&self, key: NodeKey) -> bool {
        self.nodes.contains_key(&key)
    }

    /// Largest number of points: all slots, full.
    pub fn capacity(&self) -> usize {
        self.capacity << SLOT_SHIFT
    }

    /// Number of points of the chosen nodes.
    pub fn chosen_points(&self) -> usize {
        self.chosen.iter().map(|key| self.nodes[key].points).sum()
    }

    /// Points that stand for all of the scan: at most 131,072 of those that the pool was made with.
    pub fn sample(&self) -> &PointCloud {
        &self.sample
    }

    /// Identifies the scan, whatever is loaded of it, within this process. No cloud has the same number.
    pub fn identity(&self) -> u64 {
        self.identity.0
    }

    /// Index of point `point` of a node; `None` if it is not in the pool. The index is the same while the node stays.
    pub fn index_of(&self, key: NodeKey, point: usize) -> Option<u32> {
        let node = self.nodes.get(&key).filter(|node| point < node.points)?;
        Some((node.slots[point >> SLOT_SHIFT] << SLOT_SHIFT) + (point % SLOT_POINTS) as u32)
    }

    /// Node of the point at an index, and the point's index in the node; `None` if no node has the index.
    pub fn place_of(&self, index: u32) -> Option<(NodeKey, usize)> {
        let (key, number) = self.slots.get((index >> SLOT_SHIFT) as usize)?.owner?;
        let point = number as usize * SLOT_POINTS + index as usize % SLOT_POINTS;
        (point < self.nodes[&key].points).then_some((key, point))
    }

    /// World coordinates of the point at an index; `None` if no node has the index.
    pub fn world_position(&self, index: u32) -> Option<DVec3> {
        let (key, _) = self.place_of(index)?;
        Some(self.nodes[&key].origin + DVec3::from(self.positions[index as usize].map(f64::from)))
    }

    /// The points of the chosen nodes, in the order of keys and of points.
    pub fn runs(&self) -> Vec<PointRun> {
        self.chosen.iter().flat_map(|key| self.nodes[key].runs()).collect()
    }

    /// Positions of all slots in use so far, each about the origin of its node. Those that no node holds mean nothing;
    /// this is true of the other columns too.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Colours, sRGB, if the pool has colours.
    pub fn colors(&self) -> Option<&[[u8; 3]]> {
        self.colors.as_deref()
    }

    /// Values of the field called `name`; letter case is ignored.
    pub fn field(&self, name: &str) -> Option<RelativeValues<'_>> {
        let field = self.fields.iter().find(|field| field.name.eq_ignore_ascii_case(name))?;
        Some(RelativeValues::stored(&field.values, field.about))
    }

    /// Number that grows with each insertion.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Indices of the slots' points written after a [`generation`](Self::generation), ascending; all since `None`.
    pub fn written_since(&self, generation: Option<u64>) -> Vec<Range<usize>> {
        let is_new = |slot: &Slot| generation.is_none_or(|generation| slot.written > generation);
        let mut ranges: Vec<Range<usize>> = Vec::new();
        for (slot, _) in self.slots.iter().enumerate().filter(|(_, slot)| is_new(slot)) {
            let range = slot << SLOT_SHIFT..(slot + 1) << SLOT_SHIFT;
            match ranges.last_mut().filter(|last| last.end == range.start) {
                Some(last) => last.end = range.end,
                None => ranges.push(range),
            }
        }
        ranges
    }
}

impl PoolField {
    fn values_mut(&mut self) -> &mut Vec<f32> {
        let FieldValues::F32(values) = &mut self.values else { unreachable!("the values of a pool are f32") };
        values
    }
}
