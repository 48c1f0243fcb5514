//! Outputs: checked before any work is done, written whole or not at all.

mod exr;
mod png;

use std::collections::HashSet;
use std::fs::{File, metadata};
use std::io::{BufWriter, ErrorKind, Seek, SeekFrom, Write, stdout};
use std::path::{Path, PathBuf};

use autosplats_cloud::{Error, PointCloud, check_writable};
use tempfile::NamedTempFile;

pub(crate) use self::exr::write_exr;
pub(crate) use self::png::write_png;
use crate::exit::{Exit, Failure};
use crate::interrupt;
use crate::progress::Bar;

/// Files that are read, none of which an output may replace.
#[derive(Clone, Debug, Default)]
pub(crate) struct ReadFiles(HashSet<PathBuf>);

impl ReadFiles {
    /// Those of the files that are there.
    pub(crate) fn new(files: impl IntoIterator<Item = impl AsRef<Path>>) -> Self {
        Self(files.into_iter().filter_map(|file| file.as_ref().canonicalize().ok()).collect())
    }

    /// Refuses an output that would overwrite one.
    pub(crate) fn check(&self, output: &Path) -> Result<(), Failure> {
        if output.canonicalize().is_ok_and(|target| self.0.contains(&target)) {
            return Err(Failure::usage(format!("{}: this output would overwrite an input", output.display())));
        }
        Ok(())
    }
}

/// Refuses a path that cannot be written, or that would overwrite an input.
pub(crate) fn check_target(path: &Path, inputs: &ReadFiles) -> Result<(), Failure> {
    let folder = folder_of(path);
    let shown = path.display();
    if path.is_dir() || path.file_name().is_none() {
        return Err(Failure::new(Exit::Output, format!("{shown}: a folder, not a file to write")));
    }
    if !folder.is_dir() {
        return Err(Failure::new(Exit::Output, format!("{shown}: there is no folder {}", folder.display())));
    }
    inputs.check(path)?;
    // The only way to know whether a file can be made is to make one.
    let _writing = interrupt::writing();
    temporary_in(folder)
        .map_err(|error| cannot_write(path, &error))?
        .close()
        .map_err(|error| cannot_write(path, &error))
}

/// Writes a file through `write`; returns its size.
pub(crate) fn write_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<Stoppable<'_>>) -> std::io::Result<()>,
) -> Result<u64, Failure> {
    replace_file(path, |temporary| {
        let mut writer = BufWriter::with_capacity(1 << 18, Stoppable(temporary.as_file_mut()));
        write(&mut writer).and_then(|()| writer.flush()).map_err(|error| cannot_write(path, &error))
    })
}

/// Puts a file in place whole or not at all: `fill` writes it under a temporary name in the same folder, then it is
/// renamed. Returns its size.
pub(crate) fn replace_file(
    path: &Path,
    fill: impl FnOnce(&mut NamedTempFile) -> Result<(), Failure>,
) -> Result<u64, Failure> {
    // A link stays a link: what it points to is replaced.
    let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let _writing = interrupt::writing();
    let mut temporary = temporary_in(folder_of(&target)).map_err(|error| cannot_write(path, &error))?;
    let filled = fill(&mut temporary);
    if interrupt::requested() {
        return Err(Failure::interrupted());
    }
    filled?;
    temporary.persist(&target).map_err(|error| cannot_write(path, &error.error))?;
    metadata(&target).map(|metadata| metadata.len()).map_err(|error| cannot_write(path, &error))
}

/// Writes a cloud in the format that the name tells, whole or not at all. Returns the size of the file.
pub(crate) fn write_cloud(cloud: &PointCloud, path: &Path, quiet: bool) -> Result<u64, Failure> {
    // A link stays a link: what it points to is replaced.
    let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let bar = Bar::on_file("writing", path, quiet);
    let _writing = interrupt::writing();
    match autosplats_cloud::write(cloud, &target, &bar) {
        Ok(()) => metadata(&target).map(|metadata| metadata.len()).map_err(|error| cannot_write(path, &error)),
        Err(Error::Cancelled) => Err(Failure::interrupted()),
        Err(Error::Io { source, .. }) => Err(cannot_write(path, &source)),
        Err(error) => Err(Failure::new(Exit::Output, error)),
    }
}

/// Refuses a cloud's output whose format is not known, that exists and is not to be replaced, or that is no place to
/// write.
pub(crate) fn check_cloud_target(path: &Path, force: bool, inputs: &ReadFiles) -> Result<(), Failure> {
    check_writable(path).map_err(Failure::usage)?;
    check_target(path, inputs)?;
    if !force && path.exists() {
        return Err(Failure::new(Exit::Output, format!("{}: is already there; --force replaces it", path.display())));
    }
    Ok(())
}

/// A file that takes no more once Ctrl-C was pressed, so that a long write ends early.
pub(crate) struct Stoppable<'a>(&'a mut File);

impl Write for Stoppable<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if interrupt::requested() {
            // Not `ErrorKind::Interrupted`, which callers answer by trying again.
            return Err(std::io::Error::other("interrupted"));
        }
        self.0.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

impl Seek for Stoppable<'_> {
    fn seek(&mut self, position: SeekFrom) -> std::io::Result<u64> {
        self.0.seek(position)
    }
}

/// A line of data on standard output. Nobody reading it any more is no error.
pub(crate) fn print_line(line: &str) -> Result<(), Failure> {
    print_bytes(format!("{line}\n").as_bytes())
}

/// Data on standard output. Nobody reading it any more is no error.
pub(crate) fn print_bytes(bytes: &[u8]) -> Result<(), Failure> {
    match stdout().write_all(bytes) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::new(Exit::Output, format!("standard output: {error}")))
        }
        _ => Ok(()),
    }
}

fn cannot_write(path: &Path, error: &std::io::Error) -> Failure {
    let error = error.to_string();
    // The temporary name is nothing the caller knows.
    let reason = error.split(" at path ").next().unwrap_or(&error);
    Failure::new(Exit::Output, format!("{}: cannot write it: {reason}", path.display()))
}

/// The folder that a file is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn temporary_in(folder: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".autosplats-").suffix(".tmp");
    // Temporary files are private unless told otherwise; an output is what the user's mask makes of it.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

/// A picture to write.
#[derive(Clone, Debug)]
pub(crate) struct Picture {
    pub(crate) path: PathBuf,
    pub(crate) format: Format,
}

/// How a picture is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Png,
    Exr,
}

impl Picture {
    /// Takes the format from the extension.
    pub(crate) fn new(path: PathBuf) -> Result<Self, Failure> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let format = match extension.as_str() {
            "png" => Format::Png,
            "exr" => Format::Exr,
            _ => {
                return Err(Failure::usage(format!(
                    "{}: cannot tell the kind of picture; the name has to end in .png or .exr",
                    path.display()
                )));
            }
        };
        Ok(Self { path, format })
    }
}
