//! Readers of scans that are stored as octrees, of which only the parts that are needed are read.
//!
//! # How it works
//!
//! A format tells where its hierarchy and its nodes are. The [`directory`] knows the part of the hierarchy that is
//! loaded. Nodes are decoded by the readers of files, with an origin and a scale of colours that suit the whole scan.
//! What is odd about nodes is [watched](watch).

mod copc;
mod directory;
mod watch;

use std::path::Path;
use std::sync::Arc;

use autosplats_cloud::{Error, FileRanges, Progress, Ranges, Tree};

/// Opens a scan that is stored as an octree. `None` if the file is another, or its octree cannot be used, which is
/// noted: such a file can be read whole.
///
/// # Errors
/// [`Error::Io`], and [`Error::Cancelled`] if `progress` says so.
pub fn open_tree(path: &Path, progress: &dyn Progress) -> Result<Option<Arc<dyn Tree>>, Error> {
    match open_tree_in(Arc::new(FileRanges::open(path)?), progress) {
        Err(Error::Malformed { place, what, .. }) => {
            progress.note(&format!("the file is read whole, since its octree cannot be used: {place}: {what}"));
            Ok(None)
        }
        outcome => outcome,
    }
}

/// Opens a file of which ranges can be read. `None` if it is no COPC.
///
/// # Errors
/// Those of reading, and [`Error::Malformed`] for a COPC that breaks its rules.
pub fn open_tree_in(ranges: Arc<dyn Ranges>, progress: &dyn Progress) -> Result<Option<Arc<dyn Tree>>, Error> {
    Ok(copc::open(ranges, progress)?.map(|tree| Arc::new(tree) as Arc<dyn Tree>))
}
