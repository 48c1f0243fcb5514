//! Potree 2.0: a folder with `metadata.json`, a file of pages of the hierarchy, and a file of nodes.
//!
//! # How it works
//!
//! `metadata.json` states the root's cube and the [values](meta) of a point. Every [page](pages) lists nodes with the
//! places of their points in `octree.bin`. A node is records, or [packed](packed): value by value, compressed with
//! Brotli.

mod meta;
mod packed;
mod pages;

use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

use autosplats_cloud::{
    Error, Folder, Key, Node, PointCloud, Progress, Ranges, Traffic, Tree, TreeInfo, Wanted, guard,
};

use self::{
    meta::{Encoding, Meta},
    pages::{ENTRY, Limits, entries},
};
use super::{
    directory::{Directory, Entry},
    octree::{Octal, Octree, decode},
    paged::{Page, Parsed, fetch, load_pages, place, take_page},
};
use crate::read::{
    las::{Colors, Decoded, Shape},
    units,
};

/// Files beside the metadata: pages, and nodes.
const PAGES: &str = "hierarchy.bin";
const NODES: &str = "octree.bin";

/// Most bytes of the metadata.
const MAX_META: u64 = 4 << 20;

/// An open octree of Potree.
#[derive(Debug)]
pub(super) struct Potree {
    folder: Arc<dyn Folder>,
    pages: Arc<dyn Ranges>,
    nodes: Arc<dyn Ranges>,
    meta: Meta,
    limits: Limits,
    octree: Octree,
}

/// Opens the octree whose metadata are the file `name` of a folder.
pub(super) fn open(folder: Arc<dyn Folder>, name: &str, progress: &dyn Progress) -> Result<Potree, Error> {
    let json = folder.read(&[name.to_owned()], MAX_META, progress)?.concat();
    let path = folder.name().join(name);
    let meta = Meta::read(&path, &json)?;
    let (pages, nodes) = (folder.open(PAGES, progress)?, folder.open(NODES, progress)?);
    let limits = Limits { data: nodes.size(), record: (meta.encoding == Encoding::Plain).then_some(meta.stride()) };
    let root = Page { offset: 0, bytes: meta.first_page };
    root.check(pages.size(), ENTRY).map_err(|what| Error::malformed(&path, "firstChunkSize", what))?;
    let directory = Directory::new(Entry::Page { offset: 0, bytes: root.bytes as u32 });
    let range = 0..root.bytes;
    let page = pages.read(&[range], progress)?.concat();
    let size = pages.size();
    take_page(&directory, &*pages, Key::ROOT, 0, &page, |key, page| entries(key, page, &limits, size))?;
    let (info, height_scale) = meta.info();
    Ok(Potree { folder, pages, nodes, meta, limits, octree: Octree::new(info, directory, height_scale) })
}

impl Potree {
    fn entries(&self) -> impl Fn(Key, &[u8]) -> Parsed {
        |key, page| entries(key, page, &self.limits, self.pages.size())
    }
}

impl Octal for Potree {
    fn octree(&self) -> &Octree {
        &self.octree
    }

    fn raw(&self, key: Key, bytes: &[u8], exact: bool, shape: &Shape<'_>) -> Result<Decoded, Error> {
        let (points, range) = place(self, key)?;
        let path = self.nodes.name();
        let fail = |what: String| Error::malformed(path, format!("byte {}: node {key}", range.start), what);
        let records = match self.meta.encoding {
            Encoding::Plain => Cow::Borrowed(bytes),
            Encoding::Brotli => Cow::Owned(guard(|| packed::unpacked(&self.meta, bytes, points)).map_err(fail)?),
        };
        let (stride, expected) = (self.meta.stride(), points as usize * self.meta.stride());
        if records.len() != expected {
            let what = format!("{points} points of {stride} bytes take {expected} bytes, not {}", records.len());
            return Err(fail(what + "; copy the file again"));
        }
        let mut decoded = self.meta.columns.decode(&records, exact, shape)?;
        decoded.cloud = units::settled(path, decoded.cloud.with_crs(self.meta.crs.clone()))?;
        Ok(decoded)
    }
}

impl Tree for Potree {
    fn name(&self) -> &Path {
        self.folder.name()
    }

    fn info(&self) -> &TreeInfo {
        &self.octree.info
    }

    fn node(&self, key: Key) -> Node {
        self.octree.directory.node(key)
    }

    fn load_pages(&self, keys: &[Key], progress: &dyn Progress) -> Result<(), Error> {
        load_pages(&self.octree.directory, &*self.pages, keys, progress, self.entries())
    }

    fn fetch(&self, keys: &[Key], progress: &dyn Progress) -> Result<Vec<Vec<u8>>, Error> {
        fetch(self, &*self.nodes, keys, progress)
    }

    fn decode(&self, key: Key, bytes: &[u8], wanted: &Wanted) -> Result<PointCloud, Error> {
        decode(self, key, bytes, wanted)
    }

    fn point_bytes(&self, wanted: &Wanted) -> usize {
        let colors = if wanted.colors { Colors::ByValue } else { Colors::Unwanted };
        let residuals = wanted.exact || self.meta.crs.height_scale().is_some();
        let shape = Shape { origin: None, colors, wanted: Some(wanted) };
        self.meta.columns.point_bytes(wanted.exact, residuals, &shape)
    }

    fn take_notes(&self) -> Vec<String> {
        self.octree.watch.take_notes()
    }

    fn traffic(&self) -> Traffic {
        let all = [self.folder.traffic(), self.pages.traffic(), self.nodes.traffic()];
        let sum = |part: fn(&Traffic) -> u64| all.iter().map(part).sum();
        Traffic { requests: sum(|traffic| traffic.requests), bytes: sum(|traffic| traffic.bytes) }
    }
}
