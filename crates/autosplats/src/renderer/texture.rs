//! Pictures in textures, which stay on the device.

use super::{BackendRenderer, Frame, Renderer, Settings};
use crate::Error;
use crate::camera::Camera;
use crate::points::Points;
use crate::shade::gpu::check_texture;

/// Where a picture goes.
#[derive(Clone, Copy, Debug)]
pub(super) enum Destination<'a> {
    /// To the host, with this width and height in pixels.
    Memory([u32; 2]),
    /// To a whole texture of the renderer's device.
    Texture(&'a wgpu::Texture),
}

impl Destination<'_> {
    /// Width and height in pixels.
    ///
    /// # Errors
    /// [`Error::Texture`] if the texture takes no picture.
    pub(super) fn checked_size(self) -> Result<[u32; 2], Error> {
        match self {
            Self::Memory(size) => Ok(size),
            Self::Texture(texture) => {
                let size = [texture.width(), texture.height()];
                check_texture(texture, size).map(|()| size)
            }
        }
    }

    pub(super) fn format(self) -> Option<wgpu::TextureFormat> {
        match self {
            Self::Memory(_) => None,
            Self::Texture(texture) => Some(texture.format()),
        }
    }
}

impl Renderer {
    /// Creates a texture of `size` (width, height) pixels on this renderer's device, which
    /// [`render_to_texture`](Self::render_to_texture) takes, and which can be read by shaders and copied.
    ///
    /// # Errors
    /// [`Error::DeviceLimit`], [`Error::DeviceMemory`] and [`Error::DeviceLost`]; [`Error::Device`] if this renderer
    /// runs on the CPU.
    pub fn texture(&self, size: [u32; 2], format: wgpu::TextureFormat) -> Result<wgpu::Texture, Error> {
        let BackendRenderer::Gpu(renderer) = &self.form else { return Err(no_textures()) };
        let usages =
            [wgpu::TextureUsages::COPY_DST, wgpu::TextureUsages::COPY_SRC, wgpu::TextureUsages::TEXTURE_BINDING];
        let usage = usages.into_iter().collect();
        renderer.device().texture("autosplats.picture", size, format, usage)
    }

    /// Renders into a whole texture without waiting for the device. The texture must be made by this renderer's device,
    /// in format `Rgba8Unorm`, `Bgra8Unorm` or one of their `Srgb` forms, with usage `COPY_DST`. No legend is drawn.
    ///
    /// # Errors
    /// Those of [`render`](Self::render); [`Error::Texture`] if the texture is unsuitable; [`Error::Device`] if this
    /// renderer runs on the CPU.
    ///
    /// # Examples
    ///
    /// ```no_run
    /// use autosplats::{Error, Renderer, Settings, wgpu};
    /// # use autosplats::{Camera, cloud::PointCloud};
    ///
    /// /// The texture has format `Rgba8Unorm` and usages `COPY_DST` and `TEXTURE_BINDING`.
    /// fn draw(
    ///     renderer: &mut Renderer,
    ///     cloud: &PointCloud,
    ///     camera: &Camera,
    ///     texture: &wgpu::Texture,
    /// ) -> Result<(), Error> {
    ///     renderer.render_to_texture(cloud, camera, texture, &Settings::default())
    /// }
    /// ```
    pub fn render_to_texture<'a>(
        &mut self,
        points: impl Into<Points<'a>>,
        camera: &Camera,
        texture: &wgpu::Texture,
        settings: &Settings,
    ) -> Result<(), Error> {
        match &mut self.form {
            BackendRenderer::Cpu(_) => Err(no_textures()),
            BackendRenderer::Gpu(renderer) => {
                let (points, scaling) = (points.into(), &mut self.scaling);
                scaling.choose(points, Some(camera));
                let (camera, settings) = (scaling.camera(camera), scaling.settings(settings));
                renderer.render_to_texture(scaling.points(points), &camera, texture, &settings, scaling.unit())
            }
        }
    }

    /// [Renders into a texture](Self::render_to_texture), waits for the device and tells what the picture has. The
    /// frame's image is empty. `go_on` is as in [`render_while`](Self::render_while).
    ///
    /// # Errors
    /// Those of [`render_to_texture`](Self::render_to_texture), and [`Error::Cancelled`] if `go_on` returned false.
    pub fn render_to_texture_while<'a>(
        &mut self,
        points: impl Into<Points<'a>>,
        camera: &Camera,
        texture: &wgpu::Texture,
        settings: &Settings,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Frame<'_>, Error> {
        if !go_on() {
            return Err(Error::Cancelled);
        }
        let Self { form: BackendRenderer::Gpu(renderer), scaling } = self else { return Err(no_textures()) };
        let points = points.into();
        scaling.choose(points, Some(camera));
        let (camera, settings) = (scaling.camera(camera), scaling.settings(settings));
        let (shown, destination) = (scaling.points(points), Destination::Texture(texture));
        let frame = renderer.render(shown, &camera, destination, &settings, scaling.unit(), go_on)?;
        Ok(scaling.frame(frame))
    }
}

fn no_textures() -> Error {
    Error::Device("a texture can only be rendered into on a GPU".into())
}
