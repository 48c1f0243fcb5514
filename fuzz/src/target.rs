//! The readers of an input, chosen by its extension.

use std::{path::Path, sync::Arc, time::Duration};

use autosplats_cloud::{Error, Folder, MemoryRanges, Progress, Ranges, Traffic, Tree, Wanted};
use autosplats_formats::{
    Part, ReadOptions, TREE_FILES, describe_bytes, describe_tree, open_folder_tree, open_tree_in, read_bytes,
    read_mesh_bytes, read_part,
};
use autosplats_sources::{
    Next, Recording, RecordingOptions, Stream as _,
    point_cloud2::{self, Encoding},
};

/// The encoding of a bare message. `None` for all other files.
fn message(name: &Path) -> Option<Encoding> {
    match name.extension()?.to_str()? {
        "ros1" => Some(Encoding::Ros1),
        "cdr" => Some(Encoding::Cdr),
        _ => None,
    }
}

fn is_recording(name: &Path) -> bool {
    name.extension().is_some_and(|extension| extension == "mcap" || extension == "bag")
}

/// What separates the files of a folder's octree in one input.
pub(crate) const BETWEEN: &[u8] = b"\n----\n";

/// The files of a folder's octree: its metadata, one for all pages, and one for all nodes.
#[derive(Debug)]
struct Files(Vec<Vec<u8>>);

impl Files {
    fn of(bytes: &[u8]) -> Self {
        let mut files = Vec::new();
        let mut rest = bytes;
        while let Some(at) =
            rest.windows(BETWEEN.len()).position(|window| window == BETWEEN).filter(|_| files.len() < 2)
        {
            files.push(rest[..at].to_vec());
            rest = &rest[at + BETWEEN.len()..];
        }
        files.push(rest.to_vec());
        files.resize(3, Vec::new());
        Self(files)
    }

    fn file(&self, name: &str) -> &Vec<u8> {
        let index = if TREE_FILES.contains(&name) { 0 } else { 1 + usize::from(!name.contains("hierarchy")) };
        &self.0[index]
    }
}

impl Folder for Files {
    fn name(&self) -> &Path {
        Path::new("a")
    }

    fn read(&self, names: &[String], most: u64, _: &dyn Progress) -> Result<Vec<Vec<u8>>, Error> {
        let file = |name: &String| {
            let file = self.file(name);
            let fits = file.len() as u64 <= most;
            if fits { Ok(file.clone()) } else { Err(Error::unsupported(Path::new(name), "it is too large")) }
        };
        names.iter().map(file).collect()
    }

    fn open(&self, name: &str, _: &dyn Progress) -> Result<Arc<dyn Ranges>, Error> {
        Ok(Arc::new(MemoryRanges::new(Path::new(name), self.file(name).clone())))
    }

    fn traffic(&self) -> Traffic {
        Traffic::default()
    }
}

/// Opens a file that is a tree.
fn tree(name: &Path, bytes: &[u8]) -> Result<Option<Arc<dyn Tree>>, Error> {
    match name.extension().and_then(|extension| extension.to_str()) {
        Some("copc") => open_tree_in(Arc::new(MemoryRanges::new(name, bytes.to_vec())), &()),
        Some("ept") => open_folder_tree(Arc::new(Files::of(bytes)), TREE_FILES[0], &()).map(Some),
        Some("potree") => open_folder_tree(Arc::new(Files::of(bytes)), TREE_FILES[1], &()).map(Some),
        _ => Ok(None),
    }
}

/// Describes a file. Recordings and bare messages have no description.
pub(crate) fn describe(name: &Path, bytes: &[u8], options: &ReadOptions) -> Result<(), Error> {
    if let Some(tree) = tree(name, bytes)? {
        let described = describe_tree(&*tree);
        assert!(described.points.is_some(), "a tree states its points");
        return Ok(());
    }
    if is_recording(name) || message(name).is_some() { Ok(()) } else { describe_bytes(name, bytes, options).map(drop) }
}

/// Reads all points and returns their number. If messages of a recording are refused, returns the last error.
pub(crate) fn read(
    name: &Path,
    bytes: &[u8],
    options: &ReadOptions,
    mesh: bool,
    progress: &dyn Progress,
) -> Result<usize, Error> {
    if let Some(tree) = tree(name, bytes)? {
        let wanted = Wanted { colors: !mesh, exact: options.exact, keep: options.keep.clone(), ..Wanted::default() };
        return read_part(&*tree, &Part::default(), &wanted, progress).map(|cloud| cloud.len());
    }
    if let Some(encoding) = message(name) {
        return point_cloud2::decode(name, bytes, encoding, options).map(|message| message.cloud.len());
    }
    if is_recording(name) {
        let options = RecordingOptions { read: options.clone(), ..RecordingOptions::default() };
        let mut recording = Recording::from_bytes(name, bytes.to_vec(), &options, progress)?;
        let (mut points, mut refused) = (0, None);
        loop {
            match recording.next(Duration::ZERO, progress) {
                Ok(Next::Update(update)) => points += update.cloud.len(),
                Ok(Next::Nothing | Next::End) => return refused.map_or(Ok(points), Err),
                Err(error) => refused = Some(error),
            }
        }
    }
    if mesh {
        read_mesh_bytes(name, bytes, options, progress).map(|contents| contents.cloud.len())
    } else {
        read_bytes(name, bytes, options, progress).map(|cloud| cloud.len())
    }
}
