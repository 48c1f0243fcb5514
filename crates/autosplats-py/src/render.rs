//! Renderers, and the devices that they run on.

use std::sync::{Mutex, MutexGuard, TryLockError};
use std::thread::sleep;
use std::time::Duration;

use autosplats::{BYTES_PER_PIXEL, Backend, Background, Settings, still_supersample};
use autosplats_cloud::{ErrorKind, check_memory};
use pyo3::prelude::*;

use crate::camera::{Fit, direction, parsed, shown};
use crate::cloud::{Cloud, named_axes};
use crate::errors::{self, Class, Failure};
use crate::picture::Frame;
use crate::wait::{Watch, run};

/// Time between two tries to get a renderer that another thread uses.
const TURN: Duration = Duration::from_millis(1);

/// A renderer, which one thread uses at a time.
#[pyclass(frozen, module = "autosplats._core")]
pub(crate) struct Renderer {
    renderer: Mutex<autosplats::Renderer>,
    /// The process that the device belongs to; None on the CPU.
    process: Option<u32>,
}

#[pymethods]
impl Renderer {
    /// A renderer on a backend, auto, cpu or gpu, or on a device by its index or its place on the PCI bus.
    #[new]
    fn new(py: Python<'_>, backend: &str, device: Option<&str>) -> PyResult<Self> {
        let backend = match backend {
            "auto" => Backend::Auto,
            "cpu" => Backend::Cpu,
            "gpu" => Backend::Gpu,
            _ => {
                let what = format!("backend is '{backend}', must be one of auto, cpu, gpu");
                return Err(errors::raise(Class::Argument, what));
            }
        };
        let renderer = py.detach(|| match device {
            Some(device) => autosplats::Renderer::with_adapter(device),
            None => autosplats::Renderer::with_backend(backend),
        });
        let renderer = renderer.map_err(|error| Failure::Render(error).raise())?;
        let process = renderer.adapter().map(|_| std::process::id());
        Ok(Self { renderer: Mutex::new(renderer), process })
    }

    /// Description of the device as JSON; None on the CPU.
    fn device(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let adapter = py.detach(|| self.renderer.lock().unwrap_or_else(|broken| broken.into_inner()).adapter());
        let adapter = adapter.as_ref().map(serde_json::to_string).transpose();
        adapter.map_err(|error| Failure::Fault(error.to_string()).raise())
    }

    /// Renders a picture of `size` (width, height) pixels, with `camera` or one that is fitted.
    #[pyo3(signature = (cloud, camera, view, axes, size, settings, color, supersample, threads, progress))]
    #[allow(clippy::too_many_arguments, reason = "only the package's own Python calls it")]
    fn render(
        &self,
        py: Python<'_>,
        cloud: &Cloud,
        camera: Option<&str>,
        view: &str,
        axes: Option<&str>,
        size: [u32; 2],
        settings: &str,
        color: &str,
        supersample: Option<u32>,
        threads: Option<usize>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Frame> {
        self.check_process()?;
        let settings = checked(settings, color)?;
        let axes = axes.map(named_axes).transpose()?;
        let camera = camera.map(parsed).transpose()?;
        let fit = Fit { own: cloud.camera, view: direction(view)?, axes, fov: None, orthographic: false };
        run(py, threads, progress, |watch| {
            let cloud = shown(&cloud.cloud, axes);
            let camera = camera.map_or_else(|| fit.place(&cloud, size), Ok)?;
            let settings = settings.for_points(&cloud);
            let usual = if settings.all_layers { 1 } else { still_supersample(size) };
            let mut renderer = self.turn(watch)?;
            let mut render = |factor: u32| {
                let rendered = size.map(|side| side.saturating_mul(factor));
                let [width, height] = rendered.map(u64::from);
                check_memory(&format!("a picture of {width}x{height}"), width * height * BYTES_PER_PIXEL)?;
                let frame = renderer.render_while(&cloud, &camera, rendered, &settings, &|| watch.goes_on())?;
                let is_transparent = settings.shading.background == Background::Transparent;
                Ok(Frame::new(&frame, factor, camera, settings.all_layers, is_transparent))
            };
            match render(supersample.unwrap_or(usual)) {
                // A device may lack the memory for supersampling by default; the picture is then rendered without.
                Err(Failure::Render(error)) if error.kind() == ErrorKind::Memory && supersample.is_none() => render(1),
                frame => frame,
            }
        })
    }

    /// Fixes what pictures of moving points share, by the first of them, rendered with `size` (width, height) pixels:
    /// the exposure, and the values at both ends of the colour map, if colours show values.
    #[pyo3(signature = (cloud, camera, axes, size, settings, color))]
    #[allow(clippy::too_many_arguments, reason = "only the package's own Python calls it")]
    fn settle(
        &self,
        py: Python<'_>,
        cloud: &Cloud,
        camera: &str,
        axes: Option<&str>,
        size: [u32; 2],
        settings: &str,
        color: &str,
    ) -> PyResult<(Option<f32>, Option<[f64; 2]>)> {
        self.check_process()?;
        let settings = checked(settings, color)?;
        let axes = axes.map(named_axes).transpose()?;
        let camera = parsed(camera)?;
        run(py, None, None, |watch| {
            let cloud = shown(&cloud.cloud, axes);
            let mut settings = settings.for_points(&cloud);
            self.turn(watch)?.settle(&mut settings, &*cloud, &camera, size, &|| watch.goes_on())?;
            Ok((settings.shading.exposure, settings.shading.range))
        })
    }
}

/// Settings of a text, with the colour mode of this name.
fn checked(settings: &str, color: &str) -> PyResult<Settings> {
    let mut settings: Settings =
        serde_json::from_str(settings).map_err(|error| errors::raise(Class::Argument, format!("settings: {error}")))?;
    settings.shading.color =
        color.parse().map_err(|error| errors::raise(Class::Argument, format!("color is '{color}', {error}")))?;
    settings.check().map_err(|error| Failure::Render(error).raise())?;
    Ok(settings)
}

impl Renderer {
    /// Fails if the device belongs to another process.
    fn check_process(&self) -> PyResult<()> {
        if self.process.is_none_or(|process| process == std::process::id()) {
            return Ok(());
        }
        let what = "this renderer's device belongs to the process that was forked; make a renderer in each process";
        Err(errors::raise(Class::Device, what.into()))
    }

    /// Waits until no other thread uses the renderer.
    fn turn(&self, watch: &Watch) -> Result<MutexGuard<'_, autosplats::Renderer>, Failure> {
        loop {
            match self.renderer.try_lock() {
                Ok(renderer) => return Ok(renderer),
                Err(TryLockError::Poisoned(broken)) => return Ok(broken.into_inner()),
                Err(TryLockError::WouldBlock) if watch.goes_on() => sleep(TURN),
                Err(TryLockError::WouldBlock) => return Err(Failure::Cancelled),
            }
        }
    }
}

/// Descriptions of all graphics devices as JSON, the best first.
#[pyfunction]
pub(crate) fn devices(py: Python<'_>) -> PyResult<String> {
    let adapters = py.detach(autosplats::adapters);
    serde_json::to_string(&adapters).map_err(|error| Failure::Fault(error.to_string()).raise())
}
