//! Buffers: made within the device's limits, and read back.

use wgpu::BufferUsages;

use super::Gpu;
use crate::Error;

impl Gpu {
    /// A storage buffer of `len` values of type `T`, at least one; it can be copied to and from.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`] if the device binds no buffer so large, [`Error::DeviceMemory`] if it has no room.
    pub(crate) fn storage<T>(&self, label: &'static str, len: usize) -> Result<wgpu::Buffer, Error> {
        // None may be empty; shaders take the length of an array from the size.
        let size = (len.max(1) * size_of::<T>()) as u64;
        let limits = self.device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
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

    /// A buffer of any kind.
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

    /// A storage buffer with these values.
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

/// A buffer that the host can read, kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Readback {
    buffer: Option<wgpu::Buffer>,
}

impl Readback {
    /// A buffer of at least `size` bytes to copy into.
    ///
    /// # Errors
    /// [`Error::DeviceMemory`] if the device has no room.
    pub(crate) fn room(&mut self, gpu: &Gpu, size: u64) -> Result<&wgpu::Buffer, Error> {
        if self.buffer.as_ref().is_none_or(|buffer| buffer.size() < size) {
            self.buffer = None;
            let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
            self.buffer = Some(gpu.buffer("autosplats.readback", size.next_multiple_of(16), usage)?);
        }
        self.buffer.as_ref().ok_or(Error::DeviceMemory(None))
    }

    /// Hands the first `size` bytes to `take`, once the device has done all that was submitted.
    ///
    /// # Errors
    /// [`Error::DeviceLost`].
    pub(crate) fn read<T>(&self, gpu: &Gpu, size: u64, take: impl FnOnce(&[u8]) -> T) -> Result<T, Error> {
        let lost = || Error::DeviceLost("it does not answer".into());
        let buffer = self.buffer.as_ref().ok_or_else(lost)?;
        map(gpu, buffer, size, take)
    }
}

/// Hands the first `size` bytes of a mappable buffer to `take`.
pub(super) fn map<T>(gpu: &Gpu, buffer: &wgpu::Buffer, size: u64, take: impl FnOnce(&[u8]) -> T) -> Result<T, Error> {
    let lost = || gpu.check_lost().err().unwrap_or_else(|| Error::DeviceLost("it does not answer".into()));
    buffer.map_async(wgpu::MapMode::Read, 0..size, |_| {});
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|_| lost())?;
    let taken = take(&buffer.get_mapped_range(0..size).map_err(|_| lost())?);
    buffer.unmap();
    Ok(taken)
}

/// Waits for all that was submitted and returns the first `len` values of a storage buffer: for tests.
///
/// # Errors
/// [`Error::DeviceMemory`], [`Error::DeviceLost`].
#[cfg(test)]
pub(crate) fn read_back<T: bytemuck::Pod>(gpu: &Gpu, buffer: &wgpu::Buffer, len: usize) -> Result<Vec<T>, Error> {
    let size = (len * size_of::<T>()) as u64;
    if size == 0 {
        return Ok(Vec::new());
    }
    let mut readback = Readback::default();
    let room = readback.room(gpu, size.next_multiple_of(4))?;
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, room, 0, size.next_multiple_of(4));
    gpu.queue.submit([encoder.finish()]);
    readback.read(gpu, size.next_multiple_of(4), |bytes| bytemuck::pod_collect_to_vec(&bytes[..size as usize]))
}
