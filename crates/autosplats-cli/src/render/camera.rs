//! The camera: from flags to a placed eye.

use std::io::{Error, Write as _};
use std::path::{Path, PathBuf};

use autosplats::{Camera, Projection, ViewDirection, guess_axes};
use autosplats_cloud::glam::DVec3;
use autosplats_cloud::{Axes, Output, PointCloud, read_text};
use autosplats_formats::PinholeCamera;
use autosplats_scenes::{Scene, View};
use serde_json::error::Category;

use crate::args::CameraArgs;
use crate::choices::{AxesChoice, Side};
use crate::console::Console;
use crate::exit::{Exit, Failure};
use crate::output::{ReadFiles, check_target, forced, write_file};
use crate::values::Ortho;

/// A camera that is placed once the points are known.
#[derive(Debug)]
pub(super) struct CameraJob {
    axes: Option<Axes>,
    fov_deg: Option<f64>,
    ortho: Option<Ortho>,
    place: CameraPlacement,
}

/// Placement of the camera.
#[derive(Debug)]
enum CameraPlacement {
    /// The camera of a file.
    File(PathBuf, Camera),
    /// At the flags' position. Missing values come from the points.
    Eye { eye: DVec3, look_at: Option<DVec3>, up: Option<DVec3> },
    /// Fitted so that everything is seen from a side.
    Fitted(Option<Side>),
}

impl CameraJob {
    /// Parses the flags and reads the file of `--camera`.
    pub(super) fn new(args: &CameraArgs, console: &Console) -> Result<Self, Failure> {
        let axes = match args.axes {
            AxesChoice::Auto => None,
            AxesChoice::ZUp => Some(Axes::ZUp),
            AxesChoice::YUp => Some(Axes::YUp),
            AxesChoice::XUp => Some(Axes::XUp),
            AxesChoice::ZDown => Some(Axes::ZDown),
            AxesChoice::YDown => Some(Axes::YDown),
            AxesChoice::XDown => Some(Axes::XDown),
            AxesChoice::Camera => Some(Axes::Camera),
        };
        let place = match (&args.camera, args.eye) {
            (Some(path), _) => CameraPlacement::File(path.clone(), load(path, console)?),
            (None, Some(eye)) => CameraPlacement::Eye { eye, look_at: args.look_at, up: args.up },
            (None, None) => CameraPlacement::Fitted(args.view),
        };
        Ok(Self { axes, fov_deg: args.fov, ortho: args.ortho, place })
    }

    /// The file of the camera.
    pub(super) fn file(&self) -> Option<&Path> {
        match &self.place {
            CameraPlacement::File(path, _) => Some(path),
            _ => None,
        }
    }

    /// Remedy for a picture that shows nothing.
    pub(super) fn remedy(&self) -> &'static str {
        match self.place {
            CameraPlacement::File(..) => "rendering without --camera",
            CameraPlacement::Eye { .. } => "rendering without --eye",
            CameraPlacement::Fitted(_) => "--view iso",
        }
    }

    /// Places the camera and returns it with the up axis.
    pub(super) fn place(
        &self,
        cloud: &PointCloud,
        scene: Option<&Scene>,
        size: [u32; 2],
    ) -> Result<(Camera, Axes), Failure> {
        let axes = self.axes.unwrap_or_else(|| guess_axes(cloud));
        let fitted_by = |view, projection| {
            let aspect = f64::from(size[0]) / f64::from(size[1]);
            Camera::fit(cloud, axes, direction(view), aspect, projection)
        };
        let fitted = |view| fitted_by(view, self.projection());
        let mut camera = match self.place {
            CameraPlacement::File(_, camera) => return Ok((camera, axes)),
            CameraPlacement::Eye { eye, look_at, up } => {
                // An orthographic camera looks at the middle of the points.
                let middle =
                    || fitted_by(Some(Side::Iso), Projection::OrthographicHeight(1.0)).map(|fitted| fitted.look_at);
                let look_at = look_at.map_or_else(middle, Ok)?;
                let up = up.unwrap_or_else(|| upward(axes, look_at - eye));
                let projection = match self.ortho {
                    Some(Ortho(None)) => fitted(Some(Side::Iso))?.projection,
                    _ => self.projection(),
                };
                Camera { eye, look_at, up, projection }
            }
            CameraPlacement::Fitted(view) => match scene {
                Some(scene) if view.is_none() && self.ortho.is_none() => scene_camera(scene),
                _ => fitted(view)?,
            },
        };
        // Values stated by flags override fitted ones.
        match (self.fov_deg, self.ortho) {
            (Some(fov), _) => camera.projection = Projection::PerspectiveFovDeg(fov),
            (_, Some(Ortho(Some(height)))) => camera.projection = Projection::OrthographicHeight(height),
            _ => {}
        }
        camera.axes()?;
        Ok((camera, axes))
    }

    /// Projection of the flags. A height that is still to be fitted is 1.
    fn projection(&self) -> Projection {
        match self.ortho {
            Some(Ortho(height)) => Projection::OrthographicHeight(height.unwrap_or(1.0)),
            None => Projection::PerspectiveFovDeg(self.fov_deg.unwrap_or(Projection::USUAL_FOV_DEG)),
        }
    }
}

/// The camera of a scene.
pub(crate) fn scene_camera(scene: &Scene) -> Camera {
    let View { eye, look_at, up, fov_degrees } = scene.view();
    Camera { eye, look_at, up, projection: Projection::PerspectiveFovDeg(fov_degrees) }
}

fn direction(side: Option<Side>) -> ViewDirection {
    match side {
        None => ViewDirection::Auto,
        Some(Side::Iso) => ViewDirection::Iso,
        Some(Side::Front) => ViewDirection::Front,
        Some(Side::Back) => ViewDirection::Back,
        Some(Side::Left) => ViewDirection::Left,
        Some(Side::Right) => ViewDirection::Right,
        Some(Side::Top) => ViewDirection::Top,
        Some(Side::Bottom) => ViewDirection::Bottom,
    }
}

/// Up direction of a picture along `sight`: the axes' up, or their forward direction if up is along the line of sight.
fn upward(axes: Axes, sight: DVec3) -> DVec3 {
    let [_, front, up] = axes.frame();
    if sight.cross(up).length() > 1e-6 * sight.length() { up } else { -front }
}

pub(super) fn load(path: &Path, console: &Console) -> Result<Camera, Failure> {
    let shown = path.display();
    let text = read_text(path).map_err(|error| Failure::usage(format!("{shown}: {error}")))?;
    if let Some(pinhole) = PinholeCamera::parse(&text) {
        return of_pinhole(path, &pinhole, console);
    }
    let camera: Camera = serde_json::from_str(&text).map_err(|error| {
        let why = match error.classify() {
            Category::Data => "eye, look_at and up must be three numbers each, projection as --save-camera writes it",
            _ => "not JSON; --save-camera writes a camera file",
        };
        Failure::usage(format!("{shown}, line {}, column {}: not a camera: {why}", error.line(), error.column()))
    })?;
    camera.check().map_err(|error| Failure::usage(format!("{shown}: {error}")))?;
    Ok(camera)
}

/// Most that a principal point may lie beside the middle, as a part of the picture's width or height, and that pixels
/// may differ from squares, without a note.
const MAX_ASYMMETRY: f64 = 0.01;

/// The view of a calibrated camera, whose field of view is kept from top to bottom.
fn of_pinhole(path: &Path, pinhole: &PinholeCamera, console: &Console) -> Result<Camera, Failure> {
    let shown = path.display();
    let PinholeCamera { fx, fy, cx, cy, size, world_from_camera, cameras, .. } = *pinhole;
    let Some(pose) = world_from_camera else {
        let why = "a camera without a pose; Open3D writes one as 'extrinsic', and --eye with --fov states one";
        return Err(Failure::usage(format!("{shown}: {why}")));
    };
    if cameras > 1 {
        console.note(format_args!("{shown}: the first of {cameras} cameras is taken"));
    }
    let [width, height] = size.unwrap_or([2.0 * cx + 1.0, 2.0 * cy + 1.0]);
    let aside = [(cx + 0.5) / width - 0.5, (cy + 0.5) / height - 0.5, fx / fy - 1.0];
    if aside.into_iter().any(|part| part.abs() > MAX_ASYMMETRY) {
        console.note(format_args!(
            "{shown}: its axis is put in the middle of the picture, and its pixels are taken as square"
        ));
    }
    let [eye, down, forward] = [pose.w_axis, pose.y_axis, pose.z_axis].map(|axis| axis.truncate());
    let fov_deg = 2.0 * (0.5 * height / fy).atan().to_degrees();
    let camera = Camera { eye, look_at: eye + forward, up: -down, projection: Projection::PerspectiveFovDeg(fov_deg) };
    camera.check().map_err(|error| Failure::usage(format!("{shown}: {error}")))?;
    Ok(camera)
}

/// Longest file that may be a saved camera, in bytes.
const MAX_CAMERA: u64 = 1 << 16;

/// The output for a camera: a file with another content stays.
///
/// # Errors
/// Those of an output that cannot be written, and of a file that is not a saved camera.
pub(super) fn output<'a>(path: &'a Path, inputs: &ReadFiles) -> Result<Output<'a>, Failure> {
    let there = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file);
    let replaces = |metadata: std::fs::Metadata| {
        metadata.len() == 0
            || metadata.len() <= MAX_CAMERA
                && std::fs::read(path).is_ok_and(|bytes| serde_json::from_slice::<Camera>(&bytes).is_ok())
    };
    let output = forced(path, there.is_some());
    check_target(output, inputs)?;
    if there.is_some_and(|metadata| !replaces(metadata)) {
        let why = "already exists and is no saved camera; name another file";
        return Err(Failure::new(Exit::Output, format!("{}: {why}", path.display())));
    }
    Ok(output)
}

/// Writes a camera as JSON and returns the file's size in bytes.
pub(super) fn save(path: &Path, camera: &Camera, inputs: &ReadFiles, console: &Console) -> Result<u64, Failure> {
    write_file(output(path, inputs)?, console, |writer| {
        serde_json::to_writer_pretty(&mut *writer, camera).map_err(Error::other)?;
        writeln!(writer)
    })
}
