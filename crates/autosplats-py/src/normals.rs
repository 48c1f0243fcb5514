//! Normals of all points.

use std::borrow::Cow;

use autosplats::{NormalSettings, Orientation};
use autosplats_cloud::{Unit, check_memory};
use numpy::PyArray1;
use pyo3::prelude::*;

use crate::cloud::Cloud;
use crate::convert;
use crate::errors::{self, Class, Failure};
use crate::wait::run;

/// Bytes per point beside the cloud: the search tree and the result.
const BYTES_PER_POINT: u64 = 40;

/// The side that normals point to, by its name.
#[derive(Clone, Copy)]
enum Side {
    Auto,
    Sensor,
    Up,
    Outward,
}

impl Side {
    fn named(name: &str) -> PyResult<Self> {
        Ok(match name {
            "auto" => Self::Auto,
            "sensor" => Self::Sensor,
            "up" => Self::Up,
            "outward" => Self::Outward,
            _ => {
                let what = format!("orient is '{name}', must be one of auto, sensor, up, outward");
                return Err(errors::raise(Class::Argument, what));
            }
        })
    }
}

/// Normals (n, 3), curvatures (n) and density radii (n) of a cloud.
#[pyfunction]
#[pyo3(signature = (cloud, k, orient, sensor, threads, progress))]
#[allow(clippy::type_complexity, reason = "three arrays")]
pub(crate) fn estimate_normals<'py>(
    py: Python<'py>,
    cloud: &Cloud,
    k: u32,
    orient: &str,
    sensor: Option<[f64; 3]>,
    threads: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<f32>>)> {
    let side = Side::named(orient)?;
    let cloud = &cloud.cloud;
    let normals = run(py, threads, progress, |watch| {
        check_memory("the normals", cloud.len() as u64 * BYTES_PER_POINT)?;
        // A neighbourhood needs one unit along all axes, so coordinates in degrees are estimated as metres.
        let mut local = Cow::Borrowed(&**cloud);
        if cloud.crs().unit == Some(Unit::Degree) {
            local.to_mut().to_local_metres();
        }
        let orientation = match (sensor, side) {
            (Some(position), _) => Orientation::towards(position.into(), &local),
            (None, Side::Auto) => Orientation::usual(&local),
            (None, Side::Sensor) => Orientation::towards_sensors(&local).ok_or_else(|| {
                let what = "orient is 'sensor', but the points state no sensor; give sensor=(x, y, z)";
                Failure::Raised(Class::Argument, what.into())
            })?,
            (None, Side::Up) => Orientation::Direction(autosplats_cloud::glam::DVec3::Z),
            (None, Side::Outward) => Orientation::Outward,
        };
        Ok(autosplats::estimate_normals(&local, &NormalSettings { k, orientation }, watch)?)
    })?;
    let rows = convert::rows(py, normals.normals)?;
    Ok((rows, PyArray1::from_vec(py, normals.curvature), PyArray1::from_vec(py, normals.radius)))
}
