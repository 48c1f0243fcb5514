//! The renderer of the pictures, by the backend that the user chose.

use std::sync::Arc;

use autosplats::cloud::PointCloud;
use autosplats::{Backend, Camera, Error, Frame, Renderer, Settings};
use eframe::wgpu;

use super::window_device::{Textures, WindowDevice};

/// The renderer of the pictures.
pub(super) struct Chosen {
    pub(super) backend: Backend,
    renderer: Renderer,
    /// Textures that the window shows, if it is drawn by the same device.
    textures: Option<Textures>,
}

impl Chosen {
    /// A renderer on `backend`, on the device of the window if that is the one.
    pub(super) fn new(backend: Backend, window: Option<&WindowDevice>) -> Result<Self, Error> {
        let windows = window.and_then(|window| Some((window.renderer(backend)?, Textures::new(window))));
        let (renderer, textures) = match windows {
            Some((renderer, textures)) => (renderer, Some(textures)),
            None => (Renderer::with_backend(backend)?, None),
        };
        Ok(Self { backend, renderer, textures })
    }

    /// Whether the device is that of the window.
    pub(super) fn is_of_window(&self) -> bool {
        self.textures.is_some()
    }

    /// The renderer. A window on the same device is drawn while a picture is in work.
    pub(super) fn renderer(&mut self) -> &mut Renderer {
        self.renderer.take_turns(self.is_of_window());
        &mut self.renderer
    }

    /// A texture for a picture of `size` in the window; `None` if the window needs it in memory.
    pub(super) fn texture(&mut self, size: [u32; 2]) -> Result<Option<Arc<wgpu::Texture>>, Error> {
        let Self { renderer, textures, .. } = self;
        textures.as_mut().map(|textures| textures.free(renderer, size)).transpose()
    }

    /// Renders a picture of `size` into a texture of that size, or into memory. With `turns`, a window on the same
    /// device is drawn in between.
    pub(super) fn render(
        &mut self,
        (cloud, camera): (&PointCloud, &Camera),
        (size, texture): ([u32; 2], Option<&wgpu::Texture>),
        settings: &Settings,
        turns: bool,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Frame<'_>, Error> {
        let Self { renderer, textures, .. } = self;
        renderer.take_turns(turns && textures.is_some());
        match texture {
            Some(texture) => renderer.render_to_texture_while(cloud, camera, texture, settings, go_on),
            None => renderer.render_while(cloud, camera, size, settings, go_on),
        }
    }
}

/// What was made; `None` if it is too large for the device.
pub(super) fn unless_too_large<T>(made: Result<T, Error>) -> Result<Option<T>, Error> {
    match made {
        Err(Error::DeviceLimit { .. } | Error::DeviceMemory(_)) => Ok(None),
        made => made.map(Some),
    }
}
