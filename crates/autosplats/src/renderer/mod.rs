//! Frames of a cloud on the CPU or a GPU.

mod attributes;
mod checks;
mod cpu;
mod devices;
mod exposure;
mod first_radius;
mod frame;
mod gpu;
mod layers;
mod rules;
mod scaling;
mod settings;
mod settle;
mod still;
mod surfels;
mod texture;
mod upward;

use autosplats_cloud::PointCloud;

use self::cpu::{CpuRenderer, check_engine};
use self::gpu::GpuRenderer;
use self::scaling::Scaling;
use crate::Error;
use crate::camera::Camera;
use crate::fit::GivenPlanes;
use crate::gpu::{Gpu, PassTime};
use crate::normals::Normals;
use crate::points::Points;
use crate::shade::Image;
use crate::splat::GBuffer;

pub use exposure::usual_exposure;
pub use first_radius::{RadiusTrial, best_first_radius};
pub use layers::shade_layers;
pub use settings::{Reconstruction, Settings};
pub use still::{BYTES_PER_PIXEL, still_supersample};
pub use surfels::PointSurfel;

/// Numbers of points of one frame, by what became of them. All except `covered` and `value_range` include the margin
/// around the picture, if there is one.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Counts {
    /// Points in the cloud, or in the chosen nodes of a pool.
    pub points: usize,
    /// Points that cannot be seen: the sum of `not_finite`, `behind` and `outside`.
    pub dropped: usize,
    /// Points with a coordinate that is NaN or infinite.
    pub not_finite: usize,
    /// Points at or behind the eye.
    pub behind: usize,
    /// Points outside the picture and its margin.
    pub outside: usize,
    /// Points that own a pixel, or half of one, in the picture or its margin because they are the nearest there. The
    /// remaining points are hidden behind them.
    pub visible: usize,
    /// Visible points reconstructed in the first round.
    pub active: usize,
    /// Visible points that are postponed by grid culling, or that are too far out in the margin to be more than
    /// neighbours.
    pub passive: usize,
    /// Passive points that the first round left visible and the second round reconstructed.
    pub recovered: usize,
    /// Points discarded because they have no neighbours or do not belong to the surface of their neighbours.
    pub outliers: usize,
    /// Points with fewer than k neighbours because of a gap or the bound on search work.
    pub clamped: usize,
    /// Points whose search reached the bound on its work.
    pub bounded: usize,
    /// Pixels that show a surface.
    pub covered: usize,
    /// Values at the two ends of the colour map, given or found in the picture; `None` if the colour mode has no map.
    pub value_range: Option<[f64; 2]>,
}

/// Milliseconds spent in each stage of one frame. On a GPU, the time of a stage includes that between its successive
/// passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[allow(missing_docs, reason = "one field per stage")]
pub struct Timings {
    /// Copying the points to the device, unless they are there already; not part of `frame`.
    pub upload: f64,
    pub project: f64,
    pub search: f64,
    pub fit: f64,
    pub adapt: f64,
    pub splat: f64,
    pub shade: f64,
    /// From the start of the first stage to the end of the last. With timestamps, reading the picture back from a
    /// device is not part of it.
    pub frame: f64,
}

/// Where frames are rendered. Pictures of the CPU and a GPU differ at most by a step of brightness in a few places.
///
/// # Examples
///
/// ```
/// use autosplats::{Backend, Renderer};
///
/// let renderer = Renderer::with_backend(Backend::Cpu)?;
/// assert!(renderer.adapter().is_none());
/// # Ok::<(), autosplats::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Backend {
    /// A hardware GPU if there is one, else the CPU.
    #[default]
    Auto,
    /// The CPU, on all threads of the current rayon pool; needs no driver.
    Cpu,
    /// The best device that wgpu finds, including software devices.
    Gpu,
}

/// Renders clouds into pictures. A renderer keeps its buffers, so that frames after the first allocate very little; of
/// a cloud much larger than 1e7 units or smaller than 1e-7 it keeps a copy.
///
/// # Examples
///
/// ```
/// use autosplats::{Camera, Projection, Renderer, Settings, ViewDirection, guess_axes};
/// use autosplats_scenes::Scene;
///
/// let (scene, count) = Scene::parse("figure:4K")?;
/// let cloud = scene.sample(count, &())?;
/// let (axes, projection) = (guess_axes(&cloud), Projection::PerspectiveFovDeg(40.0));
/// let camera = Camera::fit(&cloud, axes, ViewDirection::Front, 4.0 / 3.0, projection)?;
/// let mut renderer = Renderer::new();
/// let frame = renderer.render(&cloud, &camera, [64, 48], &Settings::default())?;
/// assert_eq!(frame.image.pixels.len(), 64 * 48);
/// assert_eq!(frame.counts.points, 4000);
/// assert!(frame.counts.covered > 100);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Renderer {
    form: BackendRenderer,
    scaling: Scaling,
}

#[derive(Debug)]
enum BackendRenderer {
    Cpu(Box<CpuRenderer>),
    Gpu(Box<GpuRenderer>),
}

/// A picture and its statistics.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// The picture; empty if it was rendered into a [texture](Renderer::render_to_texture_while).
    pub image: &'a Image,
    /// The visible surface that the picture shows. On a GPU, empty unless [all layers](Settings::all_layers) are
    /// requested.
    pub layers: &'a GBuffer,
    /// Numbers of points.
    pub counts: Counts,
    /// Time per stage.
    pub timings: Timings,
    /// Time per run of passes of a stage, in order, or per [single pass](Renderer::time_passes); empty on the CPU.
    pub passes: &'a [PassTime],
}

impl Default for Renderer {
    fn default() -> Self {
        Self::new()
    }
}

impl Renderer {
    /// Creates a renderer that runs on the CPU, in the current rayon thread pool.
    pub fn new() -> Self {
        Self::from(BackendRenderer::Cpu(Box::default()))
    }

    /// Creates a renderer that runs on `backend`, on a device of its own.
    ///
    /// # Errors
    /// [`Error::Device`] if [`Backend::Gpu`] is requested and there is no GPU or it does not start;
    /// [`Error::DeviceMemory`].
    pub fn with_backend(backend: Backend) -> Result<Self, Error> {
        let on = |gpu: Gpu| Ok(Self::from(BackendRenderer::Gpu(Box::new(GpuRenderer::new(gpu)?))));
        match backend {
            Backend::Cpu => Ok(Self::new()),
            Backend::Gpu => Gpu::new().and_then(on),
            Backend::Auto => match Gpu::hardware() {
                // If the driver of a GPU fails, the CPU renders.
                Ok(Some(gpu)) => on(gpu).or_else(|_: Error| Ok(Self::new())),
                _ => Ok(Self::new()),
            },
        }
    }

    /// Creates a renderer on the caller's device, best made by [`device_descriptor`](crate::device_descriptor). No
    /// feature is required, except that [`SplatCommunicationRaster`](crate::SearchEngine::SplatCommunicationRaster)
    /// needs `FLOAT32_BLENDABLE`. Without timestamps, passes are not timed, and the time of a frame includes reading it
    /// back. With `PIPELINE_CACHE`, pipelines are kept in the user's cache folder for the next start.
    ///
    /// # Errors
    /// [`Error::Device`] if the device lacks what every WebGPU device has; [`Error::DeviceMemory`].
    ///
    /// # Examples
    ///
    /// ```no_run
    /// use autosplats::{Renderer, device_descriptor, wgpu};
    ///
    /// # async fn renderer() -> Result<Renderer, Box<dyn std::error::Error>> {
    /// let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    /// let adapter = instance.request_adapter(&wgpu::RequestAdapterOptions::default()).await?;
    /// let (device, queue) = adapter.request_device(&device_descriptor(&adapter)).await?;
    /// let renderer = Renderer::with_device(device, queue)?;
    /// # Ok(renderer)
    /// # }
    /// ```
    pub fn with_device(device: wgpu::Device, queue: wgpu::Queue) -> Result<Self, Error> {
        Ok(Self::from(BackendRenderer::Gpu(Box::new(GpuRenderer::new(Gpu::from_parts(device, queue))?))))
    }

    /// Checks whether this renderer supports `settings`, without a cloud.
    ///
    /// # Errors
    /// [`Error::Setting`] if a value is outside its range, [`Error::Device`] if the engine does not run on this
    /// renderer.
    pub fn check(&self, settings: &Settings) -> Result<(), Error> {
        settings.check()?;
        match &self.form {
            BackendRenderer::Cpu(_) => check_engine(settings.reconstruction.engine),
            BackendRenderer::Gpu(renderer) => renderer.check_engine(settings.reconstruction.engine),
        }
    }

    /// Renders points into a picture of `size` (width, height) pixels: a `&PointCloud`, or the chosen nodes of a
    /// `&PointPool`. A GPU keeps the points of the last cloud or pool. It does not upload a cloud of the same
    /// [identity](PointCloud::identity) again, and of a pool only what was inserted since.
    ///
    /// # Errors
    /// [`Error::ImageSize`], [`Error::Setting`] and [`Error::Camera`] for values outside their ranges,
    /// [`Error::TooManyPoints`], [`Error::MissingAttribute`] if the points lack the attribute of the colour mode. On a
    /// GPU also [`Error::DeviceLimit`], [`Error::DeviceMemory`] and [`Error::DeviceLost`]; after the last, the renderer
    /// is unusable. [`Error::Device`] if the search engine takes no pools, as [`KdTree`](crate::SearchEngine::KdTree).
    pub fn render<'a>(
        &mut self,
        points: impl Into<Points<'a>>,
        camera: &Camera,
        size: [u32; 2],
        settings: &Settings,
    ) -> Result<Frame<'_>, Error> {
        self.render_while(points, camera, size, settings, &|| true)
    }

    /// [Renders](Self::render) unless `go_on` returns false, for example because the view has changed. The CPU calls
    /// `go_on` before the frame and every few milliseconds on each thread. A GPU calls `go_on` before the frame and
    /// while points are uploaded.
    ///
    /// # Errors
    /// Those of [`render`](Self::render), and [`Error::Cancelled`] if `go_on` returned false.
    ///
    /// # Examples
    ///
    /// ```
    /// use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
    ///
    /// use autosplats::{Error, Renderer, Settings};
    /// # use autosplats::{Camera, Projection, cloud::{PointCloud, glam::DVec3}};
    /// # let floor = (0..10_000).map(|i| [(i % 100) as f32, (i / 100) as f32, 0.0]).collect();
    /// # let cloud = PointCloud::new(DVec3::ZERO, floor);
    /// # let (eye, look_at) = (DVec3::new(50.0, 50.0, 100.0), DVec3::new(50.0, 50.0, 0.0));
    /// # let projection = Projection::PerspectiveFovDeg(40.0);
    /// # let camera = Camera { eye, look_at, up: DVec3::Y, projection };
    ///
    /// let (mut renderer, settings) = (Renderer::new(), Settings::default());
    /// // Another thread sets the flag when the user turns the view.
    /// let turned = AtomicBool::new(true);
    /// let go_on = || !turned.load(Relaxed);
    /// let result = renderer.render_while(&cloud, &camera, [64, 48], &settings, &go_on);
    /// assert!(matches!(result, Err(Error::Cancelled)));
    /// ```
    pub fn render_while<'a>(
        &mut self,
        points: impl Into<Points<'a>>,
        camera: &Camera,
        size: [u32; 2],
        settings: &Settings,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Frame<'_>, Error> {
        if !go_on() {
            return Err(Error::Cancelled);
        }
        self.render_form(points.into(), None, camera, size, settings, go_on)
    }

    /// Renders `cloud` with precomputed normals and radii, as [`estimate_normals`] returns them for the same `k`. CPU
    /// only.
    ///
    /// Outliers, gaps and noise are not searched for. Splats are circles, whatever
    /// [`ellipses`](Reconstruction::ellipses) says. Either side of a normal may face the eye. A point draws nothing and
    /// counts as an outlier if its normal is not finite, or if its radius is not finite and above 0.
    ///
    /// [`estimate_normals`]: crate::estimate_normals
    ///
    /// # Errors
    /// Those of [`render`](Self::render); [`Error::Normals`] unless there is one of each per point; [`Error::Device`]
    /// if this renderer runs on a GPU.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats::{NormalSettings, Renderer, Settings, estimate_normals};
    /// # use autosplats::{Camera, Projection, cloud::{PointCloud, glam::DVec3}};
    /// # let floor = (0..10_000).map(|i| [(i % 100) as f32, (i / 100) as f32, 0.0]).collect();
    /// # let cloud = PointCloud::new(DVec3::ZERO, floor);
    /// # let (eye, look_at) = (DVec3::new(50.0, 50.0, 100.0), DVec3::new(50.0, 50.0, 0.0));
    /// # let projection = Projection::PerspectiveFovDeg(40.0);
    /// # let camera = Camera { eye, look_at, up: DVec3::Y, projection };
    ///
    /// let normals = estimate_normals(&cloud, &NormalSettings::default(), &())?;
    /// let (mut renderer, settings) = (Renderer::new(), Settings::default());
    /// let frame = renderer.render_with_normals(&cloud, &normals, &camera, [64, 48], &settings)?;
    /// assert!(frame.counts.covered > 1000);
    /// # Ok::<(), autosplats::Error>(())
    /// ```
    pub fn render_with_normals(
        &mut self,
        cloud: &PointCloud,
        normals: &Normals,
        camera: &Camera,
        size: [u32; 2],
        settings: &Settings,
    ) -> Result<Frame<'_>, Error> {
        let Normals { normals, curvature, radius } = normals;
        let points = cloud.len();
        let lengths = [("normals", normals.len()), ("curvatures", curvature.len()), ("radii", radius.len())];
        if let Some((what, given)) = lengths.into_iter().find(|&(_, given)| given != points) {
            return Err(Error::Normals { what, given, points });
        }
        self.render_form(
            cloud.into(),
            Some(GivenPlanes { normals, curvature, radius }),
            camera,
            size,
            settings,
            &|| true,
        )
    }

    /// Surfels of the last frame: the fits of all reconstructed points whose surfel's centre is in the picture, in no
    /// particular order. Empty before the first frame.
    ///
    /// # Errors
    /// On a GPU, [`Error::DeviceMemory`], [`Error::DeviceLimit`] and [`Error::DeviceLost`], because the surfels are
    /// read back.
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats::{Renderer, Settings};
    /// # use autosplats::{Camera, Projection, cloud::{PointCloud, glam::DVec3}};
    /// # let floor = (0..10_000).map(|i| [(i % 100) as f32, (i / 100) as f32, 0.0]).collect();
    /// # let cloud = PointCloud::new(DVec3::ZERO, floor);
    /// # let (eye, look_at) = (DVec3::new(50.0, 50.0, 100.0), DVec3::new(50.0, 50.0, 0.0));
    /// # let projection = Projection::PerspectiveFovDeg(40.0);
    /// # let camera = Camera { eye, look_at, up: DVec3::Y, projection };
    ///
    /// // The cloud is a floor, seen from above.
    /// let mut renderer = Renderer::new();
    /// renderer.render(&cloud, &camera, [64, 48], &Settings::default())?;
    /// for surfel in renderer.surfels()? {
    ///     assert!(surfel.normal[2] > 0.99, "point {} faces up", surfel.point);
    /// }
    /// # Ok::<(), autosplats::Error>(())
    /// ```
    pub fn surfels(&mut self) -> Result<Vec<PointSurfel>, Error> {
        match &mut self.form {
            BackendRenderer::Cpu(renderer) => Ok(renderer.surfels()),
            BackendRenderer::Gpu(renderer) => renderer.surfels(),
        }
        .map(|surfels| self.scaling.surfels(surfels))
    }

    /// Convergence of the last frame's k-radius search: the number of searched points, then the number of unfinished
    /// points after each iteration. Empty before the first frame, on the CPU, and with [engines](crate::SearchEngine)
    /// that do not iterate.
    ///
    /// # Errors
    /// [`Error::DeviceMemory`], [`Error::DeviceLost`].
    pub fn convergence(&mut self) -> Result<Vec<u32>, Error> {
        match &mut self.form {
            BackendRenderer::Cpu(_) => Ok(Vec::new()),
            BackendRenderer::Gpu(renderer) => renderer.convergence(),
        }
    }

    /// Uploads what the next frame of points with `settings` needs, so that this frame starts at once. The upload can
    /// run while the device still renders the frame before. `report` receives the finished fraction, 0 to 1, and
    /// returns whether to go on. Does nothing on the CPU.
    ///
    /// # Errors
    /// [`Error::MissingAttribute`], [`Error::TooManyPoints`], [`Error::DeviceMemory`], [`Error::DeviceLost`];
    /// [`Error::Cancelled`] if `report` returned false.
    pub fn upload<'a>(
        &mut self,
        points: impl Into<Points<'a>>,
        settings: &Settings,
        report: &dyn Fn(f32) -> bool,
    ) -> Result<(), Error> {
        match &mut self.form {
            BackendRenderer::Cpu(_) => Ok(()),
            BackendRenderer::Gpu(renderer) => {
                let points = points.into();
                self.scaling.choose(points, None);
                renderer.upload(self.scaling.points(points), settings, report)
            }
        }
    }
}
