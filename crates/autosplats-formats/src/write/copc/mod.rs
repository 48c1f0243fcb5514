//! COPC 1.0: an octree of points in a LAZ file, made of any number of points in bounded memory.
//!
//! # How it works
//!
//! The headers of the inputs tell which [records](schema) hold all that they hold, and how large the [cube](frame) of
//! the octree is. All points become such records, which are [distributed](distribute) to cells of a grid in one
//! [temporary file](Spill). Cells are joined to parts of a fixed number of points. Each part is [built](build) in
//! memory, several at a time, and its nodes are written at once. The [nodes above the parts](tops) are joined as their
//! children come. Tables of [chunks and nodes](file) end the file.
//!
//! A header may lie about bounds. Points beyond them, or bounds far beyond the points, make the work start again with
//! the bounds of the points.
//!
//! The bytes of the file depend on the points alone: not on the order of the inputs, the number of threads or the
//! memory. All choices among points are by their places, and by their bytes where places are the same.

mod build;
mod choose;
mod compress;
mod distribute;
mod extras;
mod file;
mod frame;
mod hierarchy;
mod key;
mod recode;
mod sample;
mod schema;
mod sort;
mod sources;
mod tops;

use std::{
    fs::File,
    io::BufWriter,
    path::{Path, PathBuf},
    sync::{
        Mutex,
        atomic::{AtomicU64, Ordering},
    },
};

use autosplats_cloud::{
    Error, Output, Part as PartOf, PointFilter, Progress, Spill, check_disk, lock, usual_memory, write_whole,
};
use glam::DVec3;
use rayon::prelude::*;

pub use self::sources::TreeInput;
use self::{
    build::build,
    compress::Compressor,
    distribute::{Bounds, Chunk, Grid, Outside, Space as GridSpace, most_points, parts, scatter},
    file::TreeFile,
    frame::Frame,
    schema::{Holds, Schema},
    sources::{Prepared, Source},
    tops::Tops,
};
use super::Format;

/// Memory that is neither records nor what they become.
const RESERVE: u64 = 48 << 20;

/// Memory per point while a part is built, beside its record: codes, order, and the compressed point.
const BUILD_BYTES: u64 = 60;

/// Part of the memory in which cells gather records.
const GATHERED: u64 = 3;

/// What the size of the file is of that of its uncompressed records, at most, in most cases.
const OUTPUT_PART: u64 = 3;

/// Part of the progress that reading takes.
const READING: f32 = 0.45;

/// How a tree is made.
#[derive(Clone, Debug, Default)]
pub struct TreeOptions {
    /// Memory to use, in bytes.
    pub memory: u64,
    /// Folder for temporary files; by default that of the output.
    pub temp: Option<PathBuf>,
    /// Corners of the box that kept points lie in, in world coordinates.
    pub bounds: Option<[DVec3; 2]>,
    /// Which points of LAS files to keep. Of other inputs, whoever reads them chooses.
    pub keep: Option<PointFilter>,
    /// Keep points of LAS files at (0, 0, 0), which scanners write for missing returns.
    pub keep_no_returns: bool,
    /// Take only whole LAS files: one that is cut off or damaged is an error.
    pub whole: bool,
}

/// A tree that was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TreeSummary {
    /// Number of points.
    pub points: u64,
    /// Number of nodes.
    pub nodes: usize,
    /// Size of the file, in bytes.
    pub bytes: u64,
    /// Largest size of the temporary file, in bytes.
    pub temporary: u64,
}

/// Makes one COPC file of all points of the inputs. The file appears complete or not at all, and replaces an existing
/// file, unless the [`Output`] says otherwise.
///
/// # Errors
/// Those of reading and writing; [`Error::Unsupported`] for inputs that cannot be joined without loss;
/// [`Error::OutOfMemory`] if `memory` does not suffice; and [`Error::Cancelled`] if `progress` says so.
pub fn write_tree<'a>(
    inputs: Vec<TreeInput<'_>>,
    output: impl Into<Output<'a>>,
    options: &TreeOptions,
    progress: &dyn Progress,
) -> Result<TreeSummary, Error> {
    let output = output.into();
    let path = output.path;
    let mut summary = TreeSummary::default();
    let bytes = write_whole(
        output,
        |source| Error::Io { path: path.into(), source },
        |file| {
            summary = make(inputs, path, options, progress, file)?;
            progress.tick(1.0)
        },
    )?;
    Ok(TreeSummary { bytes, ..summary })
}

/// Fills the file.
fn make(
    inputs: Vec<TreeInput<'_>>,
    path: &Path,
    options: &TreeOptions,
    progress: &dyn Progress,
    file: &mut BufWriter<&mut File>,
) -> Result<TreeSummary, Error> {
    progress.tick(0.0)?;
    let several = inputs.len() > 1;
    let sources = inputs.into_par_iter().map(Source::open).collect::<Result<Vec<_>, Error>>()?;
    let mut holds = Vec::new();
    for source in &sources {
        source.tell(several, options.whole, progress)?;
        holds.push(source.holds(progress)?);
    }
    let points: u64 = holds.iter().map(|input| input.points).sum();
    let empty = holds.first().map_or_else(|| path.to_owned(), |input| input.name.clone());
    let mut filled: Vec<Holds> = holds.into_iter().filter(|input| input.points > 0).collect();
    if points == 0 {
        return Err(Error::unsupported(&empty, "there are no points, and an octree needs one"));
    }
    if let Some([min, max]) = options.bounds {
        filled.retain(|input| input.bounds[0].cmple(max).all() && input.bounds[1].cmpge(min).all());
        filled.iter_mut().for_each(|input| input.bounds = [input.bounds[0].max(min), input.bounds[1].min(max)]);
    }
    if filled.is_empty() {
        return Err(none_inside(path, points));
    }
    let schema = Schema::of(&filled, progress)?;
    let compressor = Compressor::new(path.into(), schema.format, schema.record_len)?;
    let making = Making { path, options, progress, schema: &schema, compressor: &compressor, several, points };
    making.check_memory()?;
    making.check_disk()?;
    let prepared = sources.into_iter().map(|source| source.prepare(&schema, options, progress));
    let prepared = prepared.collect::<Result<Vec<Prepared<'_>>, Error>>()?;
    making.make(&prepared, &filled, file)
}

fn none_inside(path: &Path, points: u64) -> Error {
    Error::unsupported(path, format!("none of the {points} points lies inside; widen --bounds"))
}

pub(super) const FORMAT: Format = Format {
    name: "COPC",
    extensions: &["copc.laz"],
    write: |job, file| {
        let options = TreeOptions { memory: usual_memory(), ..TreeOptions::default() };
        make(vec![TreeInput::Clouds(Box::new(job.clouds))], job.path, &options, job.progress, file).map(drop)
    },
};

/// What all steps need.
struct Making<'a> {
    path: &'a Path,
    options: &'a TreeOptions,
    progress: &'a dyn Progress,
    schema: &'a Schema,
    compressor: &'a Compressor,
    several: bool,
    points: u64,
}

impl Making<'_> {
    /// Memory for records.
    fn memory(&self) -> u64 {
        self.options.memory.saturating_sub(RESERVE)
    }

    fn point_bytes(&self) -> u64 {
        self.schema.record_len as u64 + BUILD_BYTES
    }

    fn check_memory(&self) -> Result<(), Error> {
        let part = self.points.min(most_points(self.schema.record_len));
        self.check_part(part)
    }

    /// Fails if a part of this many points does not fit into the memory that may be used.
    fn check_part(&self, points: u64) -> Result<(), Error> {
        let bytes = points * self.point_bytes();
        if bytes > self.memory() {
            let least = (bytes + RESERVE).div_ceil(1 << 20);
            let what = format!("{points} points at a time, for which at least {least} MiB must be allowed,");
            return Err(Error::OutOfMemory { what, bytes: bytes as usize });
        }
        Ok(())
    }

    /// Fails if the disk has less room than the records take, before anything is read.
    fn check_disk(&self) -> Result<(), Error> {
        let need = self.points * self.schema.record_len as u64;
        // The file itself is a part of the size of its records.
        let beside = if self.options.temp.is_none() { need / OUTPUT_PART } else { 0 };
        check_disk(self.folder(), need + beside, "making the octree")
    }

    fn folder(&self) -> &Path {
        let own = self.path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        self.options.temp.as_deref().unwrap_or(own)
    }

    /// A box of world coordinates as steps, with some room below: headers round.
    fn steps(&self, inputs: &[Holds]) -> [[i64; 3]; 2] {
        let lattice = self.schema.lattice;
        let corner = |pick: fn(&Holds) -> DVec3, join: fn(f64, f64) -> f64, none: f64| {
            let world = inputs.iter().map(pick).fold(DVec3::splat(none), |all, one| {
                DVec3::from_array([0, 1, 2].map(|axis| join(all[axis], one[axis])))
            });
            ((world - lattice.offset) / lattice.scale).round().to_array().map(|steps| steps as i64)
        };
        let low = corner(|input| input.bounds[0], f64::min, f64::INFINITY);
        let high = corner(|input| input.bounds[1], f64::max, f64::NEG_INFINITY);
        let room = [0, 1, 2].map(|axis| (high[axis] - low[axis]) >> 10).into_iter().max().unwrap_or(0);
        [low.map(|low| low - room), high]
    }

    fn make(
        &self,
        sources: &[Prepared<'_>],
        inputs: &[Holds],
        out: &mut BufWriter<&mut File>,
    ) -> Result<TreeSummary, Error> {
        let lattice = self.schema.lattice;
        let mut frame = Frame::around(lattice, self.steps(inputs));
        let mut known: Option<Bounds> = None;
        let (grid, spill) = loop {
            let grid = Grid::new(&frame, self.points, self.schema.record_len);
            let budget = (self.memory() / GATHERED) as usize;
            let spill = Spill::new(self.folder(), self.schema.record_len, grid.cells.len(), budget)?;
            let (bounds, inside) = self.read(sources, &frame, &grid, &spill, known.is_some())?;
            let exact = Frame::around(lattice, bounds.corners());
            // A cube four times too large would have empty coarse levels.
            if known.is_some() || inside && exact.bits + 1 >= frame.bits {
                break (grid, spill);
            }
            self.progress.note("the bounds in the header are wrong; all points are read twice");
            let bounds = if inside { bounds } else { self.bounds(sources)? };
            frame = Frame::around(lattice, bounds.corners());
            known = Some(bounds);
        };
        for source in sources {
            source.tell_lost(self.several, self.options.whole, self.progress)?;
        }
        let chunks = parts(&frame, grid, &spill, self.progress)?;
        let total: u64 = chunks.iter().map(|chunk| chunk.points).sum();
        if total == 0 {
            let points = self.points;
            return Err(match (&self.options.keep, self.options.bounds) {
                (Some(filter), None) => Error::NothingKept {
                    path: inputs[0].name.clone(),
                    filter: filter.to_string(),
                    points: points as usize,
                    there: String::new(),
                },
                _ => none_inside(self.path, points),
            });
        }
        let mut file = TreeFile::new(self.path, out, self.schema, &frame, self.compressor)?;
        let mut tops = Tops::new(frame.bits, self.compressor);
        let building = PartOf { whole: self.progress, start: READING, len: 1.0 - READING };
        let mut done = 0;
        let mut rest = chunks;
        while !rest.is_empty() {
            building.tick(done as f32 / total as f32)?;
            let group = self.group(&mut rest)?;
            done += group.iter().map(|chunk| chunk.points).sum::<u64>();
            let one = |chunk: Chunk| {
                let place = chunk.place;
                build(&frame, place, &chunk.load(&spill)?, self.compressor, self.progress)
            };
            let built = group.into_par_iter().map(one).collect::<Result<Vec<_>, Error>>()?;
            for part in built {
                part.nodes.into_iter().try_for_each(|node| file.put(node))?;
                if let Some(top) = part.top {
                    tops.add(top, &mut file)?;
                }
            }
        }
        tops.finish(&mut file)?;
        let temporary = spill.bytes();
        let (points, nodes) = file.finish()?;
        debug_assert_eq!(points, total, "every point is written once");
        Ok(TreeSummary { points, nodes, temporary, ..TreeSummary::default() })
    }

    /// Takes the next parts that fit into memory together.
    fn group(&self, rest: &mut Vec<Chunk>) -> Result<Vec<Chunk>, Error> {
        let mut bytes = 0;
        let most = 4 * rayon::current_num_threads();
        let fits = |chunk: &&Chunk| {
            bytes += chunk.points * self.point_bytes();
            bytes <= self.memory()
        };
        let count = rest.iter().take(most).take_while(fits).count();
        if count == 0 {
            self.check_part(rest[0].points)?;
        }
        Ok(rest.drain(..count.max(1)).collect())
    }

    /// Reads all points into the cells. Returns their bounds, and false if it ended early at a point outside of the
    /// frame.
    fn read(
        &self,
        sources: &[Prepared<'_>],
        frame: &Frame,
        grid: &Grid,
        spill: &Spill,
        again: bool,
    ) -> Result<(Bounds, bool), Error> {
        let bounds = Mutex::new(Bounds::NONE);
        let outside = Outside::default();
        let read = AtomicU64::new(0);
        let spaces: Mutex<Vec<GridSpace>> = Mutex::default();
        let outcome = self.each(sources, &|records| {
            if outside.is_set() {
                return Err(Error::Cancelled);
            }
            let mut space = lock(&spaces).pop().unwrap_or_default();
            let mut own = Bounds::NONE;
            if !scatter(frame, grid, spill, records, &mut space, &mut own)? {
                outside.set();
            }
            lock(&bounds).join(&own);
            lock(&spaces).push(space);
            let points = (records.len() / spill.record_len) as u64;
            let done = read.fetch_add(points, Ordering::Relaxed) + points;
            let part = done as f32 / self.points as f32;
            self.progress.tick(READING * if again { 1.0 } else { part })
        });
        match outcome {
            Err(Error::Cancelled) if outside.is_set() && !self.progress.cancelled() => {}
            outcome => outcome?,
        }
        let bounds = *lock(&bounds);
        Ok((bounds, !outside.is_set()))
    }

    /// Passes the records of all sources on. Files of records are read side by side; clouds need much memory.
    fn each(&self, sources: &[Prepared<'_>], take: &(dyn Fn(&[u8]) -> Result<(), Error> + Sync)) -> Result<(), Error> {
        let (large, small): (Vec<_>, Vec<_>) = sources.iter().partition(|source| source.is_clouds());
        small.par_iter().try_for_each(|source| source.read(self.progress, take))?;
        large.iter().try_for_each(|source| source.read(self.progress, take))
    }

    /// The bounds of all points.
    fn bounds(&self, sources: &[Prepared<'_>]) -> Result<Bounds, Error> {
        let bounds = Mutex::new(Bounds::NONE);
        self.each(sources, &|records| {
            let mut own = Bounds::NONE;
            records.chunks_exact(self.schema.record_len).for_each(|record| own.add(frame::steps_of(record)));
            lock(&bounds).join(&own);
            Ok(())
        })?;
        let bounds = *lock(&bounds);
        Ok(bounds)
    }
}
