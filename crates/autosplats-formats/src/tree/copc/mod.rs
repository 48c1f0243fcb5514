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

use self::hierarchy::{Limits, MAX_PAGES, check_page, entries};
use super::{
    directory::{Directory, Entry},
    octree::{Octal, Octree, decode, unknown},
};
use crate::read::las::{Colors, Decoded, Head, Shape};

pub(super) use open::open;

/// Memory that an entry of a page takes once it is known, as a multiple of its bytes in the page.
const KNOWN: u64 = 2;

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
    /// Points and place of a known node.
    fn place(&self, key: Key) -> Result<(u32, Range<u64>), Error> {
        match self.octree.directory.entry(key) {
            Some(Entry::Node { points, offset, bytes }) => Ok((points, offset..offset + u64::from(bytes))),
            _ => Err(unknown(self, key)),
        }
    }
}

/// Takes the entries of a page that was read into the directory.
fn take_page(
    directory: &Directory,
    key: Key,
    offset: u64,
    page: &[u8],
    limits: &Limits,
    ranges: &dyn Ranges,
) -> Result<(), Error> {
    let fail = |at: u64, what: String| {
        Error::malformed(ranges.name(), format!("byte {at}"), format!("page of the hierarchy: {what}"))
    };
    let list = entries(page, limits, ranges.size()).map_err(|(at, what)| fail(offset + at as u64, what))?;
    check_memory("the hierarchy", KNOWN * page.len() as u64)?;
    directory.load(key, list).map_err(|what| fail(offset, format!("{what}; build the file again")))
}

impl Octal for Copc {
    fn octree(&self) -> &Octree {
        &self.octree
    }

    fn raw(&self, key: Key, bytes: &[u8], exact: bool, shape: &Shape<'_>) -> Result<Decoded, Error> {
        let (points, place) = self.place(key)?;
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
        let directory = &self.octree.directory;
        loop {
            // A page may tell that the key is on a further page.
            let pages = directory.pages(keys);
            if pages.is_empty() {
                return Ok(());
            }
            let mut rest = &pages[..];
            while !rest.is_empty() {
                let mut total = 0;
                let fits = |(_, range): &&(Key, Range<u64>)| {
                    total += range.end - range.start;
                    total <= MAX_PAGES
                };
                let (batch, after) = rest.split_at(rest.iter().take_while(fits).count().max(1));
                let ranges: Vec<Range<u64>> = batch.iter().map(|(_, range)| range.clone()).collect();
                let read = self.ranges.read(&ranges, progress)?;
                for ((key, range), page) in batch.iter().zip(&read) {
                    take_page(directory, *key, range.start, page, &self.limits, &*self.ranges)?;
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
