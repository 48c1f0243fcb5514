//! COPC: a LAZ file whose chunks are the nodes of an octree, with a table of them.
//!
//! # How it works
//!
//! The first variable length record of the file states the root's cube and where the first page of the hierarchy is. A
//! page tells of nodes, and of further pages, which are loaded when they are needed. Every node is a chunk that the LAZ
//! reader decodes by itself.

mod hierarchy;
mod open;

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use autosplats_cloud::{Error, Key, Node, PointCloud, Progress, Ranges, Traffic, Tree, TreeInfo, Wanted};

use self::hierarchy::{Limits, entries};
use super::{
    octree::{Octal, Octree, decode},
    paged::{Parsed, fetch, load_pages, place},
};
use crate::read::las::{Colors, Decoded, Head, Shape};

pub(super) use open::open;

/// An open COPC file.
pub(super) struct Copc {
    ranges: Arc<dyn Ranges>,
    head: Head,
    limits: Limits,
    octree: Octree,
}

impl fmt::Debug for Copc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Copc").field("ranges", &self.ranges).field("octree", &self.octree).finish_non_exhaustive()
    }
}

impl Copc {
    fn entries(&self) -> impl Fn(Key, &[u8]) -> Parsed {
        |_, page| entries(page, &self.limits, self.ranges.size())
    }
}

impl Octal for Copc {
    fn octree(&self) -> &Octree {
        &self.octree
    }

    fn raw(&self, key: Key, bytes: &[u8], exact: bool, shape: &Shape<'_>) -> Result<Decoded, Error> {
        let (points, place) = place(self, key)?;
        let name = format!("byte {}: node {key}", place.start);
        self.head.decode(self.ranges.name(), &name, bytes, points as usize, exact, shape)
    }
}

impl Tree for Copc {
    fn name(&self) -> &Path {
        self.ranges.name()
    }

    fn info(&self) -> &TreeInfo {
        &self.octree.info
    }

    fn node(&self, key: Key) -> Node {
        self.octree.directory.node(key)
    }

    fn load_pages(&self, keys: &[Key], progress: &dyn Progress) -> Result<(), Error> {
        load_pages(&self.octree.directory, &*self.ranges, keys, progress, self.entries())
    }

    fn fetch(&self, keys: &[Key], progress: &dyn Progress) -> Result<Vec<Vec<u8>>, Error> {
        fetch(self, &*self.ranges, keys, progress)
    }

    fn decode(&self, key: Key, bytes: &[u8], wanted: &Wanted) -> Result<PointCloud, Error> {
        decode(self, key, bytes, wanted)
    }

    fn point_bytes(&self, wanted: &Wanted) -> usize {
        let colors = if wanted.colors { Colors::ByValue } else { Colors::Unwanted };
        self.head.point_bytes(wanted.exact, &Shape { origin: None, colors, wanted: Some(wanted) })
    }

    fn take_notes(&self) -> Vec<String> {
        self.octree.watch.take_notes()
    }

    fn traffic(&self) -> Traffic {
        self.ranges.traffic()
    }
}
