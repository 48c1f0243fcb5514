//! Files that are read in parts, for what shall not hold all points in memory.
//!
//! # How it works
//!
//! A reader decides much by all points: the origin, the scale of colours, which points are missing returns. This is
//! settled first, from the same samples and counts as if the file was read whole. Then the points can be passed on
//! again and again, a few at a time, and are the same.

use std::{borrow::Cow, path::Path};

use autosplats_cloud::{Bytes, Error, LeftOut, PointCloud, PointFilter, Progress, Unmarked};

use super::{
    ReadOptions,
    choose::{self, Classes},
    e57,
    job::{Format, Job},
    las,
    opened::{Opened, Reader, Unpacking},
    pcd,
    pieces::{Opening, Pieces, Seen},
    ply, registry,
    sensor::{Sample, tell_far},
    units,
    unpack::GZIP,
    xyz,
};

/// How a format's points are settled. `None` for a file that has to be read whole, of which nothing is noted.
type Open = fn(&Job<'_>, &Reader<'_>) -> Result<Option<Opening>, Error>;

/// The formats that can be read in parts.
const FORMATS: [(&Format, Open); 5] = [
    (&las::FORMAT, las::parts::open),
    (&ply::FORMAT, ply::parts::open),
    (&pcd::FORMAT, pcd::parts::open),
    (&e57::FORMAT, e57::parts::open),
    (&xyz::FORMAT, xyz::parts::open),
];

/// Usual number of a file's bytes in a part.
const PART_BYTES: usize = 8 << 20;

/// Share of opening that settling by all points takes, if points have to be looked at once more.
const SETTLING: f32 = 0.6;

/// A file whose points are passed on in parts, in memory for a few of them.
pub struct Parts {
    file: Opened,
    options: ReadOptions,
    pieces: Box<dyn Pieces>,
    chosen: Chosen,
    points: usize,
}

/// Which points and scans are kept.
#[derive(Default)]
struct Chosen {
    /// Whether points at (0, 0, 0) are dropped.
    no_returns: bool,
    filter: Option<PointFilter>,
    /// The scans that are dropped, because their sensor cannot have been where the file states.
    far: Vec<bool>,
}

/// Opens a file to read it in parts. They are the points that [`read_with`](crate::read_with) returns, about the same
/// origin and with the same attributes. Opening reads all points one to four times, because much is decided by all of
/// them. Notes are given then.
///
/// `None` for a file that has to be read whole: of a format other than LAS, PLY, PCD, text and E57; with triangles, or
/// lists beside the coordinates; compressed; in UTF-16; and what is no file, such as a pipe. Nothing is noted of it.
///
/// # Errors
/// Those of [`read_with`](crate::read_with); and [`Error::Malformed`] if the file changes meanwhile.
///
/// # Examples
///
/// ```
/// use autosplats_formats::{ReadOptions, open_parts};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("scan.xyz");
/// std::fs::write(&path, "1 2 3\n4 5 6\n")?;
/// let parts = open_parts(&path, &ReadOptions::default(), &())?.ok_or("it has to be read whole")?;
/// let mut points = 0;
/// parts.read(&(), &mut |cloud| {
///     points += cloud.len();
///     Ok(())
/// })?;
/// assert_eq!((points, parts.points()), (2, 2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn open_parts(path: &Path, options: &ReadOptions, progress: &dyn Progress) -> Result<Option<Parts>, Error> {
    open_parts_of(path, options, PART_BYTES, progress)
}

/// Like [`open_parts`], for points that are read again soon: those of LAZ wait decompressed on a disk.
///
/// # Errors
/// Those of [`open_parts`], and [`Error::Io`] with the folder if temporary files cannot be kept there.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{PointCloud, glam::DVec3};
/// use autosplats_formats::{ReadOptions, Unpacking, open_parts_unpacked, write};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("scan.laz");
/// write(&PointCloud::new(DVec3::ZERO, vec![[1.0, 2.0, 3.0]; 5]), &path, &())?;
/// let unpacking = Unpacking { folder: folder.path(), leave: 1 << 20 };
/// let parts = open_parts_unpacked(&path, &ReadOptions::default(), unpacking, &())?.ok_or("it has to be read whole")?;
/// assert_eq!(parts.points(), 5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn open_parts_unpacked(
    path: &Path,
    options: &ReadOptions,
    unpacking: Unpacking<'_>,
    progress: &dyn Progress,
) -> Result<Option<Parts>, Error> {
    open(path, options, PART_BYTES, Some(unpacking), progress)
}

/// Like [`open_parts`], in parts of about `part` bytes of the file, at least 1.
///
/// # Errors
/// Those of [`open_parts`].
pub fn open_parts_of(
    path: &Path,
    options: &ReadOptions,
    part: usize,
    progress: &dyn Progress,
) -> Result<Option<Parts>, Error> {
    open(path, options, part, None, progress)
}

fn open(
    path: &Path,
    options: &ReadOptions,
    part: usize,
    unpacking: Option<Unpacking<'_>>,
    progress: &dyn Progress,
) -> Result<Option<Parts>, Error> {
    let io = |source| Error::Io { path: path.into(), source };
    // What is no file can be read only once.
    let metadata = path.metadata().map_err(io)?;
    if !metadata.is_file() {
        return Ok(None);
    }
    let map = Bytes::open(path)?;
    let file = |before| Opened::new(path, &metadata, before, part.max(1));
    map.checked(open_mapped(path, &map, options, file, unpacking, progress))
}

/// Opens a file whose bytes are mapped. `file` makes it one to read again, without so many of its first bytes.
fn open_mapped(
    path: &Path,
    map: &[u8],
    options: &ReadOptions,
    file: impl FnOnce(usize) -> Opened,
    unpacking: Option<Unpacking<'_>>,
    progress: &dyn Progress,
) -> Result<Option<Parts>, Error> {
    if map.starts_with(GZIP) {
        return Ok(None);
    }
    let Unmarked { bytes: Cow::Borrowed(bytes), .. } = Unmarked::of(map)? else { return Ok(None) };
    let file = file(map.len() - bytes.len());
    let job = Job { path, progress, bytes, options, triangles: false };
    job.tick(0.0)?;
    let format = registry::format(&job)?;
    let Some((_, open)) = FORMATS.iter().find(|(known, _)| known.name == format.name) else { return Ok(None) };
    let again = options.keep.as_ref().is_some_and(|filter| !filter.is_all());
    let settling = Stage { whole: progress, start: 0.0, len: if again { SETTLING } else { 1.0 }, notes: true };
    let reader = file.reader()?.unpacking_to(unpacking);
    let Some(opening) = open(&Job { progress: &settling, ..job }, &reader)? else { return Ok(None) };
    registry::tell_columns(&job, format);
    if let Some(note) = units::scaled(&opening.crs) {
        job.note(note);
    }
    let Opening { pieces, seen, scans, .. } = opening;
    let no_returns = !options.keep_no_returns && registry::are_no_returns(&job, format, seen.at_zero, seen.points);
    let left = |seen: &Seen| seen.points - if no_returns { seen.at_zero } else { 0 };
    let points = left(&seen);
    let chosen = Chosen { no_returns, filter: None, far: vec![false; scans.len()] };
    let mut parts = Parts { file, options: options.clone(), pieces, chosen, points };
    if again || !scans.is_empty() {
        let scans: Vec<usize> = scans.iter().map(left).collect();
        let start = if again { SETTLING } else { 1.0 };
        let stage = Stage { whole: progress, start, len: 1.0 - start, notes: false };
        (parts.chosen, parts.points) = choose(&job, format, &parts, &scans, &stage)?;
    }
    job.tick(1.0)?;
    Ok(Some(parts))
}

/// Finds out which points the options leave out, and which scans have a sensor that is too far away. `scans` has the
/// number of points of each. Returns the number of points that are kept, too.
fn choose(
    job: &Job<'_>,
    format: &Format,
    parts: &Parts,
    scans: &[usize],
    progress: &dyn Progress,
) -> Result<(Chosen, usize), Error> {
    let (mut filter, mut counted, mut classes) = (None, LeftOut::default(), Classes::default());
    let mut samples: Vec<Sample> = scans.iter().map(|&points| Sample::of(points)).collect();
    let mut far = vec![false; scans.len()];
    let (mut first, mut seen) = (true, 0);
    parts.each(progress, &mut |cloud, scan| {
        if std::mem::take(&mut first) {
            filter = choose::filter(job, format, &cloud)?;
        }
        if let Some(filter) = filter {
            seen += cloud.len();
            counted = LeftOut::counts(&[std::mem::take(&mut counted), filter.left_out(&cloud)], filter);
            // They are told if nothing is kept.
            if counted.count() == seen {
                classes.add(&cloud);
            }
        }
        if let (Some(scan), [sensor, ..]) = (scan, cloud.scans()) {
            samples[scan].add(&cloud, 0..cloud.len());
            far[scan] = samples[scan].is_far(sensor.position(), cloud.origin());
        }
        Ok(())
    })?;
    if first {
        filter = choose::filter(job, format, &PointCloud::default())?;
    }
    let leaves = match filter {
        Some(filter) => choose::decide(job, filter, &counted, parts.points, || classes)?,
        None => false,
    };
    let count = far.iter().filter(|far| **far).count();
    if count > 0 {
        tell_far(job, count);
    }
    let chosen = Chosen { no_returns: parts.chosen.no_returns, filter: filter.filter(|_| leaves).cloned(), far };
    Ok((chosen, parts.points - if leaves { counted.count() } else { 0 }))
}

impl Parts {
    /// The file.
    pub fn path(&self) -> &Path {
        &self.file.path
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.points
    }

    /// Passes on all points in the file's order, from this thread. Clouds have at most about a million points and take
    /// some megabytes. None is empty. Each has the same origin and attributes. Nothing is noted.
    ///
    /// # Errors
    /// Those of `take`; those of reading; [`Error::Malformed`] if the file has changed since it was opened; and
    /// [`Error::Cancelled`] if `progress` says so.
    pub fn read(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let stage = Stage { whole: progress, start: 0.0, len: 1.0, notes: false };
        self.each(&stage, &mut |cloud, _| if cloud.is_empty() { Ok(()) } else { take(&cloud) })?;
        progress.tick(1.0)
    }

    /// Passes on the chosen points, each cloud with the scan that its points are of.
    fn each(
        &self,
        progress: &dyn Progress,
        take: &mut dyn FnMut(PointCloud, Option<usize>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let Self { file, options, pieces, chosen, .. } = self;
        let job = Job { path: &file.path, progress, bytes: &[], options, triangles: false };
        let reader = file.reader()?;
        pieces.read(&job, &reader, &mut |mut cloud, scan| {
            reader.check()?;
            units::settle(&Job { progress: &(), ..job }, &mut cloud)?;
            if chosen.no_returns {
                cloud.drop_no_returns(|_| true);
            }
            if scan.is_some_and(|scan| chosen.far[scan]) {
                cloud = cloud.with_scans(Vec::new());
            }
            if let Some(filter) = &chosen.filter {
                cloud.keep(filter);
            }
            take(cloud, scan)
        })?;
        reader.check()
    }
}

/// Progress of a part of the work, which may keep notes to itself.
struct Stage<'a> {
    whole: &'a dyn Progress,
    start: f32,
    len: f32,
    notes: bool,
}

impl Progress for Stage<'_> {
    fn report(&self, fraction: f32) {
        self.whole.report(self.start + self.len * fraction);
    }

    fn cancelled(&self) -> bool {
        self.whole.cancelled()
    }

    fn note(&self, note: &str) {
        if self.notes {
            self.whole.note(note);
        }
    }

    fn loss(&self, loss: &str) {
        if self.notes {
            self.whole.loss(loss);
        }
    }
}
