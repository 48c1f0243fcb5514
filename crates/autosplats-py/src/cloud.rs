//! Clouds: immutable points that arrays show without a copy.

use std::sync::Arc;

use autosplats::Camera;
use autosplats_cloud::glam::{DMat4, DVec3};
use autosplats_cloud::{Axes, Crs, PointCloud, Scan, each_type};
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::convert;
use crate::errors::{self, Class, Failure};
use crate::view::view;
use crate::wait::{Watch, run};

/// Points and their attributes.
#[pyclass(frozen, module = "autosplats._core")]
pub(crate) struct Cloud {
    pub(crate) cloud: Arc<PointCloud>,
    /// The view that the points were made for.
    pub(crate) camera: Option<Camera>,
}

/// A scan: its name, its pose row by row, and its first point and the one behind its last.
pub(crate) type ScanRow = (Option<String>, [[f64; 4]; 4], [usize; 2]);

impl From<PointCloud> for Cloud {
    fn from(cloud: PointCloud) -> Self {
        Self { cloud: Arc::new(cloud), camera: None }
    }
}

impl Cloud {
    /// The same points with something changed.
    fn changed(&self, cloud: PointCloud) -> Self {
        Self { cloud: Arc::new(cloud), camera: self.camera }
    }
}

#[pymethods]
impl Cloud {
    /// Points of an array, and attributes of others.
    #[new]
    #[pyo3(signature = (positions, colors, fields, axes, scans, crs_wkt, exact))]
    fn new(
        positions: &Bound<'_, PyAny>,
        colors: Option<PyReadonlyArray2<'_, u8>>,
        fields: Vec<(String, Bound<'_, PyAny>)>,
        axes: Option<&str>,
        scans: Vec<ScanRow>,
        crs_wkt: Option<&str>,
        exact: bool,
    ) -> PyResult<Self> {
        let cloud = convert::cloud(positions, exact)?;
        let crs = crs_wkt.map(Crs::from_wkt).unwrap_or_default();
        attributed(cloud, colors, fields, axes, scans, crs).map(Self::from)
    }

    /// The cloud of a [state](Self::state).
    #[staticmethod]
    #[pyo3(signature = (origin, positions, residuals, colors, fields, axes, scans, crs, resolution, camera))]
    #[allow(clippy::too_many_arguments, reason = "all that a cloud is")]
    fn of_state(
        origin: [f64; 3],
        positions: PyReadonlyArray2<'_, f32>,
        residuals: Option<PyReadonlyArray2<'_, f32>>,
        colors: Option<PyReadonlyArray2<'_, u8>>,
        fields: Vec<(String, Bound<'_, PyAny>)>,
        axes: Option<&str>,
        scans: Vec<ScanRow>,
        crs: &str,
        resolution: Option<[f64; 3]>,
        camera: Option<&str>,
    ) -> PyResult<Self> {
        let rows = |array: &PyReadonlyArray2<'_, f32>| {
            let array = array.as_array();
            array.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect::<Vec<_>>()
        };
        let mut cloud = PointCloud::new(origin.into(), rows(&positions));
        if let Some(residuals) = residuals {
            cloud = cloud.with_residuals(rows(&residuals)).map_err(|error| Failure::Cloud(error).raise())?;
        }
        let bad = |error: serde_json::Error| errors::raise(Class::Argument, format!("state of a cloud: {error}"));
        if let Some(step) = resolution {
            cloud = cloud.with_resolution(step.into());
        }
        let cloud = attributed(cloud, colors, fields, axes, scans, serde_json::from_str(crs).map_err(bad)?)?;
        let camera = camera.map(serde_json::from_str).transpose().map_err(bad)?;
        Ok(Self { cloud: Arc::new(cloud), camera })
    }

    /// All that the cloud is, for pickling.
    fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let this = slf.get();
        let cloud = &this.cloud;
        let state = PyDict::new(slf.py());
        state.set_item("origin", cloud.origin().to_array())?;
        state.set_item("positions", Self::positions(slf)?)?;
        let residuals = cloud.residuals().map(|rows| view(rows.as_flattened(), (rows.len(), 3), slf.as_any().clone()));
        state.set_item("residuals", residuals.transpose()?)?;
        state.set_item("colors", Self::colors(slf)?)?;
        let fields = cloud.fields().iter().map(|field| Ok((field.name.clone(), Self::field(slf, &field.name)?)));
        state.set_item("fields", fields.collect::<PyResult<Vec<_>>>()?)?;
        state.set_item("axes", this.axes())?;
        state.set_item("scans", this.scans())?;
        let written = |error: serde_json::Error| Failure::Fault(error.to_string()).raise();
        state.set_item("crs", serde_json::to_string(cloud.crs()).map_err(written)?)?;
        state.set_item("resolution", cloud.resolution().map(|step| step.to_array()))?;
        let camera = this.camera.as_ref().map(serde_json::to_string).transpose().map_err(written)?;
        state.set_item("camera", camera)?;
        Ok(state)
    }

    fn __len__(&self) -> usize {
        self.cloud.len()
    }

    /// Positions about the origin, a view.
    #[getter]
    fn positions<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let rows = slf.get().cloud.positions();
        Ok(view(rows.as_flattened(), (rows.len(), 3), slf.as_any().clone())?.into_any())
    }

    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.cloud.origin().to_array()
    }

    /// World coordinates, a new array.
    fn xyz<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let cloud = &self.cloud;
        let rows = py.detach(|| (0..cloud.len()).map(|i| cloud.world_position(i).to_array()).collect());
        convert::rows(py, rows)
    }

    /// Colours, a view.
    #[getter]
    fn colors<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(rows) = slf.get().cloud.colors() else { return Ok(None) };
        Ok(Some(view(rows.as_flattened(), (rows.len(), 3), slf.as_any().clone())?.into_any()))
    }

    #[getter]
    fn field_names(&self) -> Vec<String> {
        self.cloud.fields().iter().map(|field| field.name.clone()).collect()
    }

    /// Values of a field, a view.
    fn field<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let this = slf.get();
        let Some(field) = this.cloud.field(name) else {
            let names = this.field_names().join(", ");
            let has = if names.is_empty() { "it has none".to_owned() } else { format!("it has {names}") };
            return Err(errors::raise(Class::Missing, format!("the cloud has no field {name}; {has}")));
        };
        each_type!(&field.values, values => Ok(view(values, values.len(), slf.as_any().clone())?.into_any()))
    }

    #[getter]
    fn axes(&self) -> Option<&'static str> {
        self.cloud.axes().map(Axes::name)
    }

    #[getter]
    fn scans(&self) -> Vec<ScanRow> {
        let row = |scan: &Scan| {
            let Scan { name, world_from_sensor, points } = scan;
            (name.clone(), world_from_sensor.transpose().to_cols_array_2d(), [points.start, points.end])
        };
        self.cloud.scans().iter().map(row).collect()
    }

    /// Name, EPSG code, definition and unit of the coordinate system.
    #[getter]
    fn crs(&self) -> (Option<String>, Option<u32>, Option<String>, Option<&'static str>) {
        let Crs { name, epsg, wkt, unit, .. } = self.cloud.crs();
        (name.clone(), *epsg, wkt.clone(), unit.map(|unit| unit.name()))
    }

    /// The least and the largest finite world coordinates; None without a finite point.
    fn bounds(&self, py: Python<'_>) -> Option<[[f64; 3]; 2]> {
        let cloud = &self.cloud;
        let ends = py.detach(|| {
            let finite = (0..cloud.len()).map(|i| cloud.world_position(i)).filter(|point| point.is_finite());
            finite.map(|point| [point; 2]).reduce(|[low, high], [a, b]| [low.min(a), high.max(b)])
        });
        ends.map(|ends| ends.map(|end: DVec3| end.to_array()))
    }

    /// The points where the mask is true, in their order.
    fn masked(&self, py: Python<'_>, mask: PyReadonlyArray1<'_, bool>) -> PyResult<Self> {
        let mask = mask.as_array().to_vec();
        if mask.len() != self.cloud.len() {
            let what = format!("mask: {} values for {} points", mask.len(), self.cloud.len());
            return Err(errors::raise(Class::Argument, what));
        }
        let kept = run(py, None, None, |_| {
            let mut cloud = (*self.cloud).clone();
            cloud.retain(|i| mask[i]);
            Ok(cloud)
        })?;
        Ok(self.changed(kept))
    }

    /// Which points lie within `radii` (m) of `centers` (m, 3), world coordinates, spheres included.
    fn near<'py>(
        &self,
        py: Python<'py>,
        centers: PyReadonlyArray2<'_, f64>,
        radii: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let centers = centers.as_array();
        let balls: Vec<(DVec3, f64)> = centers
            .rows()
            .into_iter()
            .zip(radii.as_array())
            .map(|(center, &radius)| (DVec3::new(center[0], center[1], center[2]), radius))
            .collect();
        let near = run(py, None, None, |watch| near(&self.cloud, &balls, watch))?;
        Ok(PyArray1::from_vec(py, near))
    }

    /// One point per occupied cube.
    fn thinned(
        &self,
        py: Python<'_>,
        voxel: f64,
        threads: Option<usize>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let thinned = run(py, threads, progress, |watch| {
            let mut cloud = (*self.cloud).clone();
            cloud.thin_by_voxel(voxel, watch)?;
            Ok(cloud)
        })?;
        Ok(self.changed(thinned))
    }

    /// The same points with a field more, or with another of its name.
    fn with_field(&self, name: String, values: &Bound<'_, PyAny>) -> PyResult<Self> {
        let values = convert::field(&name, values)?;
        let cloud = (*self.cloud).clone().with_field(name, values).map_err(|error| Failure::Cloud(error).raise())?;
        Ok(self.changed(cloud))
    }

    /// All clouds as one.
    #[staticmethod]
    fn merged(py: Python<'_>, clouds: Vec<PyRef<'_, Self>>) -> PyResult<Self> {
        let clouds: Vec<Arc<PointCloud>> = clouds.iter().map(|cloud| Arc::clone(&cloud.cloud)).collect();
        let merged = run(py, None, None, |_| {
            let parts: Vec<_> = clouds.iter().map(|cloud| (&**cloud, DMat4::IDENTITY)).collect();
            Ok(PointCloud::merged(&parts))
        })?;
        Ok(merged.into())
    }

    /// Size in memory, in bytes.
    #[getter]
    fn nbytes(&self) -> usize {
        self.cloud.byte_len()
    }
}

/// Points that are compared with the same balls. Neighbours in a file are mostly neighbours in space.
const PIECE: usize = 1 << 10;

/// Which points lie in one of some balls. Pieces of the cloud are compared with the balls that meet their boxes.
fn near(cloud: &PointCloud, balls: &[(DVec3, f64)], watch: &Watch) -> Result<Vec<bool>, Failure> {
    let mut near = vec![false; cloud.len()];
    near.par_chunks_mut(PIECE).enumerate().try_for_each(|(piece, near)| {
        if !watch.goes_on() {
            return Err(Failure::Cancelled);
        }
        let points: Vec<DVec3> = (0..near.len()).map(|i| cloud.world_position(piece * PIECE + i)).collect();
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [low, high] = points.iter().fold(none, |[low, high], point| [low.min(*point), high.max(*point)]);
        let distance = |from: DVec3, to: DVec3| from.distance_squared(to);
        let meets = |(center, radius): &&(DVec3, f64)| distance(*center, center.clamp(low, high)) <= radius * radius;
        let balls: Vec<&(DVec3, f64)> = balls.iter().filter(meets).collect();
        for (near, point) in near.iter_mut().zip(points) {
            *near = balls.iter().any(|(center, radius)| distance(*center, point) <= radius * radius);
        }
        Ok(())
    })?;
    Ok(near)
}

/// Adds attributes to positions.
fn attributed(
    mut cloud: PointCloud,
    colors: Option<PyReadonlyArray2<'_, u8>>,
    fields: Vec<(String, Bound<'_, PyAny>)>,
    axes: Option<&str>,
    scans: Vec<ScanRow>,
    crs: Crs,
) -> PyResult<PointCloud> {
    let failed = |error| Failure::Cloud(error).raise();
    if let Some(colors) = colors {
        cloud = cloud.with_colors(convert::colors(&colors)).map_err(failed)?;
    }
    for (name, values) in fields {
        let values = convert::field(&name, &values)?;
        cloud = cloud.with_field(name, values).map_err(failed)?;
    }
    if let Some(name) = axes {
        cloud = cloud.with_axes(named_axes(name)?);
    }
    let count = cloud.len();
    let scan = |(name, rows, [start, end]): ScanRow| {
        if start > end || end > count {
            let what = format!("sensor: points {start} to {end} of {count}");
            return Err(errors::raise(Class::Argument, what));
        }
        Ok(Scan { name, world_from_sensor: DMat4::from_cols_array_2d(&rows).transpose(), points: start..end })
    };
    let scans = scans.into_iter().map(scan).collect::<PyResult<Vec<_>>>()?;
    if !scans.is_empty() {
        cloud = cloud.with_scans(scans);
    }
    Ok(cloud.with_crs(crs))
}

/// The axes of this name.
pub(crate) fn named_axes(name: &str) -> PyResult<Axes> {
    Axes::from_name(name).ok_or_else(|| {
        let known = Axes::ALL.map(Axes::name).join(", ");
        errors::raise(Class::Argument, format!("axes is '{name}', must be one of {known}"))
    })
}
