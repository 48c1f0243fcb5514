//! Files, scenes and other sources to clouds, and clouds to files.

use std::path::{Path, PathBuf};

use autosplats::{Camera, Projection};
use autosplats_cloud::glam::DVec3;
use autosplats_cloud::{Draft, Error, Existing, Output, PointCloud, PointFilter, Progress};
use autosplats_formats::{Part, ReadOptions, check_writable};
use autosplats_scenes::View;
use autosplats_sources::{Source, read_tree};
use pyo3::prelude::*;

use crate::cloud::Cloud;
use crate::errors::Failure;
use crate::wait::run;

/// Options of reading, as Python hands them over.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Reading {
    exact: bool,
    columns: Option<Vec<String>>,
    keep: Option<String>,
    keep_no_returns: bool,
    headers: Vec<String>,
    whole: bool,
    bounds: Option<[[f64; 3]; 2]>,
}

impl Reading {
    /// Corners of the box that points are read of.
    fn bounds(&self) -> Option<[DVec3; 2]> {
        self.bounds.map(|corners| corners.map(DVec3::from))
    }

    /// The options for the libraries.
    pub(crate) fn options(self) -> PyResult<ReadOptions> {
        let Self { exact, columns, keep, keep_no_returns, headers, whole, bounds: _ } = self;
        let keep = keep.map(|words| words.parse::<PointFilter>()).transpose();
        let keep = keep.map_err(|error| Failure::Cloud(error).raise())?;
        Ok(ReadOptions { exact, columns, keep, keep_no_returns, headers, whole, ..ReadOptions::default() })
    }
}

/// Reads a source by its name: a file, a folder, an address or a scene. Of bounds, octrees read the nodes that they
/// need.
#[pyfunction]
pub(crate) fn read_source(
    py: Python<'_>,
    name: &str,
    options: Reading,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Cloud> {
    let bounds = options.bounds();
    let options = options.options()?;
    let (cloud, camera) = run(py, threads, progress, |watch| {
        let source = Source::parse(name)?;
        autosplats_cloud::check_memory("the points of the scene", source.least_bytes())?;
        let cloud = match bounds {
            Some(bounds) => within(&source, bounds, &options, watch)?,
            None => source.read(&options, watch)?,
        };
        let camera = match &source {
            Source::Scene(scene, _) => {
                let View { eye, look_at, up, fov_degrees } = scene.view();
                Some(Camera { eye, look_at, up, projection: Projection::PerspectiveFovDeg(fov_degrees) })
            }
            _ => None,
        };
        Ok((cloud, camera))
    })?;
    Ok(Cloud { cloud: cloud.into(), camera })
}

/// Reads the bytes of a file; its name helps to recognise the format.
#[pyfunction]
pub(crate) fn read_bytes(
    py: Python<'_>,
    bytes: &[u8],
    name: PathBuf,
    options: Reading,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Cloud> {
    let bounds = options.bounds();
    let options = options.options()?;
    let cloud = run(py, threads, progress, |watch| {
        let mut cloud = autosplats_formats::read_bytes(&name, bytes, &options, watch)?;
        bounds.iter().for_each(|&[low, high]| cloud.crop(low, high));
        Ok(cloud)
    })?;
    Ok(cloud.into())
}

/// The points of a source inside a box.
fn within(
    source: &Source,
    [low, high]: [DVec3; 2],
    options: &ReadOptions,
    progress: &dyn Progress,
) -> Result<PointCloud, Error> {
    if let Some(tree) = source.open_tree(options, progress)? {
        return read_tree(&*tree, &Part { bounds: Some([low, high]), ..Part::default() }, options, progress);
    }
    let mut cloud = source.read(options, progress)?;
    cloud.crop(low, high);
    Ok(cloud)
}

/// Writes a cloud in the format of the path's extension. The file appears whole or not at all.
#[pyfunction]
pub(crate) fn write(
    py: Python<'_>,
    cloud: &Cloud,
    path: PathBuf,
    overwrite: bool,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    check_writable(&path).map_err(|error| Failure::Cloud(error).raise())?;
    let output = output(&path, overwrite)?;
    run(py, threads, progress, |watch| {
        let written = autosplats_formats::write(&cloud.cloud, output, watch).map_err(|error| match error {
            Error::Io { path, source } => Failure::Io(path, source),
            error => error.into(),
        });
        written.map(|_bytes| ())
    })
}

/// The output of a path. Raises OSError if it cannot be written, or exists and must not be overwritten.
pub(crate) fn output(path: &Path, overwrite: bool) -> PyResult<Output<'_>> {
    let output = Output { path, existing: if overwrite { Existing::Replace } else { Existing::Keep } };
    // Beginning a file is the only reliable check that one can be written.
    Draft::begin(output, ".tmp").map_err(|error| Failure::Io(path.into(), error).raise())?;
    Ok(output)
}
