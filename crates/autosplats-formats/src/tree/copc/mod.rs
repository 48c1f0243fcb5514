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
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use autosplats_cloud::{Error, Key, Node, PointCloud, Progress, Ranges, Traffic, Tree, TreeInfo, Wanted, check_memory};
use glam::DVec3;

use self::hierarchy::{Limits, MAX_PAGES, check_page, entries};
use super::{
    directory::{Directory, Entry},
    watch::{Watch, chosen},
};
use crate::{
    color_scale::Levels,
    read::las::{Colors, Decoded, Head, Shape},
};

pub(super) use open::open;

/// Memory that an entry of a page takes once it is known, in parts of the bytes that it has in the page.
const KNOWN: u64 = 2;

/// Most nodes that tell whether colours have 8 or 16 bits: the root and its children.
const FIRST: usize = 9;

/// An open COPC file.
pub(super) struct Copc {
    ranges: Arc<dyn Ranges>,
    head: Head,
    info: TreeInfo,
    /// The root's cube in the file's units, whose heights may differ from those of decoded points.
    cube: [DVec3; 2],
    limits: Limits,
    directory: Directory,
    /// The first nodes with points, root first.
    first: Vec<Key>,
    watch: Watch,
}

impl fmt::Debug for Copc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Copc").field("ranges", &self.ranges).field("info", &self.info).finish_non_exhaustive()
    }
}

impl Copc {
    fn malformed(&self, offset: u64, what: impl AsRef<str>) -> Error {
        Error::malformed(self.ranges.name(), format!("byte {offset}"), what)
    }

    /// Takes in a page that was read.
    fn page_read(&self, key: Key, offset: u64, page: &[u8]) -> Result<(), Error> {
        let list = entries(page, &self.limits, self.ranges.size())
            .map_err(|(at, what)| self.malformed(offset + at as u64, format!("page of the hierarchy: {what}")))?;
        check_memory("the hierarchy", KNOWN * page.len() as u64)?;
        let wrong = |what| self.malformed(offset, format!("page of node {key}: {what}; build the file again"));
        self.directory.load(key, list).map_err(wrong)
    }

    /// Points and place of a known node.
    fn place(&self, key: Key) -> Result<(u32, Range<u64>), Error> {
        match self.directory.entry(key) {
            Some(Entry::Node { points, offset, bytes }) => Ok((points, offset..offset + u64::from(bytes))),
            _ => Err(Error::unsupported(self.ranges.name(), format!("node {key} is not known"))),
        }
    }

    /// Decodes a node as it is in the file.
    fn raw(&self, key: Key, bytes: &[u8], exact: bool, shape: &Shape<'_>) -> Result<Decoded, Error> {
        let (points, place) = self.place(key)?;
        let name = format!("byte {}: node {key}", place.start);
        self.head.decode(self.ranges.name(), &name, bytes, points as usize, exact, shape)
    }

    /// Levels of the first colours, for which `key` has been read already.
    fn first_levels(&self, key: Key, bytes: &[u8]) -> Result<Levels, Error> {
        let wanted = Wanted { fields: Some(Vec::new()), ..Wanted::default() };
        for &first in &self.first {
            let read = if first == key { Vec::new() } else { self.fetch(&[first], &())?.concat() };
            let chunk = if first == key { bytes } else { &read };
            let shape = Shape { origin: Some(DVec3::ZERO), colors: Colors::ByValue, wanted: Some(&wanted) };
            match self.raw(first, chunk, false, &shape) {
                Ok(decoded) if decoded.levels.any() => return Ok(decoded.levels),
                // A damaged node is told when it is wanted itself.
                Ok(_) | Err(Error::Malformed { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(Levels::default())
    }

    fn shape<'a>(&self, key: Key, colors: Colors, wanted: &'a Wanted) -> Shape<'a> {
        let [low, high] = key.cube(self.cube);
        let unscaled = |origin: DVec3| origin / DVec3::new(1.0, 1.0, self.head.height_scale);
        let origin = wanted.origin.map_or(low.midpoint(high), unscaled);
        Shape { origin: Some(origin), colors, wanted: Some(wanted) }
    }
}

impl Tree for Copc {
    fn name(&self) -> &Path {
        self.ranges.name()
    }

    fn info(&self) -> &TreeInfo {
        &self.info
    }

    fn node(&self, key: Key) -> Node {
        self.directory.node(key)
    }

    fn load_pages(&self, keys: &[Key], progress: &dyn Progress) -> Result<(), Error> {
        loop {
            // A page may tell that the key is on a further page.
            let page = |&key: &Key| match self.directory.nearest(key) {
                Some((page, Entry::Page { offset, bytes })) => Some((page, offset, u64::from(bytes))),
                _ => None,
            };
            let mut pages: Vec<(Key, u64, u64)> = keys.iter().filter_map(page).collect();
            pages.sort_unstable();
            pages.dedup();
            if pages.is_empty() {
                return Ok(());
            }
            let mut rest = &pages[..];
            while !rest.is_empty() {
                let mut total = 0;
                let fits = |(_, _, bytes): &&(Key, u64, u64)| {
                    total += bytes;
                    total <= MAX_PAGES
                };
                let (batch, after) = rest.split_at(rest.iter().take_while(fits).count().max(1));
                let ranges: Vec<Range<u64>> = batch.iter().map(|&(_, offset, bytes)| offset..offset + bytes).collect();
                let read = self.ranges.read(&ranges, progress)?;
                for (&(key, offset, _), page) in batch.iter().zip(&read) {
                    self.page_read(key, offset, page)?;
                }
                rest = after;
            }
        }
    }

    fn fetch(&self, keys: &[Key], progress: &dyn Progress) -> Result<Vec<Vec<u8>>, Error> {
        let ranges = keys.iter().map(|&key| Ok(self.place(key)?.1)).collect::<Result<Vec<_>, Error>>()?;
        self.ranges.read(&ranges, progress)
    }

    fn decode(&self, key: Key, bytes: &[u8], wanted: &Wanted) -> Result<PointCloud, Error> {
        let (points, _) = self.place(key)?;
        let colors = wanted.colors && self.info.colors && points > 0;
        let colors = self.watch.colors(colors, || self.first_levels(key, bytes))?;
        let shape = self.shape(key, colors, wanted);
        if points == 0 {
            let cloud = PointCloud::new(shape.origin.unwrap_or_default(), Vec::new());
            return Ok(cloud.with_crs(self.info.crs.clone()));
        }
        let Decoded { cloud, levels } = self.raw(key, bytes, wanted.exact, &shape)?;
        let is_leaf = key.children().all(|child| self.directory.node(child) == Node::Absent);
        self.watch.check(key, &cloud, levels, &self.info, is_leaf);
        Ok(chosen(cloud, wanted))
    }

    fn point_bytes(&self, wanted: &Wanted) -> usize {
        let colors = if wanted.colors { Colors::ByValue } else { Colors::Unwanted };
        self.head.point_bytes(wanted.exact, &Shape { origin: None, colors, wanted: Some(wanted) })
    }

    fn take_notes(&self) -> Vec<String> {
        self.watch.take_notes()
    }

    fn traffic(&self) -> Traffic {
        self.ranges.traffic()
    }
}
