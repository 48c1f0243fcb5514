//! A cloud or a pool on the device, in chunks where one binding cannot hold it, uploaded piece by piece.

use std::ops::Range;

use autosplats_cloud::{RelativeValues, SLOT_POINTS};
use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::slots::{DeviceSlot, SlotTable};
use crate::Error;
use crate::gpu::Gpu;
use crate::points::Points;

/// Points of a piece, which a thread writes into a staging buffer of its own.
const UPLOAD_PIECE_POINTS: usize = 1 << 18;
/// Most pieces that are written side by side and copied by one submission: a load.
const PIECES_PER_LOAD: usize = 8;
/// Loads under way. The host writes one while the device copies another.
const LOADS: usize = 2;
/// Words of a [`DeviceSlot`].
const SLOT_WORDS: usize = size_of::<DeviceSlot>() / size_of::<f32>();
/// Buffers are reallocated when a cloud uses less than one in this many of their points.
const SHRINK_RATIO: usize = 4;

/// Per-point values that splats carry.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PointValues<'a> {
    /// sRGB.
    pub(crate) colors: Option<&'a [[u8; 3]]>,
    pub(crate) scalar: Option<RelativeValues<'a>>,
}

impl PointValues<'_> {
    /// Words per point: a colour in the low three bytes of one word, then the bits of a number.
    pub(crate) fn words(&self) -> usize {
        usize::from(self.colors.is_some()) + usize::from(self.scalar.is_some())
    }

    /// Writes the values of the points at `points`.
    fn write(&self, points: Range<usize>, to: wgpu::WriteOnly<'_, [u8]>) {
        let color = |&[r, g, b]: &[u8; 3]| u32::from_le_bytes([r, g, b, 0]).to_ne_bytes();
        let (words, _) = to.into_chunks::<4>();
        match (self.colors, self.scalar) {
            (Some(colors), None) => words.write_iter(colors[points].iter().map(color)),
            (None, Some(scalar)) => words.write_iter(points.map(|at| scalar.get(at).to_ne_bytes())),
            (Some(colors), Some(scalar)) => {
                words.write_iter(points.flat_map(|at| [color(&colors[at]), scalar.get(at).to_ne_bytes()]));
            }
            (None, None) => {}
        }
    }
}

/// A chunk of points, laid out as in `shared/cloud_points.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ChunkUniform {
    pub(crate) first: u32,
    pub(crate) len: u32,
    /// Words of values per point.
    pub(crate) values: u32,
    /// Binary logarithm of the number of points in a slot.
    pub(crate) slot_shift: u32,
    /// Place of the first slot's [`DeviceSlot`] in the positions, in words.
    pub(crate) slots: u32,
}

/// A chunk of points in buffers of its own.
#[derive(Debug)]
pub(crate) struct Chunk {
    /// Number of points that fit.
    pub(crate) capacity: u32,
    pub(crate) uniform: wgpu::Buffer,
    /// Positions of `capacity` points, then a [`DeviceSlot`] for each slot: passes have no binding to spare.
    pub(crate) positions: wgpu::Buffer,
    pub(crate) values: wgpu::Buffer,
}

/// The points of a cloud or a pool on the device.
#[derive(Debug, Default)]
pub(crate) struct DeviceCloud {
    /// Number that all indices of points are below.
    points: usize,
    slot_shift: u32,
    /// Number of points that fit.
    capacity: usize,
    /// Words of values per point.
    words: usize,
    chunks: Vec<Chunk>,
    /// [`PointNames`](super::PointNames); `None` until the first resize.
    names: Option<wgpu::Buffer>,
}

impl DeviceCloud {
    /// The chunks, in the order of points.
    pub(crate) fn chunks(&self) -> &[Chunk] {
        &self.chunks
    }

    /// Names of the points, once there is [room](Self::resize) for any.
    pub(super) fn names(&self) -> Option<&wgpu::Buffer> {
        self.names.as_ref()
    }

    /// Number of points that fit.
    pub(crate) fn capacity(&self) -> usize {
        self.capacity
    }

    /// Words of values per point.
    pub(crate) fn words(&self) -> usize {
        self.words
    }

    /// Whether `points` points can go into the present buffers: they fit and do not leave most of the room unused.
    pub(crate) fn fits(&self, points: usize) -> bool {
        points <= self.capacity && points >= self.capacity / SHRINK_RATIO
    }

    /// Makes room for points: all of a cloud, or as many as a pool may ever hold. Positions and values are lost unless
    /// the points [fit](Self::fits).
    ///
    /// # Errors
    /// [`Error::DeviceMemory`] if the device has no room; the cloud is then empty.
    pub(crate) fn resize(&mut self, gpu: &Gpu, of: Points<'_>) -> Result<(), Error> {
        let points = of.room();
        if !self.fits(points) {
            // A cloud that has grown once is likely to grow again. A pool never grows.
            let grows = matches!(of, Points::Cloud(_)) && self.capacity > 0 && points > self.capacity;
            let grown = if grows { points + points / 4 } else { points };
            *self = Self::default();
            let mut chunks = Vec::new();
            // Chunks are made of whole slots.
            let slot_bytes = SLOT_POINTS * size_of::<[f32; 3]>() + size_of::<DeviceSlot>();
            let longest = gpu.most_bound() as usize / slot_bytes * SLOT_POINTS;
            for first in (0..grown).step_by(longest) {
                let capacity = longest.min(grown - first);
                let uniform = gpu.uniform::<ChunkUniform>("run of points")?;
                let words = 3 * capacity + SLOT_WORDS * capacity.div_ceil(SLOT_POINTS);
                let positions = gpu.storage::<f32>("positions", words)?;
                let values = gpu.storage::<u32>("values of points", 0)?;
                chunks.push(Chunk { capacity: capacity as u32, uniform, positions, values });
            }
            (self.capacity, self.chunks) = (grown, chunks);
        }
        if self.names.is_none() {
            // The shift, and two words a slot. A cloud has two slots at least.
            self.names = Some(gpu.storage::<u32>("names of points", 2 * self.capacity.div_ceil(SLOT_POINTS) + 5)?);
        }
        (self.points, self.slot_shift) = (points, of.slot_shift());
        self.write_uniforms(gpu);
        Ok(())
    }

    /// Makes room for `words` words of values per point. Values are lost if the number of words changes.
    ///
    /// # Errors
    /// [`Error::DeviceMemory`] if the device has no room.
    pub(crate) fn resize_values(&mut self, gpu: &Gpu, words: usize) -> Result<(), Error> {
        if words != self.words {
            // Stays 0 if an allocation fails.
            self.words = 0;
            for chunk in &mut self.chunks {
                chunk.values = gpu.storage::<u32>("values of points", chunk.capacity as usize * words)?;
            }
            self.words = words;
            self.write_uniforms(gpu);
        }
        Ok(())
    }

    /// Ranges of indices in pieces that are uploaded at once: the chunk, the index of the first point in the chunk, and
    /// the indices.
    fn pieces(&self, written: &[Range<usize>]) -> impl Iterator<Item = (&Chunk, usize, Range<usize>)> {
        let starts = self.chunks.iter().scan(0, |first, chunk| {
            let start = *first;
            *first += chunk.capacity as usize;
            Some((chunk, start))
        });
        starts.flat_map(move |(chunk, start)| {
            let end = start + chunk.capacity as usize;
            written.iter().flat_map(move |range| {
                let range = range.start.max(start)..range.end.min(end);
                range
                    .clone()
                    .step_by(UPLOAD_PIECE_POINTS)
                    .map(move |first| (chunk, first - start, first..range.end.min(first + UPLOAD_PIECE_POINTS)))
            })
        })
    }

    /// Writes what the next frame projects: all points of a table.
    pub(crate) fn write_slots(&self, gpu: &Gpu, table: &SlotTable<'_>) {
        let slots = table.on_device();
        if let Some(names) = &self.names {
            gpu.queue.write_buffer(names, 0, bytemuck::cast_slice(&table.names.on_device()));
        }
        let mut first = 0;
        for chunk in &self.chunks {
            let at = first >> self.slot_shift;
            let last = (first + chunk.capacity as usize - 1) >> self.slot_shift;
            let mut told = slots.get(at..slots.len().min(last + 1)).unwrap_or_default().to_vec();
            told.resize(last + 1 - at, DeviceSlot::EMPTY);
            let place = u64::from(chunk.capacity) * size_of::<[f32; 3]>() as u64;
            gpu.queue.write_buffer(&chunk.positions, place, bytemuck::cast_slice(&told));
            first += chunk.capacity as usize;
        }
    }

    /// Writes the uniform of each chunk.
    fn write_uniforms(&self, gpu: &Gpu) {
        let mut first = 0;
        for chunk in &self.chunks {
            let len = chunk.capacity.min((self.points - first) as u32);
            let told = ChunkUniform {
                first: first as u32,
                len,
                values: self.words as u32,
                slot_shift: self.slot_shift,
                slots: 3 * chunk.capacity,
            };
            gpu.queue.write_buffer(&chunk.uniform, 0, bytemuck::bytes_of(&told));
            first += len as usize;
        }
    }
}

/// Copies clouds to the device through staging buffers, which bound the memory in transit.
///
/// Such a buffer may be memory of the device behind the bus, which one thread cannot fill as fast as the bus takes it.
#[derive(Debug, Default)]
pub(crate) struct Uploader {
    loads: [Load; LOADS],
    next: usize,
}

/// Writes the points of an index range into a buffer.
type Write<'a> = dyn Fn(Range<usize>, wgpu::WriteOnly<'_, [u8]>) + Sync + 'a;

/// The staging buffers of a load, each of one piece of positions.
#[derive(Debug, Default)]
struct Load {
    buffers: Vec<wgpu::Buffer>,
    /// Submission that last copied from the buffers.
    submitted: Option<wgpu::SubmissionIndex>,
}

/// A piece to be copied.
struct Piece<'a> {
    to: &'a wgpu::Buffer,
    /// Index of the first point in `to`.
    at: usize,
    /// Indices of the points in the cloud.
    points: Range<usize>,
}

impl Uploader {
    /// Uploads the positions at `written` indices.
    ///
    /// # Errors
    /// [`Error::DeviceLost`], [`Error::DeviceMemory`], and [`Error::Cancelled`] if `report` returns false; its
    /// argument is the fraction done.
    pub(crate) fn positions(
        &mut self,
        gpu: &Gpu,
        positions: &[[f32; 3]],
        written: &[Range<usize>],
        to: &DeviceCloud,
        report: &dyn Fn(f32) -> bool,
    ) -> Result<(), Error> {
        let pieces = to.pieces(written).map(|(chunk, at, points)| Piece { to: &chunk.positions, at, points });
        let write = |points: Range<usize>, mut to: wgpu::WriteOnly<'_, [u8]>| {
            to.copy_from_slice(bytemuck::cast_slice(&positions[points]));
        };
        self.upload(gpu, pieces.collect(), size_of::<[f32; 3]>(), &write, &mut Done::new(written, report))
    }

    /// Uploads the values at `written` indices.
    ///
    /// # Errors
    /// Those of [`positions`](Self::positions).
    pub(crate) fn values(
        &mut self,
        gpu: &Gpu,
        values: &PointValues<'_>,
        written: &[Range<usize>],
        to: &DeviceCloud,
        report: &dyn Fn(f32) -> bool,
    ) -> Result<(), Error> {
        let pieces = to.pieces(written).filter(|_| to.words > 0);
        let pieces = pieces.map(|(chunk, at, points)| Piece { to: &chunk.values, at, points });
        let write = |points: Range<usize>, to: wgpu::WriteOnly<'_, [u8]>| values.write(points, to);
        self.upload(gpu, pieces.collect(), to.words * size_of::<u32>(), &write, &mut Done::new(written, report))
    }

    /// Uploads pieces; `write` writes the points of an index range, each of `point_bytes`.
    fn upload(
        &mut self,
        gpu: &Gpu,
        pieces: Vec<Piece<'_>>,
        point_bytes: usize,
        write: &Write<'_>,
        done: &mut Done<'_>,
    ) -> Result<(), Error> {
        for pieces in pieces.chunks(PIECES_PER_LOAD) {
            // The next load is the oldest, so this waits only if the device is slower than the host.
            self.next = (self.next + 1) % LOADS;
            self.loads[self.next].copy(gpu, pieces, point_bytes, write)?;
            done.add(pieces.iter().map(|piece| piece.points.len()).sum())?;
        }
        gpu.check_lost()
    }
}

impl Load {
    /// Writes pieces side by side, and submits their copies.
    fn copy(&mut self, gpu: &Gpu, pieces: &[Piece<'_>], point_bytes: usize, write: &Write<'_>) -> Result<(), Error> {
        let lost = || gpu.check_lost().err().unwrap_or_else(|| Error::DeviceLost("it takes no points".into()));
        while self.buffers.len() < pieces.len() {
            let usage = wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC;
            let size = (UPLOAD_PIECE_POINTS * size_of::<[f32; 3]>()) as u64;
            self.buffers.push(gpu.buffer("staging", size, usage)?);
        }
        let bytes_of = |piece: &Piece<'_>| (piece.points.len() * point_bytes) as u64;
        for (piece, buffer) in pieces.iter().zip(&self.buffers) {
            buffer.map_async(wgpu::MapMode::Write, 0..bytes_of(piece), |_| {});
        }
        let poll = match self.submitted.take() {
            Some(submitted) => wgpu::PollType::Wait { submission_index: Some(submitted), timeout: None },
            None => wgpu::PollType::Poll,
        };
        gpu.device.poll(poll).map_err(|_| lost())?;
        pieces.par_iter().zip(&self.buffers).try_for_each(|(piece, buffer)| {
            let mut mapped = buffer.get_mapped_range_mut(0..bytes_of(piece)).map_err(|_| lost())?;
            write(piece.points.clone(), mapped.slice(..));
            drop(mapped);
            buffer.unmap();
            Ok::<_, Error>(())
        })?;
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("autosplats.upload") });
        for (piece, buffer) in pieces.iter().zip(&self.buffers) {
            encoder.copy_buffer_to_buffer(buffer, 0, piece.to, (piece.at * point_bytes) as u64, bytes_of(piece));
        }
        self.submitted = Some(gpu.queue.submit([encoder.finish()]));
        Ok(())
    }
}

/// The progress of an upload.
struct Done<'a> {
    points: usize,
    of: usize,
    report: &'a dyn Fn(f32) -> bool,
}

impl<'a> Done<'a> {
    fn new(written: &[Range<usize>], report: &'a dyn Fn(f32) -> bool) -> Self {
        Self { points: 0, of: written.iter().map(Range::len).sum(), report }
    }

    /// Reports that `points` more are done.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if the receiver returns false.
    fn add(&mut self, points: usize) -> Result<(), Error> {
        self.points += points;
        if (self.report)(self.points as f32 / self.of as f32) { Ok(()) } else { Err(Error::Cancelled) }
    }
}
