//! What jobs over many files plan by: outlines of files, and the nodes of octrees.

use std::path::Path;

use autosplats_cloud::{Crs, Key, Node, Progress, Tree};
use autosplats_formats::{Description, ReadOptions, describe};
use autosplats_sources::Source;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert;
use crate::errors::Failure;
use crate::wait::run;

/// What the header of a file or of an octree states.
struct Outline {
    points: Option<u64>,
    bounds: Option<[[f64; 3]; 2]>,
    crs: Crs,
    is_tree: bool,
}

impl Outline {
    fn of(name: &str, progress: &dyn Progress) -> Result<Self, Failure> {
        let options = ReadOptions::default();
        let source = Source::parse(name)?;
        if let Some(tree) = source.open_tree(&options, progress)? {
            let info = tree.info();
            let bounds = Some(info.bounds.map(|corner| corner.to_array()));
            return Ok(Self { points: Some(info.points), bounds, crs: info.crs.clone(), is_tree: true });
        }
        let Description { points, bounds, crs, .. } = describe(name.as_ref(), &options)?;
        let bounds = bounds.map(|bounds| bounds.map(|corner| corner.to_array()));
        Ok(Self { points, bounds, crs, is_tree: false })
    }
}

/// Number of points, least and greatest coordinates, name of the unit of x and y, and whether parts of the file can be
/// read without the rest. Values that the header does not state are None.
#[pyfunction]
pub(crate) fn outline<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyDict>> {
    let found = if Path::new(name).is_file() {
        // A header takes less time than a thread that waits for signals.
        py.detach(|| Outline::of(name, &())).map_err(Failure::raise)?
    } else {
        run(py, Some(1), None, |watch| Outline::of(name, watch))?
    };
    let values = PyDict::new(py);
    values.set_item("points", found.points)?;
    values.set_item("bounds", found.bounds)?;
    values.set_item("unit", found.crs.unit.map(|unit| unit.name()))?;
    values.set_item("is_tree", found.is_tree)?;
    Ok(values)
}

/// Nodes of an octree that have points: lowest and highest corners (n, 3) in world coordinates, numbers of points (n)
/// and of stored bytes (n), from coarse to fine. None for what is no octree.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "four arrays")]
pub(crate) fn tree_nodes<'py>(
    py: Python<'py>,
    name: &str,
) -> PyResult<Option<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyArray1<u64>>, Bound<'py, PyArray1<u64>>)>> {
    let found = run(py, None, None, |watch| {
        let Some(tree) = Source::parse(name)?.open_tree(&ReadOptions::default(), watch)? else { return Ok(None) };
        nodes(&*tree, watch).map(Some)
    })?;
    let Some(Nodes { lows, highs, points, bytes }) = found else { return Ok(None) };
    let (lows, highs) = (convert::rows(py, lows)?, convert::rows(py, highs)?);
    Ok(Some((lows, highs, PyArray1::from_vec(py, points), PyArray1::from_vec(py, bytes))))
}

/// Nodes as columns.
#[derive(Default)]
struct Nodes {
    lows: Vec<[f64; 3]>,
    highs: Vec<[f64; 3]>,
    points: Vec<u64>,
    bytes: Vec<u64>,
}

fn nodes(tree: &dyn Tree, progress: &dyn Progress) -> Result<Nodes, Failure> {
    let cube = tree.info().cube;
    let mut nodes = Nodes::default();
    let mut level = vec![Key::ROOT];
    while !level.is_empty() {
        let unknown: Vec<Key> = level.iter().copied().filter(|&key| tree.node(key) == Node::Unknown).collect();
        tree.load_pages(&unknown, progress)?;
        let mut next = Vec::new();
        for key in level {
            let Node::Known { points, bytes } = tree.node(key) else { continue };
            next.extend(key.children().filter(|&child| tree.node(child) != Node::Absent));
            if points > 0 {
                let [low, high] = key.cube(cube);
                nodes.lows.push(low.to_array());
                nodes.highs.push(high.to_array());
                nodes.points.push(points.into());
                nodes.bytes.push(bytes);
            }
        }
        level = next;
    }
    Ok(nodes)
}
