//! The device that draws the window. Where it is the one that renders, pictures stay on it.

use std::sync::Arc;

use autosplats::{Backend, Error, Image, Renderer, adapters};
use eframe::wgpu;

/// The device that draws the window.
#[derive(Clone, Debug)]
pub(crate) struct WindowDevice {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// Pixel format of the window.
    pub(crate) format: wgpu::TextureFormat,
}

/// The pixels of a picture for the window.
#[derive(Clone, Debug)]
pub(crate) enum Pixels {
    /// In memory.
    Image(Arc<Image>),
    /// On the device of the window, `supersample` times as many along each side as in the window's picture.
    Texture { texture: Arc<wgpu::Texture>, supersample: u32 },
}

impl Pixels {
    /// Whether they are the same picture.
    pub(crate) fn are(&self, others: &Self) -> bool {
        match (self, others) {
            (Self::Image(image), Self::Image(other)) => Arc::ptr_eq(image, other),
            (Self::Texture { texture, .. }, Self::Texture { texture: other, .. }) => Arc::ptr_eq(texture, other),
            _ => false,
        }
    }
}

impl WindowDevice {
    /// Whether the device is the one that a renderer on `backend` would choose.
    fn renders(&self, backend: Backend) -> bool {
        let own = self.device.adapter_info();
        let is_own = |best: &autosplats::AdapterSummary| {
            best.name == own.name
                && best.pci_bus_id == own.device_pci_bus_id
                && best.backend == format!("{:?}", own.backend)
        };
        match (backend, adapters().first()) {
            (Backend::Cpu, _) | (_, None) => false,
            (Backend::Auto, Some(best)) => !best.software && is_own(best),
            (Backend::Gpu, Some(best)) => is_own(best),
        }
    }

    /// A renderer on this device, if `backend` asks for one here and the device takes it.
    pub(super) fn renderer(&self, backend: Backend) -> Option<Renderer> {
        if !self.renders(backend) {
            return None;
        }
        Renderer::with_device(self.device.clone(), self.queue.clone()).ok()
    }

    /// Format of textures for the window. A window in sRGB converts linear values on output, so that its textures
    /// convert on input.
    pub(crate) fn texture_format(format: wgpu::TextureFormat) -> wgpu::TextureFormat {
        if format.is_srgb() { wgpu::TextureFormat::Rgba8UnormSrgb } else { wgpu::TextureFormat::Rgba8Unorm }
    }
}

/// Textures of pictures, used again once the window shows a newer one.
#[derive(Debug)]
pub(super) struct Textures {
    format: wgpu::TextureFormat,
    kept: Vec<Arc<wgpu::Texture>>,
}

impl Textures {
    pub(super) fn new(window: &WindowDevice) -> Self {
        Self { format: WindowDevice::texture_format(window.format), kept: Vec::new() }
    }

    /// A texture of this size that nothing else uses. Those of other sizes go once the window has let go of them.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`].
    pub(super) fn free(&mut self, renderer: &Renderer, size: [u32; 2]) -> Result<Arc<wgpu::Texture>, Error> {
        let is_free = |texture: &Arc<wgpu::Texture>| Arc::strong_count(texture) == 1;
        let fits = |texture: &Arc<wgpu::Texture>| [texture.width(), texture.height()] == size;
        if let Some(free) = self.kept.iter().find(|texture| is_free(texture) && fits(texture)) {
            return Ok(Arc::clone(free));
        }
        self.kept.retain(|texture| !is_free(texture));
        let new = Arc::new(renderer.texture(size, self.format)?);
        self.kept.push(Arc::clone(&new));
        Ok(new)
    }
}
