//! Where a renderer runs.

use super::gpu::GpuRenderer;
use super::{BackendRenderer, Renderer};
use crate::Error;
use crate::gpu::{AdapterSummary, Gpu, StageWork};

impl Renderer {
    /// Creates a renderer on the device that `which` names: by its index in [`adapters`](crate::adapters), or by its
    /// place on the PCI bus, such as `0000:3b:00.0`. On a machine of several devices each process can use its own.
    ///
    /// # Errors
    /// [`Error::Device`] if there is no such device, which lists those that are there, or it does not start;
    /// [`Error::DeviceMemory`].
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats::{Error, Renderer};
    ///
    /// assert!(matches!(Renderer::with_adapter("99"), Err(Error::Device(_))));
    /// ```
    pub fn with_adapter(which: &str) -> Result<Self, Error> {
        Ok(Self::from(BackendRenderer::Gpu(Box::new(GpuRenderer::new(Gpu::named(which)?)?))))
    }

    /// Creates another renderer in the same place: on the CPU, or on the same device. On a device the two share the
    /// compute passes compiled so far, so the second one starts sooner. Each keeps its own points and buffers.
    ///
    /// # Errors
    /// [`Error::DeviceMemory`], [`Error::DeviceLost`].
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats::Renderer;
    ///
    /// let front = Renderer::new();
    /// let top = front.another()?;
    /// assert!(top.adapter().is_none(), "on the CPU, as the first one");
    /// # Ok::<(), autosplats::Error>(())
    /// ```
    pub fn another(&self) -> Result<Self, Error> {
        match &self.form {
            BackendRenderer::Cpu(_) => Ok(Self::new()),
            BackendRenderer::Gpu(renderer) => {
                Ok(Self::from(BackendRenderer::Gpu(Box::new(GpuRenderer::new(renderer.device().clone())?))))
            }
        }
    }

    /// Says whether [`Frame::passes`](super::Frame::passes) has each pass of a GPU by itself. Such frames take longer,
    /// because the device then finishes each pass before it begins the next. Default: no.
    ///
    /// # Examples
    ///
    /// ```
    /// let mut renderer = autosplats::Renderer::new();
    /// renderer.time_passes(true);
    /// ```
    pub fn time_passes(&mut self, each: bool) {
        if let BackendRenderer::Gpu(renderer) = &mut self.form {
            renderer.time_passes(each);
        }
    }

    /// Says whether others have turns on the device while a frame is in work, such as a window that shares it. Each
    /// stage is then submitted by itself and waited for, so that none of their work waits for a whole frame. Frames
    /// that return before they are done take no turns. Default: no.
    ///
    /// # Examples
    ///
    /// ```
    /// let mut renderer = autosplats::Renderer::new();
    /// renderer.take_turns(true);
    /// ```
    pub fn take_turns(&mut self, take: bool) {
        if let BackendRenderer::Gpu(renderer) = &mut self.form {
            renderer.take_turns(take);
        }
    }

    /// What each stage of the last frame asks of a GPU: dispatches, their longest chain, bytes. `None` on the CPU, and
    /// before the first frame.
    ///
    /// # Examples
    ///
    /// ```
    /// assert_eq!(autosplats::Renderer::new().stage_work(), None);
    /// ```
    pub fn stage_work(&self) -> Option<Vec<StageWork>> {
        match &self.form {
            BackendRenderer::Cpu(_) => None,
            BackendRenderer::Gpu(renderer) => renderer.stage_work(),
        }
    }

    /// The device that renders; `None` on the CPU.
    pub fn adapter(&self) -> Option<AdapterSummary> {
        match &self.form {
            BackendRenderer::Cpu(_) => None,
            BackendRenderer::Gpu(renderer) => Some(renderer.adapter()),
        }
    }
}
