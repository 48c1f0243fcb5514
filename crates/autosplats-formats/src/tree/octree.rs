//! What octrees of all formats have, and decoding their nodes.

use autosplats_cloud::{Error, Key, Node, PointCloud, Tree, TreeInfo, Wanted};
use glam::DVec3;

use super::{
    directory::Directory,
    watch::{Watch, chosen},
};
use crate::{
    color_scale::Levels,
    read::las::{Colors, Decoded, Shape},
};

/// What is known of an open octree.
#[derive(Debug)]
pub(super) struct Octree {
    pub(super) info: TreeInfo,
    pub(super) directory: Directory,
    /// The root's cube in the file's units, whose heights may differ from those of decoded points.
    cube: [DVec3; 2],
    /// Factor of heights, which makes their unit that of x and y.
    height_scale: f64,
    /// The root and its children, as far as they have points and the first page tells of them.
    first: Vec<Key>,
    pub(super) watch: Watch,
}

/// An octree whose nodes can be decoded in parts.
pub(super) trait Octal: Tree {
    fn octree(&self) -> &Octree;

    /// Decodes a node of some points.
    fn raw(&self, key: Key, bytes: &[u8], exact: bool, shape: &Shape<'_>) -> Result<Decoded, Error>;
}

impl Octree {
    /// An octree whose first page is loaded. `info.cube` has the heights of decoded points.
    pub(super) fn new(info: TreeInfo, directory: Directory, height_scale: f64) -> Self {
        let with_points = |key: &Key| matches!(directory.node(*key), Node::Known { points: 1.., .. });
        let first = std::iter::once(Key::ROOT).chain(Key::ROOT.children()).filter(with_points).collect();
        let cube = info.cube.map(|corner| corner / DVec3::new(1.0, 1.0, height_scale));
        Self { info, directory, cube, height_scale, first, watch: Watch::default() }
    }

    fn shape<'a>(&self, key: Key, colors: Colors, wanted: &'a Wanted) -> Shape<'a> {
        let [low, high] = key.cube(self.cube);
        let unscaled = |origin: DVec3| origin / DVec3::new(1.0, 1.0, self.height_scale);
        let origin = wanted.origin.map_or(low.midpoint(high), unscaled);
        Shape { origin: Some(origin), colors, wanted: Some(wanted) }
    }
}

/// Decodes a known node.
pub(super) fn decode(tree: &impl Octal, key: Key, bytes: &[u8], wanted: &Wanted) -> Result<PointCloud, Error> {
    let octree = tree.octree();
    let Node::Known { points, .. } = octree.directory.node(key) else { return Err(unknown(tree, key)) };
    let colors = wanted.colors && octree.info.colors && points > 0;
    let colors = octree.watch.colors(colors, || first_levels(tree, key, bytes))?;
    let shape = octree.shape(key, colors, wanted);
    if points == 0 {
        let cloud = PointCloud::new(shape.origin.unwrap_or_default(), Vec::new());
        return Ok(cloud.with_crs(octree.info.crs.clone()));
    }
    let Decoded { cloud, levels, .. } = tree.raw(key, bytes, wanted.exact, &shape)?;
    let is_leaf = key.children().all(|child| octree.directory.node(child) == Node::Absent);
    octree.watch.check(key, &cloud, levels, &octree.info, is_leaf);
    Ok(chosen(cloud, wanted))
}

/// Error for a node that the loaded pages do not tell of.
pub(super) fn unknown(tree: &(impl Tree + ?Sized), key: Key) -> Error {
    Error::unsupported(tree.name(), format!("node {key} is not known"))
}

/// Levels of the first colours; `key` has been read already.
fn first_levels(tree: &impl Octal, key: Key, bytes: &[u8]) -> Result<Levels, Error> {
    let wanted = Wanted { fields: Some(Vec::new()), ..Wanted::default() };
    for &first in &tree.octree().first {
        let read = if first == key { Vec::new() } else { tree.fetch(&[first], &())?.concat() };
        let chunk = if first == key { bytes } else { &read };
        let shape = tree.octree().shape(first, Colors::ByValue, &wanted);
        match tree.raw(first, chunk, false, &shape) {
            Ok(decoded) if decoded.levels.any() => return Ok(decoded.levels),
            // A damaged node is told when it is wanted itself.
            Ok(_) | Err(Error::Malformed { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(Levels::default())
}
