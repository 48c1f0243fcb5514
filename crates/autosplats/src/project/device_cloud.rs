//! A cloud on the device, in chunks where one binding cannot hold it, uploaded piece by piece.

use autosplats_cloud::{PointCloud, RelativeValues};
use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use crate::Error;
use crate::gpu::Gpu;

/// Points uploaded at a time.
const UPLOAD_PIECE_POINTS: usize = 1 << 18;
/// Number of staging buffers, each of one piece of positions. The host fills one while others are in transit.
const STAGING_BUFFER_COUNT: usize = 8;
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
                put(scalar.get(first + at).to_bits());
            }
        });
    }
}

/// A chunk of points, laid out as in `shared/project_point.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ChunkUniform {
    pub(crate) first: u32,
    pub(crate) len: u32,
    /// Words of values per point.
    pub(crate) values: u32,
    pub(crate) padding: u32,
}

/// A chunk of points in buffers of its own.
#[derive(Debug)]
pub(crate) struct Chunk {
    /// Number of points that fit.
    pub(crate) capacity: u32,
    pub(crate) uniform: wgpu::Buffer,
    pub(crate) positions: wgpu::Buffer,
    pub(crate) values: wgpu::Buffer,
}

/// A cloud's points on the device.
#[derive(Debug, Default)]
pub(crate) struct DeviceCloud {
    points: usize,
    /// Number of points that fit.
    capacity: usize,
    /// Words of values per point.
    words: usize,
    chunks: Vec<Chunk>,
}

impl DeviceCloud {
    /// The chunks, in the order of points.
    pub(crate) fn chunks(&self) -> &[Chunk] {
        &self.chunks
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

    /// Makes room for `points` points. Positions and values are lost unless the points [fit](Self::fits).
    ///
    /// # Errors
    /// [`Error::DeviceMemory`] if the device has no room; the cloud is then empty.
    pub(crate) fn resize(&mut self, gpu: &Gpu, points: usize) -> Result<(), Error> {
        if !self.fits(points) {
            // A cloud that has grown once is likely to grow again.
            let grown = if self.capacity > 0 && points > self.capacity { points + points / 4 } else { points };
            *self = Self::default();
            let mut chunks = Vec::new();
            let limits = gpu.device.limits();
            let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) as usize;
            let longest = most / size_of::<[f32; 3]>();
            for first in (0..grown).step_by(longest) {
                let capacity = longest.min(grown - first);
                let uniform = gpu.uniform::<ChunkUniform>("run of points")?;
                let positions = gpu.storage::<[f32; 3]>("positions", capacity)?;
                let values = gpu.storage::<u32>("values of points", 0)?;
                chunks.push(Chunk { capacity: capacity as u32, uniform, positions, values });
            }
            (self.capacity, self.chunks) = (grown, chunks);
        }
        self.points = points;
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

    /// Writes the uniform of each chunk.
    fn write_uniforms(&self, gpu: &Gpu) {
        let mut first = 0;
        for chunk in &self.chunks {
            let len = chunk.capacity.min((self.points - first) as u32);
            let told = ChunkUniform { first: first as u32, len, values: self.words as u32, padding: 0 };
            gpu.queue.write_buffer(&chunk.uniform, 0, bytemuck::bytes_of(&told));
            first += len as usize;
        }
    }
}

/// Copies clouds to the device through a ring of staging buffers, which bounds the memory in transit.
#[derive(Debug)]
pub(crate) struct Uploader {
    ring: Vec<Staging>,
    next: usize,
    packed: Vec<u32>,
}

/// A staging buffer.
#[derive(Debug)]
struct Staging {
    buffer: wgpu::Buffer,
    /// Submission that last copied from the buffer.
    submitted: Option<wgpu::SubmissionIndex>,
}

impl Uploader {
    pub(crate) fn new() -> Self {
        Self { ring: Vec::new(), next: 0, packed: Vec::new() }
    }

    /// Uploads positions.
    ///
    /// # Errors
    /// [`Error::DeviceLost`], [`Error::DeviceMemory`], and [`Error::Cancelled`] if `report` returns false; its
    /// argument is the fraction done.
    pub(crate) fn positions(
        &mut self,
        gpu: &Gpu,
        cloud: &PointCloud,
        to: &DeviceCloud,
        report: &dyn Fn(f32) -> bool,
    ) -> Result<(), Error> {
        let mut rest = cloud.positions();
        let mut done = 0;
        for chunk in &to.chunks {
            let (positions, after) = rest.split_at(rest.len().min(chunk.capacity as usize));
            rest = after;
            for (piece, positions) in positions.chunks(UPLOAD_PIECE_POINTS).enumerate() {
                let at = piece * UPLOAD_PIECE_POINTS * size_of::<[f32; 3]>();
                self.write(gpu, &chunk.positions, at, bytemuck::cast_slice(positions))?;
                done += positions.len();
                report_progress(report, done, to.points)?;
            }
        }
        gpu.check_lost()
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
        let mut first = 0;
        for chunk in to.chunks.iter().filter(|_| to.words > 0) {
            let len = (to.points - first).min(chunk.capacity as usize);
            for piece in (0..len).step_by(UPLOAD_PIECE_POINTS) {
                let points = UPLOAD_PIECE_POINTS.min(len - piece);
                let mut packed = std::mem::take(&mut self.packed);
                packed.resize(points * to.words, 0);
                values.pack(first + piece, &mut packed);
                self.write(gpu, &chunk.values, piece * to.words * 4, bytemuck::cast_slice(&packed))?;
                self.packed = packed;
                report_progress(report, first + piece + points, to.points)?;
            }
            first += len;
        }
        gpu.check_lost()
    }

    /// Copies up to a piece of bytes through the next staging buffer of the ring.
    fn write(&mut self, gpu: &Gpu, to: &wgpu::Buffer, at: usize, bytes: &[u8]) -> Result<(), Error> {
        let lost = || gpu.check_lost().err().unwrap_or_else(|| Error::DeviceLost("it takes no points".into()));
        if self.ring.len() < STAGING_BUFFER_COUNT {
            let usage = wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC;
            let size = (UPLOAD_PIECE_POINTS * size_of::<[f32; 3]>()) as u64;
            self.ring.push(Staging { buffer: gpu.buffer("staging", size, usage)?, submitted: None });
            self.next = self.ring.len() - 1;
        }
        let Staging { buffer, submitted } = &mut self.ring[self.next];
        self.next = (self.next + 1) % STAGING_BUFFER_COUNT;
        let size = bytes.len() as u64;
        // The next buffer is the oldest of the ring, so this waits only if the device is slower than the host.
        buffer.map_async(wgpu::MapMode::Write, 0..size, |_| {});
        let poll = match submitted.take() {
            Some(submitted) => wgpu::PollType::Wait { submission_index: Some(submitted), timeout: None },
            None => wgpu::PollType::Poll,
        };
        gpu.device.poll(poll).map_err(|_| lost())?;
        buffer.get_mapped_range_mut(0..size).map_err(|_| lost())?.copy_from_slice(bytes);
        buffer.unmap();
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("autosplats.upload") });
        encoder.copy_buffer_to_buffer(buffer, 0, to, at as u64, size);
        *submitted = Some(gpu.queue.submit([encoder.finish()]));
        Ok(())
    }
}

/// Reports the fraction done.
///
/// # Errors
/// [`Error::Cancelled`] if `report` returns false.
fn report_progress(report: &dyn Fn(f32) -> bool, done: usize, points: usize) -> Result<(), Error> {
    if report(done as f32 / points as f32) { Ok(()) } else { Err(Error::Cancelled) }
}
