//! The files of a recording, and the bytes of their messages.

use std::path::{Path, PathBuf};

use autosplats_cloud::{Bytes, Error, Part, Progress, one_line, read_text};
use autosplats_formats::check_not_lfs_pointer;

use super::{
    chunk::unpack,
    container::Container,
    index::Index,
    records::{MessagePosition, Record},
};
use crate::wire::ZSTD;

/// A mapped file and its index.
pub(super) struct File {
    pub(super) path: PathBuf,
    pub(super) bytes: Bytes,
    pub(super) index: Index,
    pub(super) container: Container,
    /// The chunk read last, since consecutive messages usually share a chunk.
    unpacked: Option<(usize, Result<Unpacked, String>)>,
}

enum Unpacked {
    /// Not compressed: the records lie in the file.
    InFile,
    Decompressed(Vec<u8>),
}

impl File {
    pub(super) fn open(path: &Path, progress: &dyn Progress) -> Result<Self, Error> {
        Self::of(path, Bytes::open(path)?, progress)
    }

    pub(super) fn of_bytes(path: &Path, bytes: Vec<u8>, progress: &dyn Progress) -> Result<Self, Error> {
        Self::of(path, bytes.into(), progress)
    }

    fn of(path: &Path, bytes: Bytes, progress: &dyn Progress) -> Result<Self, Error> {
        check_not_lfs_pointer(path, &bytes)?;
        let Some((mut container, first)) = Container::of(&bytes) else {
            return Err(if bytes.is_empty() {
                Error::malformed(path, "byte 0", "the file is empty; copy it again")
            } else if bytes.starts_with(SQLITE_MAGIC) {
                Error::unsupported(path, SQLITE_ADVICE)
            } else if bytes.starts_with(b"#ROSBAG") {
                Error::unsupported(
                    path,
                    "bags older than version 2.0 are not supported; convert this one with 'rosbag fix' or 'rosbag reindex'",
                )
            } else if bytes.starts_with(ZSTD) {
                Error::unsupported(path, "the whole file is compressed; 'zstd -d' unpacks it")
            } else {
                Error::malformed(path, "byte 0", "the file is neither an MCAP file nor a ROS 1 bag")
            });
        };
        let index = Index::of(&mut container, &bytes, first, progress);
        // A recording may grow while it is played, but not shrink.
        bytes.check()?;
        let index = index?;
        if index.topics.is_empty()
            && let Some(fault) = index.faults.first()
        {
            return Err(Error::malformed(path, fault.place(), &fault.what));
        }
        Ok(Self { path: path.into(), bytes, index, container, unpacked: None })
    }

    /// The bytes of a message.
    pub(super) fn message(&mut self, place: &MessagePosition) -> Result<&[u8], Error> {
        let Self { path, bytes, index, container, unpacked } = self;
        let offset = place.chunk.map_or(place.at, |chunk| index.chunks[chunk].data.start);
        let malformed = |what: &str| Error::malformed(path, format!("byte {offset}"), what);
        let records = match place.chunk {
            None => &**bytes,
            Some(number) => {
                let chunk = &index.chunks[number];
                if unpacked.as_ref().is_none_or(|(last, _)| *last != number) {
                    // Frees the memory of the last chunk before the next one is unpacked.
                    *unpacked = None;
                    let content = unpack(bytes, chunk).map(|content| match content {
                        std::borrow::Cow::Borrowed(_) => Unpacked::InFile,
                        std::borrow::Cow::Owned(made) => Unpacked::Decompressed(made),
                    });
                    *unpacked = Some((number, content));
                }
                match &unpacked.as_ref().map(|(_, content)| content) {
                    Some(Ok(Unpacked::Decompressed(made))) => made,
                    Some(Err(what)) => return Err(malformed(&format!("a chunk cannot be read: {what}"))),
                    Some(Ok(Unpacked::InFile)) | None => &bytes[chunk.data.clone()],
                }
            }
        };
        match container.record(records, place.at) {
            Ok((Record::Message(number, _, data), _)) if index.numbers.get(&number) == Some(&place.topic) => Ok(data),
            Ok(_) => Err(malformed("the index points to something that is not a message of its topic")),
            Err(fault) => Err(malformed(&fault.what)),
        }
    }

    /// Offset in the file of a message, or of the chunk that contains it.
    pub(super) fn offset(&self, place: &MessagePosition) -> usize {
        place.chunk.map_or(place.at, |chunk| self.index.chunks[chunk].data.start)
    }
}

/// First bytes of an SQLite database. `SQLITE_ADVICE` is the advice for users of such files.
const SQLITE_MAGIC: &[u8] = b"SQLite format 3\0";
const SQLITE_ADVICE: &str =
    "ROS 2 bags in SQLite are not supported; convert this one to MCAP with 'ros2 bag convert' or 'mcap convert'";

/// File that identifies the folder of a ROS 2 bag.
const METADATA: &str = "metadata.yaml";

/// Whether [`Recording::open`](super::Recording::open) can open a path, by the extension or the content of a folder.
pub fn is_recording(path: &Path) -> bool {
    path.join(METADATA).is_file() || ["mcap", "bag", "db3"].iter().any(|extension| has_extension(path, extension))
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension))
}

/// The files of a recording, and messages about the files of a folder that cannot be opened.
pub(super) struct OpenedFiles {
    pub(super) files: Vec<File>,
    /// One line per file.
    pub(super) missing: Vec<String>,
}

/// Opens a file, or all files of a folder in order. Files of a folder that cannot be opened are left out.
pub(super) fn open_files(path: &Path, progress: &dyn Progress) -> Result<OpenedFiles, Error> {
    if !path.is_dir() {
        return Ok(OpenedFiles { files: vec![File::open(path, progress)?], missing: Vec::new() });
    }
    let io = |source| Error::Io { path: path.into(), source };
    let mut parts = parts(&read_text(&path.join(METADATA)).unwrap_or_default());
    if parts.is_empty() {
        for entry in std::fs::read_dir(path).map_err(io)? {
            parts.extend(entry.map_err(io)?.file_name().into_string());
        }
        parts.retain(|name| has_extension(Path::new(name), "mcap") || has_extension(Path::new(name), "db3"));
        parts.sort_unstable();
    }
    if parts.is_empty() {
        return Err(Error::Unsupported { path: path.into(), what: "the folder has no MCAP files".into() });
    }
    let len = 1.0 / parts.len() as f32;
    let (mut files, mut missing, mut first) = (Vec::new(), Vec::new(), None);
    for (index, name) in parts.iter().enumerate() {
        match File::open(&path.join(name), &Part { whole: progress, start: len * index as f32, len }) {
            Ok(file) => files.push(file),
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(error) => {
                missing.push(one_line(&format!("a part is left out: {error}")));
                first = first.or(Some(error));
            }
        }
    }
    match first {
        Some(error) if files.is_empty() => Err(error),
        _ => Ok(OpenedFiles { files, missing }),
    }
}

/// The files listed in `metadata.yaml`. Parses only the lines of that list instead of YAML.
fn parts(metadata: &str) -> Vec<String> {
    let lines = metadata.lines().skip_while(|line| line.trim() != "relative_file_paths:").skip(1);
    let items = lines.map_while(|line| line.trim().strip_prefix("- "));
    items.map(|name| name.trim().trim_matches(['"', '\'']).to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::parts;

    #[test]
    fn the_list_of_files_is_found() {
        let metadata = "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n    - a_0.mcap\n    - \"a_1.mcap\"\n  \
                        duration:\n    nanoseconds: 1\n  files:\n    - path: a_0.mcap\n";
        assert_eq!(parts(metadata), ["a_0.mcap", "a_1.mcap"], "in order, and nothing else");
        assert!(parts("a: b\n").is_empty(), "no list");
    }
}
