//! A frame, one line per stage.

mod attributes;
mod cpu;
mod exposure;
mod first_radius;
mod gpu;
mod layers;
mod settings;
mod still;
mod surfels;
mod upward;

use autosplats_cloud::PointCloud;

use self::cpu::{CpuRenderer, check_engine};
use self::gpu::GpuRenderer;
use crate::Error;
use crate::camera::{Camera, View};
use crate::fit::GivenPlanes;
use crate::gpu::{AdapterSummary, Gpu, PassTime};
use crate::normals::Normals;
use crate::shade::Image;
use crate::splat::GBuffer;

pub use exposure::usual_exposure;
pub use first_radius::{RadiusTrial, best_first_radius};
pub use layers::shade_layers;
pub use settings::{Reconstruction, Settings};
pub use still::{BYTES_PER_PIXEL, still_supersample};
pub use surfels::PointSurfel;

/// Longest side of an image in pixels.
pub const MAX_SIDE: u32 = 16_384;

/// What became of the points of one frame, in numbers. But for the last two, points in the margin that a picture may have count.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Counts {
    /// Points in the cloud.
    pub points: usize,
    /// Points that cannot be seen: the sum of the next three.
    pub dropped: usize,
    /// Points with a coordinate that is NaN or infinite.
    pub not_finite: usize,
    /// Points at or behind the eye.
    pub behind: usize,
    /// Points outside the picture and, where there is one, the margin around it.
    pub outside: usize,
    /// Points that own a pixel or half of one, the nearest ones there, in the picture or its margin; the rest are hidden behind
    /// them.
    pub visible: usize,
    /// Visible points reconstructed in the first pass.
    pub active: usize,
    /// Visible points that grid culling put back, or that lie so far out in the margin that they are but neighbours to others.
    pub passive: usize,
    /// Passive points that turned out not to be hidden and were reconstructed in the second pass.
    pub recovered: usize,
    /// Points discarded because they have no neighbour, or because they are no part of a surface that their neighbours are.
    pub outliers: usize,
    /// Points that kept fewer than k neighbours, because of a gap or of the bound on search work.
    pub clamped: usize,
    /// Points whose search met the bound on its work.
    pub bounded: usize,
    /// Pixels that show a surface.
    pub covered: usize,
    /// Values at the two ends of the colour map, given or found in the picture; where the colour mode has one.
    pub value_range: Option<[f64; 2]>,
}

/// Milliseconds spent in each stage of one frame. On a GPU with timestamps from the begin to the end of a stage's passes that
/// follow each other, what lies between them included.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[allow(missing_docs, reason = "one field per stage")]
pub struct Timings {
    /// Copying the points to the device, where they were not there already; not part of the frame.
    pub upload: f64,
    pub project: f64,
    pub search: f64,
    pub fit: f64,
    pub adapt: f64,
    pub splat: f64,
    pub shade: f64,
    /// From the first stage's start to the last one's end; reading a picture back from a device is not part of it.
    pub frame: f64,
}

/// Where frames are made. Pictures are the same within a step of brightness here and there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Backend {
    /// A hardware GPU where there is one, else the CPU.
    #[default]
    Auto,
    /// All threads of the current rayon pool; needs no driver.
    Cpu,
    /// The best device that wgpu finds, though it may be a program on the CPU.
    Gpu,
}

/// Turns clouds into pictures; keeps its buffers, so that a frame after the first allocates next to nothing.
#[derive(Debug)]
pub struct Renderer {
    form: Form,
}

#[derive(Debug)]
enum Form {
    Cpu(Box<CpuRenderer>),
    Gpu(Box<GpuRenderer>),
}

/// One picture and what is known about it.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// The picture.
    pub image: &'a Image,
    /// The visible surface it was shaded from; a GPU hands it out only if [all layers](Settings::all_layers) are asked for,
    /// and leaves it empty otherwise.
    pub layers: &'a GBuffer,
    /// What became of the points.
    pub counts: Counts,
    /// Time per stage.
    pub timings: Timings,
    /// Time per pass, in order; empty on the CPU.
    pub passes: &'a [PassTime],
}

impl Default for Renderer {
    fn default() -> Self {
        Self::new()
    }
}

impl Renderer {
    /// A renderer that runs on the CPU, in the current rayon thread pool.
    pub fn new() -> Self {
        Self { form: Form::Cpu(Box::default()) }
    }

    /// A renderer that runs where `backend` says, on a device of its own.
    ///
    /// # Errors
    /// [`Error::Device`] if there is no GPU though one is asked for, or it does not start; [`Error::DeviceMemory`].
    pub fn with_backend(backend: Backend) -> Result<Self, Error> {
        let on = |gpu: Gpu| Ok(Self { form: Form::Gpu(Box::new(GpuRenderer::new(gpu)?)) });
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

    /// A renderer on the caller's own device. It uses the features `SHADER_INT64`, `SHADER_INT64_ATOMIC_MIN_MAX` and
    /// `TIMESTAMP_QUERY` if the device was made with them; it needs none, but [`SplatCommunication`](crate::SearchEngine::SplatCommunication) needs
    /// `FLOAT32_BLENDABLE`. Without timestamps passes are not timed, and the time of a frame includes reading it back.
    ///
    /// # Errors
    /// [`Error::Device`] if the device lacks what every WebGPU device has, [`Error::DeviceMemory`].
    pub fn with_device(device: wgpu::Device, queue: wgpu::Queue) -> Result<Self, Error> {
        Ok(Self { form: Form::Gpu(Box::new(GpuRenderer::new(Gpu::from_parts(device, queue))?)) })
    }

    /// The device that frames are made on; `None` on the CPU.
    pub fn adapter(&self) -> Option<AdapterSummary> {
        match &self.form {
            Form::Cpu(_) => None,
            Form::Gpu(renderer) => Some(renderer.adapter()),
        }
    }

    /// Checks whether this renderer can do what `settings` ask for, before there is a cloud.
    ///
    /// # Errors
    /// [`Error::Setting`] for what lies outside its range, [`Error::Device`] for an engine that does not run here.
    pub fn check(&self, settings: &Settings) -> Result<(), Error> {
        settings.check()?;
        match &self.form {
            Form::Cpu(_) => check_engine(settings.reconstruction.engine),
            Form::Gpu(renderer) => renderer.check_engine(settings.reconstruction.engine),
        }
    }

    /// Renders `cloud` into a picture of `size` (width, height) pixels. A GPU keeps the points: those of a cloud whose
    /// [identity](PointCloud::identity) it has are not uploaded again.
    ///
    /// # Errors
    /// [`Error::ImageSize`], [`Error::Setting`] and [`Error::Camera`] for what lies outside its range,
    /// [`Error::TooManyPoints`], [`Error::MissingAttribute`] if the colour mode needs one that the cloud lacks. On a GPU
    /// also [`Error::DeviceLimit`], [`Error::DeviceMemory`] and [`Error::DeviceLost`]; after the last the renderer is of no
    /// use any more.
    pub fn render(
        &mut self,
        cloud: &PointCloud,
        camera: &Camera,
        size: [u32; 2],
        settings: &Settings,
    ) -> Result<Frame<'_>, Error> {
        self.render_while(cloud, camera, size, settings, &|| true)
    }

    /// [Renders](Self::render) unless `go_on`, asked before the frame begins and after each stage of it, says no: then the
    /// view has changed, say, and nobody wants this picture any more. A GPU asks while points are uploaded, and works
    /// without questions from then on.
    ///
    /// # Errors
    /// Those of [`render`](Self::render), and [`Error::Cancelled`] if `go_on` said no.
    pub fn render_while(
        &mut self,
        cloud: &PointCloud,
        camera: &Camera,
        size: [u32; 2],
        settings: &Settings,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Frame<'_>, Error> {
        if !go_on() {
            return Err(Error::Cancelled);
        }
        match &mut self.form {
            Form::Cpu(renderer) => renderer.render(cloud, camera, size, settings, None, go_on),
            Form::Gpu(renderer) => renderer.render(cloud, camera, size, settings, go_on),
        }
    }

    /// Renders `cloud` with normals and radii found beforehand instead of on the fly: what [`estimate_normals`] gives for
    /// the same `k`, on either side. Neither outliers, gaps nor noise are looked for, and splats are circles whatever
    /// [`ellipses`](Reconstruction::ellipses) says. A point with a normal that is not finite, or a radius that is not finite or
    /// not above 0, draws nothing and is counted as an outlier. On the CPU only.
    ///
    /// [`estimate_normals`]: crate::estimate_normals
    ///
    /// # Errors
    /// Those of [`render`](Self::render); [`Error::Normals`] if there is not one of each for each point, [`Error::Device`]
    /// if this renderer runs on a GPU.
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
        match &mut self.form {
            Form::Cpu(renderer) => {
                let planes = GivenPlanes { normals, curvature, radius };
                renderer.render(cloud, camera, size, settings, Some(planes), &|| true)
            }
            Form::Gpu(_) => Err(Error::Device("normals found beforehand are rendered on the CPU only".into())),
        }
    }

    /// The surfels of the last frame: what the search and the fit found for each visible point that they took up and whose
    /// surfel's centre is in the picture, in no order to rely on. Empty before the first frame.
    ///
    /// # Errors
    /// [`Error::DeviceMemory`], [`Error::DeviceLimit`] and [`Error::DeviceLost`] on a GPU, which they are read back from.
    pub fn surfels(&mut self) -> Result<Vec<PointSurfel>, Error> {
        match &mut self.form {
            Form::Cpu(renderer) => Ok(renderer.surfels()),
            Form::Gpu(renderer) => renderer.surfels(),
        }
    }

    /// How the k-radius search of the last frame converged: the number of points that were searched for, and after each
    /// iteration how many of them had not yet been found their radius. Empty before the first frame, on the CPU, and with
    /// [engines](crate::SearchEngine) that do not iterate.
    ///
    /// # Errors
    /// [`Error::DeviceMemory`], [`Error::DeviceLost`].
    pub fn convergence(&mut self) -> Result<Vec<u32>, Error> {
        match &mut self.form {
            Form::Cpu(_) => Ok(Vec::new()),
            Form::Gpu(renderer) => renderer.convergence(),
        }
    }

    /// Uploads what `settings` will need of `cloud`, so that the next frame of it starts at once: as soon as the frame
    /// before is submitted, while the device still renders that. `report` is told the fraction done, and says whether to
    /// go on. On the CPU there is nothing to do.
    ///
    /// # Errors
    /// [`Error::MissingAttribute`], [`Error::TooManyPoints`], [`Error::DeviceMemory`], [`Error::DeviceLost`];
    /// [`Error::Cancelled`] if `report` said no.
    pub fn upload(
        &mut self,
        cloud: &PointCloud,
        settings: &Settings,
        report: &dyn Fn(f32) -> bool,
    ) -> Result<(), Error> {
        match &mut self.form {
            Form::Cpu(_) => Ok(()),
            Form::Gpu(renderer) => renderer.upload(cloud, settings, report),
        }
    }

    /// Renders into the whole of a caller's texture, made by the device that this renderer runs on, without waiting for it.
    /// The format is `Rgba8Unorm`, `Bgra8Unorm` or one of their `Srgb` forms, the usage has `COPY_DST`. There is no legend.
    ///
    /// # Errors
    /// Those of [`render`](Self::render), and [`Error::Texture`] if the texture cannot be rendered into, [`Error::Device`] if
    /// this renderer runs on the CPU.
    pub fn render_to_texture(
        &mut self,
        cloud: &PointCloud,
        camera: &Camera,
        texture: &wgpu::Texture,
        settings: &Settings,
    ) -> Result<(), Error> {
        match &mut self.form {
            Form::Cpu(_) => Err(Error::Device("a texture can only be rendered into on a GPU".into())),
            Form::Gpu(renderer) => renderer.render_to_texture(cloud, camera, texture, settings),
        }
    }
}

/// Checks what was asked for and makes the camera ready.
fn check(cloud: &PointCloud, camera: &Camera, [width, height]: [u32; 2], settings: &Settings) -> Result<View, Error> {
    settings.check()?;
    let sides = 1..=MAX_SIDE;
    if !sides.contains(&width) || !sides.contains(&height) {
        return Err(Error::ImageSize { width, height });
    }
    check_count(cloud)?;
    camera.view(cloud.origin(), [width, height])
}

fn check_count(cloud: &PointCloud) -> Result<(), Error> {
    // The last index marks empty pixels.
    if cloud.len() >= u32::MAX as usize { Err(Error::TooManyPoints(cloud.len())) } else { Ok(()) }
}
