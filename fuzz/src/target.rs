//! The readers of an input, chosen by its extension.

use std::{path::Path, time::Duration};

use autosplats_cloud::{Error, Progress};
use autosplats_formats::{ReadOptions, describe_bytes, read_bytes, read_mesh_bytes};
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

/// Describes a file. Recordings and bare messages have no description.
pub(crate) fn describe(name: &Path, bytes: &[u8], options: &ReadOptions) -> Result<(), Error> {
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
