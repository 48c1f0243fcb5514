//! Points in an octree of levels: coarse points above, what is missing between them below.

use std::fmt;
use std::path::Path;

use glam::DVec3;

use crate::{Axes, Crs, Error, PointCloud, PointFilter, Progress, Traffic};

/// Place of a node in an octree. The children of a cube are its eight octants.
///
/// Keys are ordered by level, so that sorted keys go from coarse to fine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the fields say it")]
pub struct Key {
    pub level: u32,
    pub x: u32,
    pub y: u32,
    pub z: u32,
}

impl Key {
    /// The whole cube.
    pub const ROOT: Self = Self { level: 0, x: 0, y: 0, z: 0 };
    /// The deepest level that a tree may have.
    pub const MAX_LEVEL: u32 = 30;

    /// Key from the numbers of a file: `None` if there is no such place.
    pub fn new(level: u32, [x, y, z]: [u32; 3]) -> Option<Self> {
        let inside = level <= Self::MAX_LEVEL && [x, y, z].iter().all(|at| at >> level == 0);
        inside.then_some(Self { level, x, y, z })
    }

    /// The cube that this one is an octant of; `None` for the root.
    pub fn parent(self) -> Option<Self> {
        let level = self.level.checked_sub(1)?;
        Some(Self { level, x: self.x / 2, y: self.y / 2, z: self.z / 2 })
    }

    /// The eight octants; none at the deepest level.
    pub fn children(self) -> impl Iterator<Item = Self> {
        let octants = if self.level < Self::MAX_LEVEL { 0..8 } else { 0..0 };
        octants.map(move |octant| Self {
            level: self.level + 1,
            x: 2 * self.x + (octant & 1),
            y: 2 * self.y + (octant >> 1 & 1),
            z: 2 * self.z + (octant >> 2),
        })
    }

    /// The corners of the cube of this key, lowest and highest, inside that of the root.
    pub fn cube(self, [low, high]: [DVec3; 2]) -> [DVec3; 2] {
        let side = (high - low) / f64::from(1u32 << self.level);
        let low = low + side * DVec3::new(self.x.into(), self.y.into(), self.z.into());
        [low, low + side]
    }
}

/// Level and place, as formats name nodes: `2-1-3-0`.
impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}-{}-{}", self.level, self.x, self.y, self.z)
    }
}

/// A node of one of several trees. Keys are ordered by level, so that sorted ones go from coarse to fine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeKey {
    /// Place of the node in its tree.
    pub key: Key,
    /// Index of the tree.
    pub tree: u32,
}

impl From<Key> for NodeKey {
    /// A node of the first tree.
    fn from(key: Key) -> Self {
        Self { key, tree: 0 }
    }
}

/// What is known of a place in a [`Tree`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Node {
    /// There is no node, and none below.
    Absent,
    /// The page of the hierarchy that tells of the node has not been loaded.
    Unknown,
    /// There is a node.
    Known {
        /// Number of points of the node itself, without those of its children; an inner node may have none.
        points: u32,
        /// Size of the node in the file, in bytes.
        bytes: u64,
    },
}

/// What a tree states about itself.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeInfo {
    /// Format, version and encoding, for people: `COPC 1.0 (LAS 1.4 point format 7)`.
    pub format: String,
    /// Number of points in all nodes, as stated.
    pub points: u64,
    /// Lowest and highest corner of the root's cube, in world coordinates.
    pub cube: [DVec3; 2],
    /// Lowest and highest corner of the box around all points, in world coordinates, as stated.
    pub bounds: [DVec3; 2],
    /// Distance between neighbouring points of the root, in world units. Each level below halves it.
    pub spacing: f64,
    /// Values of a point, coordinates included: name and storage type, for people, in the file's order.
    pub attributes: Vec<(String, String)>,
    /// Whether points have colours.
    pub colors: bool,
    /// Names of the scalar fields.
    pub fields: Vec<String>,
    /// Which axis points up, if the format states it.
    pub axes: Option<Axes>,
    /// The coordinate system and its units.
    pub crs: Crs,
    /// The step of which coordinates are multiples, per axis, if they are stored as integers.
    pub resolution: Option<DVec3>,
    /// Further facts as name and value, such as the program that wrote the file.
    pub details: Vec<(String, String)>,
    /// Notes for the user: what is odd about the file.
    pub notes: Vec<String>,
}

/// Which attributes of points to decode, and which points to keep.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wanted {
    /// Whether to decode colours, if there are any.
    pub colors: bool,
    /// Names of the fields to decode, in any letter case; `None` decodes all.
    pub fields: Option<Vec<String>>,
    /// Whether to keep all digits, as `exact` of reading files does.
    pub exact: bool,
    /// Which points to keep; `None` keeps all.
    pub keep: Option<PointFilter>,
    /// Origin of the positions in world coordinates; `None` takes the middle of the node's cube. Clouds of one origin
    /// [join](PointCloud::append) without rounding.
    pub origin: Option<DVec3>,
}

impl Wanted {
    /// Whether the values of a field are to be decoded: it is wanted, or tells which points to keep.
    #[must_use]
    pub fn needs(&self, field: &str) -> bool {
        self.wants(field) || self.keep.as_ref().is_some_and(|filter| filter.needs(field))
    }

    /// Whether a field is wanted.
    #[must_use]
    pub fn wants(&self, field: &str) -> bool {
        self.fields.as_ref().is_none_or(|names| names.iter().any(|name| name.eq_ignore_ascii_case(field)))
    }
}

/// A scan stored as an octree, of which only the nodes that are needed are read.
///
/// The points of a node and of all nodes above it are the scan at the spacing of the node's level. All functions may be
/// called on many threads at once. What the file claims is checked before anything is allocated.
pub trait Tree: Send + Sync + fmt::Debug {
    /// Path or address, for messages.
    fn name(&self) -> &Path;

    /// What the tree states about itself.
    fn info(&self) -> &TreeInfo;

    /// What is known of a node.
    fn node(&self, key: Key) -> Node;

    /// Loads the pages of the hierarchy that tell of `keys`; keys that are not [`Node::Unknown`] cost nothing.
    ///
    /// # Errors
    /// Those of reading and [`Error::Malformed`] for a page that breaks the rules.
    fn load_pages(&self, keys: &[Key], progress: &dyn Progress) -> Result<(), Error>;

    /// The stored bytes of known nodes, in the order asked for.
    ///
    /// # Errors
    /// Those of reading.
    fn fetch(&self, keys: &[Key], progress: &dyn Progress) -> Result<Vec<Vec<u8>>, Error>;

    /// Decodes the stored bytes of a node.
    ///
    /// Values that are zero at every point of the node are left out: a missing field is 0 there, and missing colours
    /// are black. The first points of the scan that have colours settle whether all colours have 8 or 16 bits. The
    /// first call that wants colours may read the root for that.
    ///
    /// # Errors
    /// [`Error::Malformed`] if the bytes are damaged.
    fn decode(&self, key: Key, bytes: &[u8], wanted: &Wanted) -> Result<PointCloud, Error>;

    /// Most bytes of memory that a decoded point takes.
    fn point_bytes(&self, wanted: &Wanted) -> usize;

    /// What decoding has found odd since the last call: notes for the user, each told once.
    fn take_notes(&self) -> Vec<String>;

    /// What has been read so far.
    fn traffic(&self) -> Traffic;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_fill_their_parent() {
        let cube = [DVec3::ZERO, DVec3::splat(8.0)];
        let key = Key::new(2, [1, 3, 0]).expect("inside");
        let [low, high] = key.cube(cube);
        assert_eq!([low, high], [DVec3::new(2.0, 6.0, 0.0), DVec3::new(4.0, 8.0, 2.0)]);
        let children: Vec<Key> = key.children().collect();
        assert_eq!(children.len(), 8);
        for child in &children {
            assert_eq!(child.parent(), Some(key));
            let [a, b] = child.cube(cube);
            assert!(a.cmpge(low).all() && b.cmple(high).all() && (b - a) == DVec3::ONE, "{child:?}");
        }
        assert_eq!(Key::ROOT.parent(), None);
        assert_eq!(Key::new(1, [2, 0, 0]), None, "outside");
        assert_eq!(Key::new(31, [0; 3]), None, "too deep");
        assert_eq!(Key::new(30, [5; 3]).map(|key| key.children().count()), Some(0));
    }
}
