//! Exports edited points to a file.

use std::{
    borrow::Cow,
    path::{Path, PathBuf},
    sync::Arc,
};

use autosplats::cloud::{
    Error, Existing, Output, PointCloud, Progress, Scan, Unit, check_memory,
    glam::{DMat4, DQuat},
};
use autosplats_formats::{Part, ReadOptions, check_writable, files_beside, write};
use autosplats_sources::read_tree;

use super::{ClipBox, Document, Layer, LayerId, LayerTree, bounds::box_of, shown::points_where};

/// Which points to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ExportScope {
    /// The visible points.
    Shown,
    /// The selected points that are visible.
    Selected,
    /// The points of one layer that are not deleted, including hidden ones.
    Layer(LayerId),
    /// The points of all layers that are not deleted, including hidden ones and those of invisible layers.
    All,
}

/// Which files may be replaced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Replace {
    /// No file.
    #[default]
    Nothing,
    /// A file that no layer was read from.
    Files,
    /// Even a file that a layer was read from. The layer keeps the points that it has, so that its point information
    /// describes the old file until it is opened again.
    Inputs,
}

/// Result of an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Exported {
    /// Number of points written.
    pub(crate) points: usize,
}

/// Why nothing was written. All files are unchanged.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ExportError {
    /// There are no points to write.
    #[error("there are no points to write")]
    Nothing,
    /// The file is the source of an open layer.
    #[error("{}: the layer '{layer}' was read from this file; replacing it needs your consent", path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// Name of the layer.
        layer: String,
    },
    /// The file exists already.
    #[error("{}: the file exists already", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The export was cancelled.
    #[error("cancelled")]
    Cancelled,
    /// The points could not be written.
    #[error(transparent)]
    Cloud(Error),
}

impl From<Error> for ExportError {
    fn from(error: Error) -> Self {
        match error {
            Error::Cancelled => Self::Cancelled,
            error => Self::Cloud(error),
        }
    }
}

/// Writes points in the format given by the extension of `path`. Deleted points are left out; moves and poses are
/// applied. Attributes, scans, coordinate system and coordinate resolution stay as read. Colours are the points' own.
/// Octrees are read in full detail: the visible points are those inside the clipping box, wherever the view is.
///
/// Several layers become one cloud by [merging](PointCloud::merge). Layers in degrees stay in degrees, unless other
/// layers are not; then all are written in metres, as shown. Losses are reported to `progress`. The file appears
/// complete or not at all.
///
/// # Errors
/// [`ExportError`]; nothing was written.
pub(crate) fn export(
    document: &Document,
    what: ExportScope,
    path: &Path,
    replace: Replace,
    progress: &dyn Progress,
) -> Result<Exported, ExportError> {
    check_writable(path)?;
    check_target(document, path, replace)?;
    let document = &with_trees_read(document, what, progress)?;
    let layers = document.layers.iter().filter(|layer| match what {
        ExportScope::Shown | ExportScope::Selected => layer.visible,
        ExportScope::Layer(id) => layer.id == id,
        ExportScope::All => true,
    });
    let layers = layers.map(|layer| (layer, chosen(document, layer, what)));
    let layers = layers.filter(|(layer, points)| points.as_ref().map_or(layer.cloud.len(), Vec::len) > 0);
    let layers: Vec<_> = layers.collect();
    let degrees = layers.iter().all(|(layer, _)| layer.cloud.crs().unit == Some(Unit::Degree));
    let bytes: usize = layers.iter().map(|(layer, points)| layer.exact_bytes(points.as_deref(), degrees)).sum();
    let merged: usize = layers.iter().skip(1).map(|(layer, _)| layer.cloud.byte_len()).sum();
    check_memory("the points to be written", (bytes + 2 * merged) as u64)?;
    let mut clouds: Vec<_> = layers.iter().map(|(layer, points)| layer.exact(points.as_deref(), degrees)).collect();
    if progress.cancelled() {
        return Err(ExportError::Cancelled);
    }
    let cloud = match clouds.as_mut_slice() {
        [] => return Err(ExportError::Nothing),
        [only] => std::mem::take(only),
        [first, others @ ..] => {
            if others.iter().any(|other| other.origin() != first.origin()) {
                // With residuals in one part, merging keeps all digits of all parts.
                with_digits(first.to_mut());
            }
            tell_losses(&clouds, progress);
            Cow::Owned(PointCloud::merged(&clouds.iter().map(|cloud| (&**cloud, DMat4::IDENTITY)).collect::<Vec<_>>()))
        }
    };
    let existing = if replace < Replace::Files { Existing::Keep } else { Existing::Replace };
    write(&cloud, Output { path, existing }, progress)?;
    Ok(Exported { points: cloud.len() })
}

/// The document with all points of its octrees that `what` may choose, which the layers have in part only.
fn with_trees_read(document: &Document, what: ExportScope, progress: &dyn Progress) -> Result<Document, Error> {
    let mut document = document.clone();
    let is_shown = what == ExportScope::Shown;
    let clip = document.clip.filter(|clip| is_shown && clip.enabled);
    for layer in &mut document.layers {
        let written = match what {
            ExportScope::Shown => layer.visible,
            ExportScope::Selected => false,
            ExportScope::Layer(id) => layer.id == id,
            ExportScope::All => true,
        };
        let Some(LayerTree { open, .. }) = layer.tree.take().filter(|_| written) else { continue };
        let keep = open.options.keep.clone().filter(|_| is_shown);
        let options = ReadOptions { exact: true, keep, ..open.options.clone() };
        layer.cloud = Arc::new(read_tree(&*open.tree, &part_in(clip.as_ref(), &layer.pose), &options, progress)?);
    }
    Ok(document)
}

/// The part of an octree that a box in the world needs. The points of a box that is turned or posed have to be tested
/// once more.
fn part_in(clip: Option<&ClipBox>, pose: &DMat4) -> Part {
    let bounds = clip.map(|clip| {
        if clip.rotation == DQuat::IDENTITY && *pose == DMat4::IDENTITY {
            return [clip.min, clip.max];
        }
        let tree_from_world = pose.inverse();
        let [low, high] = box_of(clip.corners().map(|corner| tree_from_world.transform_point3(corner)));
        let slack = 1e-12 * low.abs().max(high.abs());
        [low - slack, high + slack]
    });
    Part { bounds, ..Part::default() }
}

/// The points of a layer to write; `None` for all.
fn chosen(document: &Document, layer: &Layer, what: ExportScope) -> Option<Vec<u32>> {
    let len = layer.cloud.len();
    match what {
        ExportScope::Shown => document.seen(layer),
        ExportScope::Selected => {
            let reached = document.reached(layer);
            points_where(len, |point| reached.get(point))
        }
        ExportScope::Layer(_) | ExportScope::All => points_where(len, |point| !layer.edits.deleted.get(point)),
    }
}

impl Layer {
    fn is_moved(&self) -> bool {
        !self.edits.moves.is_empty() || self.pose != DMat4::IDENTITY
    }

    /// Largest number of bytes that [`exact`](Self::exact) takes.
    fn exact_bytes(&self, points: Option<&[u32]>, degrees: bool) -> usize {
        let copies = match (points, self.is_moved(), self.local.filter(|_| !degrees)) {
            (None, false, None) => return 0,
            // Placing by a pose makes a second copy.
            (_, true, _) if self.pose != DMat4::IDENTITY => 2,
            _ => 1,
        };
        let part = points.map_or(1.0, |points| points.len() as f64 / self.cloud.len().max(1) as f64);
        let digits = size_of::<[f32; 3]>() * self.cloud.len();
        (part * (copies * (self.cloud.byte_len() + digits)) as f64) as usize
    }

    /// The points with the given indices, or all, moved and placed with all digits. The result is in the file's degrees
    /// if `degrees`, else in metres. An unchanged layer is not copied.
    pub(super) fn exact(&self, points: Option<&[u32]>, degrees: bool) -> Cow<'_, PointCloud> {
        let (moved, converted) = (self.is_moved(), self.local.filter(|_| !degrees));
        if points.is_none() && !moved && converted.is_none() {
            return Cow::Borrowed(&self.cloud);
        }
        let mut cloud = points.map_or_else(|| (*self.cloud).clone(), |points| self.cloud.pick(points));
        if let Some(local) = &converted {
            cloud.to_metres_on(local);
        }
        if !moved {
            return Cow::Owned(cloud);
        }
        with_digits(&mut cloud);
        self.move_points(&mut cloud, points, degrees);
        if self.pose == DMat4::IDENTITY {
            return Cow::Owned(cloud);
        }
        let Some(local) = self.local.filter(|_| degrees) else {
            return Cow::Owned(PointCloud::merged(&[(&cloud, self.pose)]));
        };
        cloud.move_points(|_| true, &self.pose, Some(&local));
        let scans = cloud.scans().iter().map(|scan| {
            let place = local.degrees(self.pose.transform_point3(local.metres(scan.position())));
            Scan { world_from_sensor: with_place(self.pose * scan.world_from_sensor, place), ..scan.clone() }
        });
        let scans = scans.collect();
        Cow::Owned(cloud.with_scans(scans))
    }
}

fn with_place(mut matrix: DMat4, place: autosplats::cloud::glam::DVec3) -> DMat4 {
    matrix.w_axis = place.extend(1.0);
    matrix
}

/// Adds residuals to a cloud, for digits that `f32` cannot hold.
fn with_digits(cloud: &mut PointCloud) {
    if cloud.residuals().is_none() {
        let zeros = vec![[0.0; 3]; cloud.len()];
        let own = std::mem::take(cloud);
        *cloud = own.with_residuals(zeros).unwrap_or_else(|error| unreachable!("one each: {error}"));
    }
}

/// Reports attributes and coordinate systems that merging drops, as not all parts have them.
fn tell_losses(clouds: &[Cow<'_, PointCloud>], progress: &dyn Progress) {
    let [first, others @ ..] = clouds else { return };
    for cloud in clouds {
        let missing = |name: &str| clouds.iter().any(|other| other.fields().iter().all(|field| field.name != name));
        for field in cloud.fields().iter().filter(|field| missing(&field.name)) {
            progress.note(&format!("not all layers have {}; it is left out", field.name));
        }
    }
    if others.iter().any(|other| other.crs() != first.crs()) {
        progress.note("the layers differ in their coordinate systems; none is kept");
    }
}

/// Refuses files that must not be replaced.
fn check_target(document: &Document, path: &Path, replace: Replace) -> Result<(), ExportError> {
    let Ok(target) = path.canonicalize() else {
        // A dangling link also counts as an existing file.
        let there = path.symlink_metadata().is_ok() && replace < Replace::Files;
        return if there { Err(ExportError::Exists { path: path.into() }) } else { Ok(()) };
    };
    let input = document.layers.iter().find(|layer| {
        let beside = layer.path.iter().flat_map(|path| files_beside(path));
        layer.path.iter().cloned().chain(beside).any(|path| path.canonicalize().is_ok_and(|path| path == target))
    });
    match input {
        Some(layer) if replace < Replace::Inputs => {
            Err(ExportError::Input { path: path.into(), layer: layer.name.clone() })
        }
        None if replace < Replace::Files => Err(ExportError::Exists { path: path.into() }),
        _ => Ok(()),
    }
}
