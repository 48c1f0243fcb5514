//! Work on more points than memory holds, in parts.

use std::path::{Path, PathBuf};

use autosplats_cloud::{
    Clouds, Error, Output, Part, PointCloud, Progress as _, Spool, available_memory, check_disk, usual_memory,
};
use autosplats_formats::{ReadOptions, TreeInput, TreeOptions, Unpacking, describe, write_clouds, write_tree};

use crate::args::{PartArgs, RoomArgs};
use crate::console::Console;
use crate::exit::{Exit, Failure};
use crate::input::Inputs;
use crate::output::{cannot_write, folder_of, is_tree};
use crate::progress::Bar;

/// Bytes that a point takes on the disk while it waits there, with all its values, in most scans.
pub(crate) const SPOOLED_BYTES: u64 = 60;

/// Least memory for making an octree of the results.
const TREE_MEMORY: u64 = 256 << 20;

/// Points that a sample has at most, if their number is known.
const SAMPLE: u64 = 1 << 17;

/// The points of a part that belong to the sample of `clouds`.
pub(crate) fn sample_of(part: &PointCloud, clouds: &dyn Clouds) -> PointCloud {
    let step = clouds.points().unwrap_or(u64::from(u32::MAX)).div_ceil(SAMPLE).max(1);
    let points: Vec<u32> = (0..part.len() as u32).step_by(step as usize).collect();
    part.pick(&points)
}

/// Points of the inputs, which wait on the disk, and the room for work on them.
pub(crate) struct Parts {
    pub(crate) clouds: Spool,
    pub(crate) points: u64,
    /// Memory to use, in bytes.
    pub(crate) memory: u64,
    /// Folder for temporary files.
    pub(crate) folder: PathBuf,
}

/// What the work needs.
pub(crate) struct Need<'a> {
    /// What it is called.
    pub(crate) what: &'a str,
    /// Memory per point if all are worked on at once, in bytes.
    pub(crate) memory: u64,
    /// Disk per point beside the points themselves, if they are worked on in parts.
    pub(crate) disk: u64,
}

/// Fails if the folder for temporary files is none.
pub(crate) fn check_room(room: &RoomArgs) -> Result<(), Failure> {
    match &room.temp {
        Some(folder) if !folder.is_dir() => {
            Err(Failure::new(Exit::Output, format!("--temp {}: there is no such folder", folder.display())))
        }
        _ => Ok(()),
    }
}

/// Reads the inputs onto the disk, if their points need more memory than there is. `None` if they are to be worked on
/// at once.
pub(crate) fn parts(
    inputs: &Inputs,
    room: &RoomArgs,
    part: &PartArgs,
    output: &Path,
    need: &Need<'_>,
    console: &Console,
) -> Result<Option<Parts>, Failure> {
    let limit = room.memory.or_else(|| available_memory().map(|free| free / 4 * 3));
    // Of octrees, bounds and spacing read only what they need.
    let whole = part.spacing.is_some() || part.bounds.is_some() && inputs.only_tree();
    let Some(points) = inputs.points_at_most().filter(|_| !whole) else {
        if room.memory.is_some() && !whole {
            console.note(
                "--memory: points with poses, of recordings, pipes or more than 1,000 inputs are worked on at once; make \
                 one octree of them first, such as all.copc.laz",
            );
        }
        return Ok(None);
    };
    let limit = limit.unwrap_or(u64::MAX);
    if points.saturating_mul(need.memory) <= limit {
        return Ok(None);
    }
    let memory = room.memory.unwrap_or_else(usual_memory);
    let folder = room.temp.clone().unwrap_or_else(|| folder_of(output).to_owned());
    let failed = |error| failure(error, output, &folder);
    let bar = Bar::on_file("reading", Path::new(&inputs.names()), console);
    let first = Part { whole: &bar, start: 0.0, len: 0.5 };
    let disk = |points: u64| points.saturating_mul(SPOOLED_BYTES + need.disk);
    let unpacking = Unpacking { folder: &folder, leave: disk(points) };
    let Some(clouds) = inputs.in_parts(unpacking, &first, console)? else {
        if room.memory.is_some() {
            console.note("--memory: not all of these formats can be read in parts, so all points are read at once");
        }
        return Ok(None);
    };
    // Of text the number was a guess. If it was too high, work in parts is right nevertheless.
    let points = clouds.points().unwrap_or(points);
    check_disk(&folder, disk(points), need.what).map_err(failed)?;
    let second = Part { whole: &bar, start: 0.5, len: 0.5 };
    let clouds = Spool::of(&*clouds, &folder, &second).map_err(failed)?;
    bar.report(1.0);
    let points = clouds.points().unwrap_or(points);
    Ok(Some(Parts { clouds, points, memory, folder }))
}

/// Number of points in a file that was written: some formats do not hold points without finite coordinates.
pub(crate) fn points_in(output: &Path, written: u64) -> u64 {
    let described = output.is_file().then(|| describe(output, &ReadOptions::default()).ok()).flatten();
    described.and_then(|about| about.points).map_or(written, |points| points.min(written))
}

impl Parts {
    /// Writes the points, of which this work made `clouds`. Returns the size of the file in bytes.
    pub(crate) fn write(&self, clouds: &dyn Clouds, output: Output<'_>, console: &Console) -> Result<u64, Failure> {
        let bar = Bar::on_file("writing", output.path, console);
        let written = if is_tree(output.path) {
            let temp = Some(self.folder.clone());
            let options = TreeOptions { memory: self.memory.max(TREE_MEMORY), temp, ..TreeOptions::default() };
            let inputs = vec![TreeInput::Clouds(Box::new(clouds))];
            write_tree(inputs, output, &options, &bar).map(|summary| summary.bytes)
        } else {
            write_clouds(clouds, output, &bar)
        };
        written.map_err(|error| self.failure(error, output.path))
    }

    /// The failure of an error in the work.
    pub(crate) fn failure(&self, error: impl Into<WorkError>, output: &Path) -> Failure {
        match error.into() {
            WorkError::Cloud(error) => failure(error, output, &self.folder),
            WorkError::Other(error) => error.into(),
        }
    }
}

/// An error of work on points.
pub(crate) enum WorkError {
    Cloud(Error),
    Other(autosplats::Error),
}

impl From<Error> for WorkError {
    fn from(error: Error) -> Self {
        Self::Cloud(error)
    }
}

impl From<autosplats::Error> for WorkError {
    fn from(error: autosplats::Error) -> Self {
        match error {
            autosplats::Error::Reading(error) => Self::Cloud(error),
            error => Self::Other(error),
        }
    }
}

/// The failure of an error: of the output, if that or the folder of temporary files is to blame.
pub(crate) fn failure(error: Error, output: &Path, temp: &Path) -> Failure {
    match &error {
        Error::Io { path, source } if path == output => cannot_write(output, source),
        Error::Io { path, source } if path == temp => Failure::temporary(temp, source),
        Error::OutOfMemory { .. } => Failure::new(Exit::Memory, error),
        Error::Cancelled => Failure::interrupted(),
        _ => Failure::from(error),
    }
}
