//! Readers of scans that are stored as octrees, of which only the parts that are needed are read.
//!
//! # How it works
//!
//! A format tells where its hierarchy and its nodes are. The [`directory`] knows the part of the hierarchy that is
//! loaded. Nodes are decoded by the readers of files, with an origin and a scale of colours that suit the whole scan.
//! What is odd about nodes is [watched](watch).

mod copc;
mod describe;
mod directory;
mod ept;
mod octree;
mod part;
mod walk;
mod watch;

use std::fs::File;
use std::io::Read as _;
use std::path::Path;
use std::sync::Arc;

use autosplats_cloud::{Error, FileRanges, Folder, LocalFolder, Progress, Ranges, Tree};

pub use self::{
    describe::describe_tree,
    part::{Part, read_part},
};

/// Name of the file with the metadata of an EPT.
const EPT: &str = "ept.json";

/// Bytes of the beginning of a file that tell whether it is the metadata of an EPT.
const SNIFFED: u64 = 64 << 10;

/// Opens a scan that is stored as an octree: COPC, or EPT by its `ept.json` or the folder of it. `None` if the file is
/// another, or a COPC whose octree cannot be used, which is noted: such a file can be read whole.
///
/// # Errors
/// [`Error::Io`]; [`Error::Malformed`] and [`Error::Unsupported`] for an EPT; and [`Error::Cancelled`] if `progress`
/// says so.
pub fn open_tree(path: &Path, progress: &dyn Progress) -> Result<Option<Arc<dyn Tree>>, Error> {
    if path.is_dir() {
        let folder = || Arc::new(LocalFolder::new(path));
        return path.join(EPT).is_file().then(|| open_ept_in(folder(), progress)).transpose();
    }
    // What comes through a pipe can be read only once.
    if !path.metadata().map_err(|source| Error::Io { path: path.into(), source })?.is_file() {
        return Ok(None);
    }
    if let Some(name) = ept_name(path)? {
        let folder = Arc::new(LocalFolder::new(path.parent().unwrap_or(Path::new(""))));
        return Ok(Some(Arc::new(ept::open(folder, &name, progress)?)));
    }
    match open_tree_in(Arc::new(FileRanges::open(path)?), progress) {
        Err(Error::Malformed { place, what, .. }) => {
            progress.note(&format!("the file is read whole, since its octree cannot be used: {place}: {what}"));
            Ok(None)
        }
        outcome => outcome,
    }
}

/// The name of a file if it has the metadata of an EPT.
fn ept_name(path: &Path) -> Result<Option<String>, Error> {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(SNIFFED).read_to_end(&mut start));
    read.map_err(|source| Error::Io { path: path.into(), source })?;
    let has = |word: &[u8]| start.windows(word.len()).any(|bytes| bytes == word);
    let object = start.trim_ascii_start().starts_with(b"{");
    let found = object && has(b"\"dataType\"") && has(b"\"schema\"") && has(b"\"span\"");
    Ok(path.file_name().filter(|_| found).map(|name| name.to_string_lossy().into_owned()))
}

/// Opens a file of which ranges can be read. `None` if it is no COPC.
///
/// # Errors
/// Those of reading, and [`Error::Malformed`] for a COPC that breaks its rules.
pub fn open_tree_in(ranges: Arc<dyn Ranges>, progress: &dyn Progress) -> Result<Option<Arc<dyn Tree>>, Error> {
    Ok(copc::open(ranges, progress)?.map(|tree| Arc::new(tree) as Arc<dyn Tree>))
}

/// Opens the EPT whose `ept.json` is in a folder.
///
/// # Errors
/// Those of reading, and [`Error::Malformed`] and [`Error::Unsupported`] for what the metadata state.
pub fn open_ept_in(folder: Arc<dyn Folder>, progress: &dyn Progress) -> Result<Arc<dyn Tree>, Error> {
    Ok(Arc::new(ept::open(folder, EPT, progress)?))
}
