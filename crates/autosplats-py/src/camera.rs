//! Cameras: fitted to points, and between world and picture. They pass between Python and here as JSON, which keeps
//! every bit of a number.

use std::sync::Arc;

use autosplats::{Camera, Projection, ViewDirection, guess_axes};
use autosplats_cloud::glam::{DVec2, DVec3};
use autosplats_cloud::{Axes, PointCloud, Unit};
use numpy::ndarray::{Array1, Array2};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::cloud::{Cloud, named_axes};
use crate::errors::{self, Class, Failure};
use crate::wait::run;

/// How a camera is found if none is given.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    /// The camera of the points, if they were made for one.
    pub(crate) own: Option<Camera>,
    pub(crate) view: ViewDirection,
    pub(crate) axes: Option<Axes>,
    /// Vertical field of view in degrees.
    pub(crate) fov: Option<f64>,
    pub(crate) orthographic: bool,
}

impl Fit {
    /// The camera for a picture of `size` pixels.
    pub(crate) fn place(&self, cloud: &PointCloud, size: [u32; 2]) -> Result<Camera, Failure> {
        let Self { own, view, axes, fov, orthographic } = *self;
        let projection = if orthographic {
            Projection::OrthographicHeight(1.0)
        } else {
            Projection::PerspectiveFovDeg(fov.unwrap_or(Projection::USUAL_FOV_DEG))
        };
        if let Some(own) = own
            && view == ViewDirection::Auto
            && !orthographic
        {
            return Ok(Camera { projection: fov.map_or(own.projection, Projection::PerspectiveFovDeg), ..own });
        }
        let axes = axes.unwrap_or_else(|| guess_axes(cloud));
        let camera = Camera::fit(cloud, axes, view, f64::from(size[0]) / f64::from(size[1]), projection)?;
        camera.check()?;
        Ok(camera)
    }
}

/// The points as pictures show them: in metres if they are in degrees, and with the axes if some are stated.
pub(crate) fn shown(cloud: &Arc<PointCloud>, axes: Option<Axes>) -> Arc<PointCloud> {
    let is_metric = cloud.crs().unit != Some(Unit::Degree);
    if is_metric && axes.is_none_or(|axes| cloud.axes() == Some(axes)) {
        return Arc::clone(cloud);
    }
    let mut changed = (**cloud).clone();
    changed.to_local_metres();
    Arc::new(match axes {
        Some(axes) => changed.with_axes(axes),
        None => changed,
    })
}

/// A direction by its name.
pub(crate) fn direction(view: &str) -> PyResult<ViewDirection> {
    Ok(match view {
        "auto" => ViewDirection::Auto,
        "iso" => ViewDirection::Iso,
        "front" => ViewDirection::Front,
        "back" => ViewDirection::Back,
        "left" => ViewDirection::Left,
        "right" => ViewDirection::Right,
        "top" => ViewDirection::Top,
        "bottom" => ViewDirection::Bottom,
        _ => {
            let what = "must be one of auto, iso, front, back, left, right, top, bottom";
            return Err(errors::raise(Class::Argument, format!("view is '{view}', {what}")));
        }
    })
}

pub(crate) fn parsed(camera: &str) -> PyResult<Camera> {
    serde_json::from_str(camera).map_err(|error| errors::raise(Class::Argument, format!("camera: {error}")))
}

pub(crate) fn written(camera: &Camera) -> PyResult<String> {
    serde_json::to_string(camera).map_err(|error| Failure::Fault(error.to_string()).raise())
}

/// Fits a camera to a cloud for a picture of `size` (width, height) pixels.
#[pyfunction]
#[pyo3(signature = (cloud, view, size, axes, fov, orthographic))]
pub(crate) fn fit_camera(
    py: Python<'_>,
    cloud: &Cloud,
    view: &str,
    size: [u32; 2],
    axes: Option<&str>,
    fov: Option<f64>,
    orthographic: bool,
) -> PyResult<String> {
    let axes = axes.map(named_axes).transpose()?;
    let fit = Fit { own: cloud.camera, view: direction(view)?, axes, fov, orthographic };
    written(&run(py, None, None, |_| fit.place(&shown(&cloud.cloud, axes), size))?)
}

/// The axes that a cloud states, or those that it seems to have.
#[pyfunction]
pub(crate) fn axes_of(py: Python<'_>, cloud: &Cloud) -> PyResult<&'static str> {
    run(py, None, None, |_| Ok(guess_axes(&shown(&cloud.cloud, None)).name()))
}

/// Raises unless the camera is valid.
#[pyfunction]
pub(crate) fn check_camera(camera: &str) -> PyResult<()> {
    parsed(camera)?.check().map_err(|error| Failure::Render(error).raise())
}

/// Pixels and depths of world coordinates, with the centre of the first pixel at (0, 0). NaN for what is not in front
/// of the eye.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "two arrays")]
pub(crate) fn project<'py>(
    py: Python<'py>,
    camera: &str,
    size: [u32; 2],
    points: PyReadonlyArray2<'py, f64>,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>)> {
    let lens = parsed(camera)?.lens(size).map_err(|error| Failure::Render(error).raise())?;
    let points = points.as_array();
    let (mut pixels, mut depths) = (Array2::zeros((points.nrows(), 2)), Array1::zeros(points.nrows()));
    for (i, point) in points.rows().into_iter().enumerate() {
        let found = lens.to_pixel(DVec3::new(point[0], point[1], point[2]));
        let (pixel, depth) = found.unwrap_or((DVec2::NAN, f64::NAN));
        [pixels[[i, 0]], pixels[[i, 1]]] = (pixel - 0.5).to_array();
        depths[i] = depth;
    }
    Ok((PyArray2::from_owned_array(py, pixels), PyArray1::from_owned_array(py, depths)))
}

/// World coordinates at pixels and depths, the reverse of [`project`].
#[pyfunction]
pub(crate) fn unproject<'py>(
    py: Python<'py>,
    camera: &str,
    size: [u32; 2],
    pixels: PyReadonlyArray2<'py, f64>,
    depths: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let lens = parsed(camera)?.lens(size).map_err(|error| Failure::Render(error).raise())?;
    let (pixels, depths) = (pixels.as_array(), depths.as_array());
    let mut points = Array2::zeros((pixels.nrows(), 3));
    for ((mut point, pixel), &depth) in points.rows_mut().into_iter().zip(pixels.rows()).zip(depths) {
        let world = lens.unproject(DVec2::new(pixel[0], pixel[1]) + 0.5, depth);
        [point[0], point[1], point[2]] = world.to_array();
    }
    Ok(PyArray2::from_owned_array(py, points))
}
