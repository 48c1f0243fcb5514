//! Readers of scans that are stored as octrees, of which only the parts that are needed are read.
//!
//! # How it works
//!
//! A format tells where its hierarchy and its nodes are. The [`directory`] knows the part of the hierarchy that is
//! loaded. Nodes are decoded by the readers of files, with an origin and a scale of colours that suit the whole scan.
//! What is odd about nodes is [watched](watch).

mod columns;
mod copc;
mod describe;
mod directory;
mod ept;
mod octree;
mod paged;
mod part;
mod potree;
mod walk;
mod watch;

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use autosplats_cloud::{Error, FileRanges, Folder, LocalFolder, Progress, Ranges, Tree};

pub use self::{
    describe::describe_tree,
    part::{Part, read_part},
};

/// Names of the files that describe a folder as an octree: EPT's, and Potree's.
pub const TREE_FILES: [&str; 2] = ["ept.json", "metadata.json"];

/// Words of files that describe an octree, by which they are told from other JSON.
const WORDS: [[&[u8]; 3]; 2] =
    [[b"\"dataType\"", b"\"schema\"", b"\"span\""], [b"\"hierarchy\"", b"\"boundingBox\"", b"\"encoding\""]];

/// Bytes of the beginning of a file that tell whether it is JSON, and whether it describes an octree.
const FIRST: u64 = 64;
const SNIFFED: u64 = 64 << 10;

/// A format of octrees in folders.
#[derive(Clone, Copy)]
enum Kind {
    Ept,
    Potree,
}

/// Opens a scan that is stored as an octree: COPC, or a folder of EPT or Potree 2, by its name or by that of the file
/// that describes it. `None` if the file is another, or a COPC whose octree cannot be used, which is noted: such a file
/// can be read whole.
///
/// # Errors
/// [`Error::Io`]; [`Error::Malformed`] and [`Error::Unsupported`] for EPT and Potree; and [`Error::Cancelled`] if
/// `progress` says so.
pub fn open_tree(path: &Path, progress: &dyn Progress) -> Result<Option<Arc<dyn Tree>>, Error> {
    if path.is_dir() {
        return tree_file(path).map_or(Ok(None), |file| open_tree(&file, progress));
    }
    // What comes through a pipe can be read only once.
    if !path.metadata().map_err(|source| Error::Io { path: path.into(), source })?.is_file() {
        return Ok(None);
    }
    if let Some((kind, name)) = described(path)? {
        let folder = Arc::new(LocalFolder::new(path.parent().unwrap_or(Path::new(""))));
        return open_kind(kind, folder, &name, progress).map(Some);
    }
    match open_tree_in(Arc::new(FileRanges::open(path)?), progress) {
        Err(Error::Malformed { place, what, .. }) => {
            progress.note(&format!("the file is read whole, since its octree cannot be used: {place}: {what}"));
            Ok(None)
        }
        outcome => outcome,
    }
}

/// The file that describes a folder as an octree, if there is one.
#[must_use]
pub fn tree_file(folder: &Path) -> Option<PathBuf> {
    let [ept, other] = TREE_FILES.map(|name| folder.join(name));
    if ept.is_file() {
        return Some(ept);
    }
    // The other name is used for much else.
    Some(other).filter(|file| is_tree_file(file))
}

/// Whether a file describes a folder as an octree, so that its points are in other files.
#[must_use]
pub fn is_tree_file(path: &Path) -> bool {
    path.is_file() && described(path).is_ok_and(|found| found.is_some())
}

/// The format and the name of a file if it describes an octree.
fn described(path: &Path) -> Result<Option<(Kind, String)>, Error> {
    let Some(name) = path.file_name().map(|name| name.to_string_lossy().into_owned()) else { return Ok(None) };
    if name == TREE_FILES[0] {
        return Ok(Some((Kind::Ept, name)));
    }
    let mut start = Vec::new();
    let mut read = |most: u64| {
        start.clear();
        let read = File::open(path).and_then(|file| file.take(most).read_to_end(&mut start));
        read.map_err(|source| Error::Io { path: path.into(), source })?;
        Ok::<_, Error>(start.trim_ascii_start().starts_with(b"{"))
    };
    // Most files are no JSON.
    if !read(FIRST)? || !read(SNIFFED)? {
        return Ok(None);
    }
    let has = |word: &&[u8]| start.windows(word.len()).any(|bytes| bytes == *word);
    let found = [Kind::Ept, Kind::Potree].into_iter().zip(WORDS).find(|(_, words)| words.iter().all(has));
    Ok(found.map(|(kind, _)| (kind, name)))
}

fn open_kind(kind: Kind, folder: Arc<dyn Folder>, name: &str, progress: &dyn Progress) -> Result<Arc<dyn Tree>, Error> {
    Ok(match kind {
        Kind::Ept => Arc::new(ept::open(folder, name, progress)?),
        Kind::Potree => Arc::new(potree::open(folder, name, progress)?),
    })
}

/// Opens a file of which ranges can be read. `None` if it is no COPC.
///
/// # Errors
/// Those of reading, and [`Error::Malformed`] for a COPC that breaks its rules.
pub fn open_tree_in(ranges: Arc<dyn Ranges>, progress: &dyn Progress) -> Result<Option<Arc<dyn Tree>>, Error> {
    Ok(copc::open(ranges, progress)?.map(|tree| Arc::new(tree) as Arc<dyn Tree>))
}

/// Opens the octree that a file of a folder describes, which has one of the names [`TREE_FILES`].
///
/// # Errors
/// Those of reading, and [`Error::Malformed`] and [`Error::Unsupported`] for what the file states.
pub fn open_folder_tree(folder: Arc<dyn Folder>, name: &str, progress: &dyn Progress) -> Result<Arc<dyn Tree>, Error> {
    let kind = if name == TREE_FILES[1] { Kind::Potree } else { Kind::Ept };
    open_kind(kind, folder, name, progress)
}
