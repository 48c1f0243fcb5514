//! Outputs: checked before any work, written completely or not at all.

use std::collections::HashSet;
use std::fs::{File, create_dir_all};
use std::io::{BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use autosplats_cloud::{Draft, Error, Existing, Output, PointCloud, is_full, write_whole};
use autosplats_formats::check_writable;
use autosplats_output::PictureFormat;

use crate::console::Console;
use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::progress::Bar;

/// Files that are read. No output may replace one.
#[derive(Clone, Debug, Default)]
pub(crate) struct ReadFiles(HashSet<PathBuf>);

impl ReadFiles {
    /// The existing ones of `files`.
    pub(crate) fn new(files: impl IntoIterator<Item = impl AsRef<Path>>) -> Self {
        Self(files.into_iter().filter_map(|file| file.as_ref().canonicalize().ok()).collect())
    }

    /// Fails if the output would overwrite one of these files.
    pub(crate) fn check(&self, output: &Path) -> Result<(), Failure> {
        if output.canonicalize().is_ok_and(|target| self.0.contains(&target)) {
            return Err(Failure::usage(format!("{}: this output would overwrite an input", output.display())));
        }
        Ok(())
    }
}

/// The path that all names of a file share. The file need not exist.
pub(crate) fn true_path(path: &Path) -> PathBuf {
    let beside = || Some(folder_of(path).canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(beside).unwrap_or_else(|| path.to_owned())
}

/// Fails if the output cannot be written, or would overwrite an input.
pub(crate) fn check_target<'a>(output: impl Into<Output<'a>>, inputs: &ReadFiles) -> Result<(), Failure> {
    let output = output.into();
    let (path, folder) = (output.path, folder_of(output.path));
    if !folder.is_dir() {
        let [shown, folder] = [path, folder].map(Path::display);
        return Err(Failure::new(Exit::Output, format!("{shown}: there is no folder {folder}")));
    }
    inputs.check(path)?;
    // Creating a file is the only reliable check that one can be created.
    Draft::begin(output, ".tmp").map(drop).map_err(|error| cannot_write(path, &error))
}

/// An output that replaces a file only with `force`.
pub(crate) fn forced(path: &Path, force: bool) -> Output<'_> {
    Output { path, existing: if force { Existing::Replace } else { Existing::Keep } }
}

/// What the names of octrees end in.
pub(crate) const TREE_ENDING: &str = ".copc.laz";

/// Whether the name is that of an octree.
pub(crate) fn is_tree(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().to_ascii_lowercase().ends_with(TREE_ENDING))
}

/// Whether there is a file with content. A power cut may have left an empty one.
pub(crate) fn is_written(path: &Path) -> bool {
    path.metadata().is_ok_and(|metadata| metadata.len() > 0)
}

/// Creates a folder and those above it.
pub(crate) fn create_folder(path: &Path) -> Result<(), Failure> {
    create_dir_all(path)
        .map_err(|error| Failure::new(Exit::Output, format!("{}: cannot create the folder: {error}", path.display())))
}

/// Writes a file atomically through `write`, and returns its size in bytes.
pub(crate) fn write_file<'a>(
    output: impl Into<Output<'a>>,
    console: &Console,
    write: impl FnOnce(&mut BufWriter<Stoppable<'_>>) -> std::io::Result<()>,
) -> Result<u64, Failure> {
    let (output, interrupt) = (output.into(), console.interrupt());
    let failed = |error: std::io::Error| cannot_write(output.path, &error);
    write_whole(output, failed, |file| {
        let mut writer = BufWriter::with_capacity(1 << 18, Stoppable { file: file.get_mut(), interrupt });
        write(&mut writer).and_then(|()| writer.flush()).map_err(failed)
    })
}

/// Writes a cloud atomically in the format of the path's extension. Returns the file's size in bytes.
pub(crate) fn write_cloud(cloud: &PointCloud, output: Output<'_>, console: &Console) -> Result<u64, Failure> {
    let bar = Bar::on_file("writing", output.path, console);
    autosplats_formats::write(cloud, output, &bar).map_err(|error| match error {
        Error::Io { source, .. } => cannot_write(output.path, &source),
        error => Failure::new(Exit::Output, error),
    })
}

/// Fails if the cloud's output has an unknown format or cannot be written.
pub(crate) fn check_cloud_target(output: Output<'_>, inputs: &ReadFiles) -> Result<(), Failure> {
    check_writable(output.path)?;
    check_target(output, inputs)
}

/// A file whose writes fail after Ctrl-C, so that a long write ends early.
pub(crate) struct Stoppable<'a> {
    file: &'a mut File,
    interrupt: &'a Interrupt,
}

impl Write for Stoppable<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.interrupt.requested() {
            // Not `ErrorKind::Interrupted`, on which callers try again.
            return Err(std::io::Error::other("interrupted"));
        }
        self.file.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Stoppable<'_> {
    fn seek(&mut self, position: SeekFrom) -> std::io::Result<u64> {
        self.file.seek(position)
    }
}

pub(crate) fn cannot_write(path: &Path, error: &std::io::Error) -> Failure {
    let (shown, said) = (path.display(), error.to_string());
    Failure::new(
        Exit::Output,
        match error.kind() {
            ErrorKind::AlreadyExists => format!("{shown}: already exists; --force replaces it"),
            ErrorKind::IsADirectory => format!("{shown}: this is a folder; name a file"),
            // The caller does not know the temporary file's name.
            _ => {
                let said = said.split(" at path ").next().unwrap_or(&said);
                let remedy = if is_full(error) { "; free some, or write to another disk" } else { "" };
                format!("{shown}: cannot be written: {said}{remedy}")
            }
        },
    )
}

pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[derive(Clone, Debug)]
pub(crate) struct Picture {
    pub(crate) path: PathBuf,
    pub(crate) format: Format,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Picture(PictureFormat),
    /// All layers.
    Exr,
}

impl Picture {
    /// Takes the format from the extension.
    pub(crate) fn new(path: PathBuf) -> Result<Self, Failure> {
        let format = match PictureFormat::of(&path) {
            Some(format) => Format::Picture(format),
            None if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr")) => Format::Exr,
            None => {
                return Err(Failure::usage(format!(
                    "{}: unknown picture format; the name must end in .png, .jpg or .exr",
                    path.display()
                )));
            }
        };
        Ok(Self { path, format })
    }
}
