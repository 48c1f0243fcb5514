//! A cloud on the device: split where one binding cannot hold it, and uploaded piece by piece.

use std::num::NonZeroU64;

use autosplats_cloud::{FieldValues, PointCloud};
use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;
use wgpu::util::StagingBelt;

use crate::Error;
use crate::gpu::Gpu;

/// Points uploaded at a time.
const PIECE: usize = 1 << 18;
/// Bytes of a staging buffer: two pieces of positions.
const STAGING: u64 = 8 << 20;
/// Room is given back when less than one in so many points of it is used.
const LEAST_USED: usize = 4;
/// Bytes on their way to the device at a time: staging memory stays within twice that.
const IN_FLIGHT: u64 = 64 << 20;

/// Values that splats carry, per point.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PointValues<'a> {
    /// sRGB.
    pub(crate) colors: Option<&'a [[u8; 3]]>,
    pub(crate) scalar: Option<&'a FieldValues>,
}

impl PointValues<'_> {
    /// Words per point: a colour in the low three bytes of one, then the bits of a number.
    pub(crate) fn words(&self) -> usize {
        usize::from(self.colors.is_some()) + usize::from(self.scalar.is_some())
    }

    /// Packs the values of the points from index `first` on.
    fn pack(&self, first: usize, out: &mut [u32]) {
        let words = self.words();
        out.par_chunks_mut(words).enumerate().with_min_len(1 << 12).for_each(|(at, out)| {
            let mut out = out.iter_mut();
            let mut put = |word: u32| out.next().map(|out| *out = word).unwrap_or_default();
            if let Some([r, g, b]) = self.colors.map(|colors| colors[first + at]) {
                put(u32::from_le_bytes([r, g, b, 0]));
            }
            if let Some(scalar) = self.scalar {
                put((scalar.get(first + at) as f32).to_bits());
            }
        });
    }
}

/// A run of points, as `shared/project_point.wgsl` has it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ChunkUniform {
    pub(crate) first: u32,
    pub(crate) len: u32,
    /// Words of values per point.
    pub(crate) values: u32,
    pub(crate) padding: u32,
}

/// A run of points in buffers of its own.
#[derive(Debug)]
pub(crate) struct Chunk {
    /// Points there is room for.
    pub(crate) capacity: u32,
    pub(crate) uniform: wgpu::Buffer,
    pub(crate) positions: wgpu::Buffer,
    pub(crate) values: wgpu::Buffer,
}

/// A cloud's points on the device.
#[derive(Debug, Default)]
pub(crate) struct DeviceCloud {
    points: usize,
    /// Points there is room for.
    capacity: usize,
    /// Words of values per point.
    words: usize,
    chunks: Vec<Chunk>,
}

impl DeviceCloud {
    /// Runs of points, in order.
    pub(crate) fn chunks(&self) -> &[Chunk] {
        &self.chunks
    }

    /// Points there is room for.
    pub(crate) fn capacity(&self) -> usize {
        self.capacity
    }

    /// Words of values per point.
    pub(crate) fn words(&self) -> usize {
        self.words
    }

    /// Makes room for `points` points with `words` words of values each, and says whether buffers had to be made anew,
    /// which a cloud of about the size of the one before does without.
    ///
    /// # Errors
    /// [`Error::DeviceMemory`] if the device has no room.
    pub(crate) fn resize(&mut self, gpu: &Gpu, points: usize, words: usize) -> Result<bool, Error> {
        let fits = words == self.words && points <= self.capacity && points >= self.capacity / LEAST_USED;
        if !fits {
            // A cloud that has grown once will grow again.
            let grown = if self.capacity > 0 && points > self.capacity { points + points / 4 } else { points };
            *self = Self::default();
            let limits = gpu.device.limits();
            let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) as usize;
            let longest = most / size_of::<[f32; 3]>();
            for first in (0..grown).step_by(longest) {
                let capacity = longest.min(grown - first);
                let uniform = gpu.uniform::<ChunkUniform>("run of points")?;
                let positions = gpu.storage::<[f32; 3]>("positions", capacity)?;
                let values = gpu.storage::<u32>("values of points", capacity * words)?;
                self.chunks.push(Chunk { capacity: capacity as u32, uniform, positions, values });
            }
            (self.capacity, self.words) = (grown, words);
        }
        self.points = points;
        let mut first = 0;
        for chunk in &self.chunks {
            let len = chunk.capacity.min((points - first) as u32);
            let told = ChunkUniform { first: first as u32, len, values: words as u32, padding: 0 };
            gpu.queue.write_buffer(&chunk.uniform, 0, bytemuck::bytes_of(&told));
            first += len as usize;
        }
        Ok(!fits)
    }
}

/// Copies clouds to the device, through staging buffers that are used again and again.
#[derive(Debug)]
pub(crate) struct Uploader {
    belt: StagingBelt,
    packed: Vec<u32>,
}

impl Uploader {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { belt: StagingBelt::new(gpu.device.clone(), STAGING), packed: Vec::new() }
    }

    /// Uploads positions.
    ///
    /// # Errors
    /// [`Error::DeviceLost`], and [`Error::Cancelled`] if `report`, told the fraction done, says no.
    pub(crate) fn positions(
        &mut self,
        gpu: &Gpu,
        cloud: &PointCloud,
        to: &DeviceCloud,
        report: &dyn Fn(f32) -> bool,
    ) -> Result<(), Error> {
        let mut upload = Upload::new(gpu, &mut self.belt, to.points, report);
        let mut rest = cloud.positions();
        for chunk in &to.chunks {
            let (positions, after) = rest.split_at(rest.len().min(chunk.capacity as usize));
            rest = after;
            for (piece, positions) in positions.chunks(PIECE).enumerate() {
                let at = piece * PIECE * size_of::<[f32; 3]>();
                upload.write(&chunk.positions, at, bytemuck::cast_slice(positions), positions.len())?;
            }
        }
        upload.finish()
    }

    /// Uploads values.
    ///
    /// # Errors
    /// Those of [`positions`](Self::positions).
    pub(crate) fn values(
        &mut self,
        gpu: &Gpu,
        values: &PointValues<'_>,
        to: &DeviceCloud,
        report: &dyn Fn(f32) -> bool,
    ) -> Result<(), Error> {
        let mut upload = Upload::new(gpu, &mut self.belt, to.points, report);
        let mut first = 0;
        for chunk in to.chunks.iter().filter(|_| to.words > 0) {
            let len = (to.points - first).min(chunk.capacity as usize);
            for piece in (0..len).step_by(PIECE) {
                let points = PIECE.min(len - piece);
                self.packed.resize(points * to.words, 0);
                values.pack(first + piece, &mut self.packed);
                upload.write(&chunk.values, piece * to.words * 4, bytemuck::cast_slice(&self.packed), points)?;
            }
            first += len;
        }
        upload.finish()
    }
}

/// One upload in progress.
struct Upload<'a> {
    gpu: &'a Gpu,
    belt: &'a mut StagingBelt,
    encoder: wgpu::CommandEncoder,
    /// Bytes written since the last submission.
    written: u64,
    before: Option<wgpu::SubmissionIndex>,
    points: usize,
    done: usize,
    report: &'a dyn Fn(f32) -> bool,
}

impl<'a> Upload<'a> {
    fn new(gpu: &'a Gpu, belt: &'a mut StagingBelt, points: usize, report: &'a dyn Fn(f32) -> bool) -> Self {
        let encoder = encoder(gpu);
        Self { gpu, belt, encoder, written: 0, before: None, points, done: 0, report }
    }

    fn write(&mut self, to: &wgpu::Buffer, at: usize, bytes: &[u8], points: usize) -> Result<(), Error> {
        let Some(size) = NonZeroU64::new(bytes.len() as u64) else { return Ok(()) };
        self.belt.write_buffer(&mut self.encoder, to, at as u64, size).copy_from_slice(bytes);
        self.written += size.get();
        self.done += points;
        if self.written >= IN_FLIGHT {
            let submitted = self.submit();
            // The submission before this one is probably done; waiting for it bounds what is in flight.
            if let Some(before) = self.before.replace(submitted) {
                let poll = wgpu::PollType::Wait { submission_index: Some(before), timeout: None };
                self.gpu.device.poll(poll).map_err(|error| Error::DeviceLost(error.to_string()))?;
            }
            if !(self.report)(self.done as f32 / self.points as f32) {
                return Err(Error::Cancelled);
            }
        }
        Ok(())
    }

    fn submit(&mut self) -> wgpu::SubmissionIndex {
        self.written = 0;
        self.belt.finish();
        let commands = std::mem::replace(&mut self.encoder, encoder(self.gpu)).finish();
        let submitted = self.gpu.queue.submit([commands]);
        self.belt.recall();
        submitted
    }

    fn finish(mut self) -> Result<(), Error> {
        self.submit();
        self.gpu.check_lost()
    }
}

fn encoder(gpu: &Gpu) -> wgpu::CommandEncoder {
    gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("autosplats.upload") })
}
