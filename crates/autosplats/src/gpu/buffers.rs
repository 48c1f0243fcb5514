//! Buffers: creation within the device's limits, and readback.

use wgpu::BufferUsages;

use super::Gpu;
use crate::Error;

/// Alignment of the parts of a readback, bytes.
const PART_ALIGNMENT_BYTES: u64 = 16;
/// Largest ratio of a readback's buffer to the needed size. A larger buffer is replaced.
const MOST_WASTE: u64 = 4;

impl Gpu {
    /// Whether a storage buffer may have `len` values of type `T`.
    pub(crate) fn binds<T>(&self, len: usize) -> bool {
        (len * size_of::<T>()) as u64 <= self.most_bound()
    }

    /// Bytes of the largest buffer that the device binds.
    pub(crate) fn most_bound(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// A storage buffer of `len` values of type `T`, at least one; it can be copied to and from.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`] if the device binds no buffer so large, [`Error::DeviceMemory`] if it has no room.
    pub(crate) fn storage<T>(&self, label: &'static str, len: usize) -> Result<wgpu::Buffer, Error> {
        // No binding may be empty. Shaders take an array's length from the size.
        let size = (len.max(1) * size_of::<T>()) as u64;
        let most = self.most_bound();
        if size > most {
            return Err(Error::DeviceLimit { what: label, needed: size, allowed: most });
        }
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        self.buffer(label, size, usage)
    }

    /// A uniform buffer for one `T`.
    ///
    /// # Errors
    /// [`Error::DeviceMemory`] if the device has no room.
    pub(crate) fn uniform<T>(&self, label: &'static str) -> Result<wgpu::Buffer, Error> {
        let size = size_of::<T>().next_multiple_of(16) as u64;
        self.buffer(label, size, BufferUsages::UNIFORM | BufferUsages::COPY_DST)
    }

    /// A texture of this size that passes draw into and load from.
    ///
    /// # Errors
    /// [`Error::DeviceMemory`] if the device has no room.
    pub(crate) fn target(
        &self,
        label: &'static str,
        size: [u32; 2],
        format: wgpu::TextureFormat,
    ) -> Result<wgpu::TextureView, Error> {
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
        let texture = self.texture(label, size, format, usage)?;
        Ok(texture.create_view(&wgpu::TextureViewDescriptor { label: Some(label), ..Default::default() }))
    }

    /// A flat texture with any usage.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`] if the device has none so large, [`Error::DeviceMemory`] if it has no room.
    pub(crate) fn texture(
        &self,
        label: &'static str,
        [width, height]: [u32; 2],
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> Result<wgpu::Texture, Error> {
        let (needed, allowed) = (width.max(height), self.device.limits().max_texture_dimension_2d);
        if needed > allowed {
            return Err(Error::DeviceLimit {
                what: "a side of a texture",
                needed: needed.into(),
                allowed: allowed.into(),
            });
        }
        self.checked(|| {
            self.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            })
        })
    }

    /// A buffer with any usage.
    ///
    /// # Errors
    /// [`Error::DeviceMemory`] if the device has no room.
    pub(crate) fn buffer(&self, label: &'static str, size: u64, usage: BufferUsages) -> Result<wgpu::Buffer, Error> {
        let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.checked(|| self.device.create_buffer(&descriptor)).map_err(|error| match error {
            Error::DeviceMemory(_) => Error::DeviceMemory(Some(size)),
            other => other,
        })
    }
}

#[cfg(test)]
impl Gpu {
    /// A storage buffer with these values, for tests.
    ///
    /// # Errors
    /// Those of [`storage`](Self::storage).
    pub(crate) fn storage_with<T: bytemuck::Pod>(
        &self,
        label: &'static str,
        values: &[T],
    ) -> Result<wgpu::Buffer, Error> {
        let buffer = self.storage::<T>(label, values.len())?;
        self.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(values));
        Ok(buffer)
    }
}

/// Reads the results of a frame, through a buffer kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Readback {
    buffer: Option<wgpu::Buffer>,
    /// Bytes of each part.
    parts: Vec<u64>,
}

impl Readback {
    /// Records copies of whole buffers.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`] if the device has no buffer so large, [`Error::DeviceMemory`] if it has no room.
    pub(crate) fn copy(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        from: &[&wgpu::Buffer],
    ) -> Result<(), Error> {
        self.parts.clear();
        self.parts.extend(from.iter().map(|buffer| buffer.size()));
        let size = self.parts.iter().map(|part| part.next_multiple_of(PART_ALIGNMENT_BYTES)).sum();
        let most = gpu.device.limits().max_buffer_size;
        if size > most {
            return Err(Error::DeviceLimit { what: "reading the picture back", needed: size, allowed: most });
        }
        let fits = |buffer: &wgpu::Buffer| (size..=MOST_WASTE * size).contains(&buffer.size());
        let buffer = match self.buffer.take().filter(fits) {
            Some(buffer) => buffer,
            None => gpu.buffer("readback", size, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?,
        };
        let mut at = 0;
        for part in from {
            encoder.copy_buffer_to_buffer(part, 0, &buffer, at, part.size());
            at += part.size().next_multiple_of(PART_ALIGNMENT_BYTES);
        }
        self.buffer = Some(buffer);
        Ok(())
    }

    /// Waits for all submitted work, then passes the copied bytes to `take`, one part per buffer.
    ///
    /// # Errors
    /// [`Error::DeviceLost`].
    pub(crate) fn read<T>(&self, gpu: &Gpu, take: impl FnOnce(&[&[u8]]) -> T) -> Result<T, Error> {
        let lost = || Error::DeviceLost("there is nothing to read".into());
        let buffer = self.buffer.as_ref().ok_or_else(lost)?;
        let size = self.parts.iter().map(|part| part.next_multiple_of(PART_ALIGNMENT_BYTES)).sum();
        map(gpu, buffer, size, |mut bytes| {
            let mut parts = Vec::with_capacity(self.parts.len());
            for &len in &self.parts {
                let (part, rest) = bytes.split_at(len.next_multiple_of(PART_ALIGNMENT_BYTES) as usize);
                parts.push(&part[..len as usize]);
                bytes = rest;
            }
            take(&parts)
        })
    }
}

/// Passes the first `size` bytes of a mappable buffer to `take`.
pub(super) fn map<T>(gpu: &Gpu, buffer: &wgpu::Buffer, size: u64, take: impl FnOnce(&[u8]) -> T) -> Result<T, Error> {
    let lost = || gpu.check_lost().err().unwrap_or_else(|| Error::DeviceLost("it does not answer".into()));
    buffer.map_async(wgpu::MapMode::Read, 0..size, |_| {});
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|_| lost())?;
    let taken = take(&buffer.get_mapped_range(0..size).map_err(|_| lost())?);
    buffer.unmap();
    Ok(taken)
}

/// Waits for all submitted work and returns the first `len` values of a storage buffer, for tests.
///
/// # Errors
/// [`Error::DeviceMemory`], [`Error::DeviceLost`].
#[cfg(test)]
pub(crate) fn read_back<T: bytemuck::Pod>(gpu: &Gpu, buffer: &wgpu::Buffer, len: usize) -> Result<Vec<T>, Error> {
    let mut readback = Readback::default();
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    readback.copy(gpu, &mut encoder, &[buffer])?;
    gpu.queue.submit([encoder.finish()]);
    readback.read(gpu, |parts| bytemuck::pod_collect_to_vec(&parts[0][..len * size_of::<T>()]))
}
