//! The list of layers.

use std::sync::Arc;

use autosplats::cloud::{
    Crs, PointCloud, Scan, Unit,
    glam::{DMat4, DVec3},
};

use super::{Bits, Counts, Document, Layer, LayerId, LayerTree, bounds_of, layer::Edits};

/// Largest number of points of an overview: enough to find the size of a scene.
const OVERVIEW_POINT_COUNT: usize = 100_000;

impl Document {
    /// Appends a layer. A layer in degrees shares the metric map of the layers in degrees before it.
    pub(crate) fn add(&mut self, mut layer: Layer) -> LayerId {
        let beside = self.layers.iter().find_map(|other| other.local.as_ref());
        layer.local = layer.local.and_then(|own| layer.cloud.local_metres(Some(beside.unwrap_or(&own))));
        let id = layer.id;
        self.layers.push(layer);
        id
    }

    /// The layer with this id, if there is one.
    pub(crate) fn layer(&self, id: LayerId) -> Option<&Layer> {
        self.layers.iter().find(|layer| layer.id == id)
    }

    fn change(&mut self, id: LayerId, change: impl FnOnce(&mut Layer)) -> bool {
        let layer = self.layers.iter_mut().find(|layer| layer.id == id);
        layer.map(change).is_some()
    }

    /// Removes a layer and returns it. Ask the user first if it has [unsaved](super::History::is_unsaved) edits.
    pub(crate) fn remove(&mut self, id: LayerId) -> Option<Layer> {
        let place = self.layers.iter().position(|layer| layer.id == id)?;
        Some(self.layers.remove(place))
    }

    /// Moves a layer to a place in the list, or to its end. Returns whether the layer exists.
    pub(crate) fn reorder(&mut self, id: LayerId, place: usize) -> bool {
        let Some(layer) = self.remove(id) else { return false };
        self.layers.insert(place.min(self.layers.len()), layer);
        true
    }

    /// Renames a layer. Returns whether the layer exists.
    pub(crate) fn rename(&mut self, id: LayerId, name: impl Into<String>) -> bool {
        self.change(id, |layer| layer.name = name.into())
    }

    /// Shows or hides a layer. Returns whether the layer exists.
    pub(crate) fn set_visible(&mut self, id: LayerId, visible: bool) -> bool {
        self.change(id, |layer| layer.visible = visible)
    }

    /// Shows a layer in one colour, or with `None` in its own colours. Returns whether the layer exists.
    pub(crate) fn set_tint(&mut self, id: LayerId, tint: Option<[u8; 3]>) -> bool {
        self.change(id, |layer| layer.tint = tint)
    }

    /// Places a layer in the world. A map that is not affine, or has no inverse, is refused.
    pub(crate) fn set_pose(&mut self, id: LayerId, pose: DMat4) -> bool {
        can_place(&pose) && self.change(id, |layer| layer.pose = pose)
    }

    /// Replaces the points of a layer. Edits of single points are dropped, as the new points may be different ones.
    pub(crate) fn reload(&mut self, id: LayerId, cloud: &Arc<PointCloud>) {
        self.change(id, |layer| {
            // A layer that is still in degrees keeps its map.
            layer.local = cloud.local_metres(layer.local.as_ref());
            (layer.cloud, layer.edits, layer.tree) = (Arc::clone(cloud), Edits::default(), None);
        });
    }

    /// Makes a layer one of an octree. Its points are replaced, and edits of single points dropped.
    pub(crate) fn set_tree(&mut self, id: LayerId, tree: &LayerTree, cloud: &Arc<PointCloud>) {
        self.reload(id, cloud);
        self.layers.iter_mut().filter(|layer| layer.id == id).for_each(|layer| layer.tree = Some(tree.clone()));
    }

    /// Shows other nodes of an octree. Nothing changes if the layer shows another octree.
    pub(crate) fn show_nodes(&mut self, id: LayerId, shown: &LayerTree, cloud: &Arc<PointCloud>) {
        let same = |layer: &&mut Layer| {
            layer.id == id && layer.tree.as_ref().is_some_and(|tree| Arc::ptr_eq(&tree.open, &shown.open))
        };
        for layer in self.layers.iter_mut().filter(same) {
            layer.cloud = Arc::clone(cloud);
            layer.tree = Some(shown.clone());
        }
    }

    /// The visible layers of octrees.
    pub(crate) fn trees(&self) -> impl Iterator<Item = (&Layer, &LayerTree)> {
        self.layers.iter().filter(|layer| layer.visible).filter_map(|layer| Some((layer, layer.tree.as_ref()?)))
    }

    /// Hides these points of a layer and shows all others.
    pub(crate) fn set_hidden(&mut self, id: LayerId, hidden: &Bits) {
        self.change(id, |layer| layer.edits.hidden = hidden.clone());
    }

    /// Sets whether points are still to come or to change, so that the layer cannot be edited.
    pub(crate) fn set_incomplete(&mut self, id: LayerId, incomplete: bool) {
        self.change(id, |layer| layer.incomplete = incomplete);
    }

    /// Marks a layer as completely read, so that it can be edited.
    pub(crate) fn complete(&mut self, id: LayerId) {
        self.set_incomplete(id, false);
    }

    /// A regular subset of the shown points, for views of the whole scene.
    pub(crate) fn overview(&self) -> PointCloud {
        self.part_of(|layer, point| layer.has(point))
    }

    /// A regular subset of the selected points.
    pub(crate) fn selected_overview(&self) -> PointCloud {
        self.part_of(|layer, point| layer.has(point) && layer.edits.selected.get(point))
    }

    fn part_of(&self, has: impl Fn(&Layer, usize) -> bool) -> PointCloud {
        let sampled: Vec<Layer> = self.layers.iter().map(Layer::as_sampled).collect();
        let visible = || sampled.iter().filter(|layer| layer.visible);
        let total: usize = visible().map(|layer| layer.cloud.len()).sum();
        let step = total.div_ceil(OVERVIEW_POINT_COUNT).max(1);
        let clip = self.clip.as_ref().filter(|clip| clip.enabled);
        let mut places = Vec::new();
        for layer in visible() {
            let points = (0..layer.cloud.len()).step_by(step).filter(|&point| has(layer, point));
            let own = points.map(|point| layer.position(point));
            places.extend(own.filter(|place| place.is_finite() && clip.is_none_or(|clip| clip.contains(*place))));
        }
        let origin = places.first().map_or(DVec3::ZERO, |place: &DVec3| place.round());
        // Places of sensors help to choose a view; their points do not matter. For points in a frame of their own the
        // sensor may be at the origin.
        let at = |world_from_sensor| Scan { name: None, world_from_sensor, points: 0..0 };
        let sensors = |layer: &Layer| {
            let place = |scan: &Scan| layer.local.map_or(scan.position(), |local| local.metres(scan.position()));
            let mut places: Vec<DVec3> = layer.cloud.scans().iter().map(place).collect();
            if places.is_empty() && *layer.cloud.crs() == Crs::default() {
                places.push(DVec3::ZERO);
            }
            let pose = layer.pose;
            places.into_iter().map(move |place| at(pose * DMat4::from_translation(place)))
        };
        let scans = visible().flat_map(sensors).collect();
        let known = visible().filter(|layer| *layer.cloud.crs() != Crs::default());
        let mut crs = known.map(|layer| match layer.local {
            Some(_) => Crs { unit: Some(Unit::Metre), ..Crs::default() },
            None => layer.cloud.crs().clone(),
        });
        let crs = crs.next().unwrap_or_default();
        PointCloud::new(origin, places.into_iter().map(|place| (place - origin).as_vec3().to_array()).collect())
            .with_scans(scans)
            .with_crs(crs)
    }

    /// Box around most of the shown points, by a subset of them.
    pub(crate) fn shown_bounds(&self) -> Option<[DVec3; 2]> {
        bounds_of(&self.overview())
    }

    /// Point counts of a layer. With a clipping box all selected points are tested, so do not call this in every frame.
    pub(crate) fn counts_of(&self, layer: &Layer) -> Counts {
        Counts {
            points: layer.cloud.len(),
            selected: self.reached(layer).count(),
            hidden: layer.edits.hidden.without(&layer.edits.deleted).count(),
            deleted: layer.edits.deleted.count(),
        }
    }

    /// Point counts of all layers.
    pub(crate) fn counts(&self) -> Counts {
        self.layers.iter().map(|layer| self.counts_of(layer)).fold(Counts::default(), |all, own| Counts {
            points: all.points + own.points,
            selected: all.selected + own.selected,
            hidden: all.hidden + own.hidden,
            deleted: all.deleted + own.deleted,
        })
    }
}

/// Whether a matrix is an affine map with an inverse.
pub(crate) fn can_place(matrix: &DMat4) -> bool {
    let affine = matrix.is_finite() && matrix.row(3).to_array() == [0.0, 0.0, 0.0, 1.0];
    affine && matrix.determinant() != 0.0 && matrix.inverse().is_finite()
}
