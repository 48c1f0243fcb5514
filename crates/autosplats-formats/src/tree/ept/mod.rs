//! EPT (Entwine Point Tiles): a folder with `ept.json`, pages of the hierarchy, and a file for each node.
//!
//! # How it works
//!
//! `ept.json` states the root's cube and the [values](meta) of a point. A page of the [hierarchy](pages) states the
//! number of points by key, and -1 where a further page tells. A node is a whole LAZ file, or [records](records), which
//! may be compressed with Zstandard.

mod meta;
mod pages;
mod records;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use autosplats_cloud::{
    Crs, Error, Folder, Key, Node, PointCloud, Progress, Traffic, Tree, TreeInfo, Wanted, check_memory, guard,
};

use self::meta::{Encoding, Meta};
use super::{
    directory::{Directory, Entry},
    octree::{Octal, Octree, decode, unknown},
};
use crate::read::{
    las::{Colors, Decoded, Shape, read_shaped},
    units,
};

/// Most bytes of `ept.json`, and of a page that is read alone or among others.
const MAX_META: u64 = 4 << 20;
const MAX_PAGE: u64 = 64 << 20;
const MAX_PAGE_OF_MANY: u64 = 8 << 20;

/// Most pages that are in memory at once, before they are entries.
const PAGES: usize = 8;

/// Bytes that a LAZ file has beside its points: header, coordinate system, table of chunks.
const MAX_LAZ_HEAD: u64 = 4 << 20;

/// An open EPT.
#[derive(Debug)]
pub(super) struct Ept {
    folder: Arc<dyn Folder>,
    meta: Meta,
    /// The coordinate system whose heights are those of the nodes.
    crs: Crs,
    octree: Octree,
}

/// Opens an EPT by the file `name` of a folder, which has the metadata.
pub(super) fn open(folder: Arc<dyn Folder>, name: &str, progress: &dyn Progress) -> Result<Ept, Error> {
    let json = folder.read(&[name.to_owned()], MAX_META, progress)?.concat();
    let path = folder.name().join(name);
    let meta = Meta::read(&path, &json)?;
    let (info, crs, height_scale) = meta.info();
    let directory = Directory::new(Entry::Page { offset: 0, bytes: 0 });
    load(&*folder, &meta, &directory, &[Key::ROOT], MAX_PAGE, progress)?;
    Ok(Ept { folder, meta, crs, octree: Octree::new(info, directory, height_scale) })
}

/// Loads the pages of keys, of at most so many bytes each.
fn load(
    folder: &dyn Folder,
    meta: &Meta,
    directory: &Directory,
    keys: &[Key],
    most: u64,
    progress: &dyn Progress,
) -> Result<(), Error> {
    let names: Vec<String> = keys.iter().map(|key| format!("ept-hierarchy/{key}.json")).collect();
    let pages = match folder.read(&names, most, progress) {
        // One of them is large.
        Err(Error::Unsupported { .. }) if most < MAX_PAGE => {
            return keys.iter().try_for_each(|&key| load(folder, meta, directory, &[key], MAX_PAGE, progress));
        }
        outcome => outcome?,
    };
    for ((&key, name), page) in keys.iter().zip(&names).zip(&pages) {
        check_memory("the hierarchy", 4 * page.len() as u64)?;
        let list = pages::entries(page, |points| meta.stored_bytes(points));
        let fail = |place: String, what: String| Error::malformed(&folder.name().join(name), place, what);
        let list = list.map_err(|error| fail(format!("line {}", error.line().max(1)), error.to_string()))?;
        let wrong = |what| fail(format!("page of node {key}"), format!("{what}; build the tree again"));
        directory.load(key, list).map_err(wrong)?;
    }
    Ok(())
}

impl Ept {
    fn file(&self, key: Key) -> String {
        format!("ept-data/{key}.{}", self.meta.encoding.extension())
    }
}

impl Octal for Ept {
    fn octree(&self) -> &Octree {
        &self.octree
    }

    fn raw(&self, key: Key, bytes: &[u8], exact: bool, shape: &Shape<'_>) -> Result<Decoded, Error> {
        let Node::Known { points, .. } = self.octree.directory.node(key) else { return Err(unknown(self, key)) };
        let path: PathBuf = self.folder.name().join(self.file(key));
        let fail = |what: String| Error::malformed(&path, format!("node {key}"), what);
        let mut decoded = match self.meta.encoding {
            Encoding::Laz => read_shaped(&path, bytes, exact, shape)?,
            Encoding::Binary | Encoding::Zstandard => {
                let unpacked = guard(|| records::unpacked(&self.meta, bytes, points)).map_err(fail)?;
                self.meta.columns.decode(&unpacked, exact, shape)?
            }
        };
        let found = decoded.cloud.len();
        if found != points as usize || decoded.lost > 0 {
            return Err(fail(format!("{found} of {points} points are there; copy the file again")));
        }
        decoded.cloud = units::settled(&path, decoded.cloud.with_crs(self.crs.clone()))?;
        Ok(decoded)
    }
}

impl Tree for Ept {
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
        let directory = &self.octree.directory;
        loop {
            let pages: Vec<Key> = directory.pages(keys).into_iter().map(|(key, _)| key).collect();
            if pages.is_empty() {
                return Ok(());
            }
            for batch in pages.chunks(PAGES) {
                load(&*self.folder, &self.meta, directory, batch, MAX_PAGE_OF_MANY, progress)?;
            }
        }
    }

    fn fetch(&self, keys: &[Key], progress: &dyn Progress) -> Result<Vec<Vec<u8>>, Error> {
        let mut most = 0;
        let mut names = Vec::new();
        for &key in keys {
            let Node::Known { points, .. } = self.node(key) else { return Err(unknown(self, key)) };
            if points > 0 {
                names.push(self.file(key));
                most = most.max(self.meta.most_bytes(points));
            }
        }
        let mut read = self.folder.read(&names, most, progress)?.into_iter();
        let stored = |key: &Key| match self.node(*key) {
            Node::Known { points: 1.., .. } => read.next().unwrap_or_default(),
            _ => Vec::new(),
        };
        Ok(keys.iter().map(stored).collect())
    }

    fn decode(&self, key: Key, bytes: &[u8], wanted: &Wanted) -> Result<PointCloud, Error> {
        decode(self, key, bytes, wanted)
    }

    fn point_bytes(&self, wanted: &Wanted) -> usize {
        let colors = if wanted.colors { Colors::ByValue } else { Colors::Unwanted };
        let residuals = wanted.exact || self.crs.height_scale().is_some();
        self.meta.columns.point_bytes(wanted.exact, residuals, &Shape { origin: None, colors, wanted: Some(wanted) })
    }

    fn take_notes(&self) -> Vec<String> {
        self.octree.watch.take_notes()
    }

    fn traffic(&self) -> Traffic {
        self.folder.traffic()
    }
}
