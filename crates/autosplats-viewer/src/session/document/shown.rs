//! The one cloud that is rendered, and the origin of its points.

use std::{borrow::Cow, sync::Arc};

use autosplats::cloud::{PointCloud, glam::DMat4};
use rayon::prelude::*;

use super::{Bits, ClipBox, Document, Layer, LayerId};

/// The visible points of a document as one cloud, with the layer of each point. Clones share all large parts.
#[derive(Clone, Debug)]
pub(crate) struct ShownCloud {
    /// The points in world coordinates and in the colours shown. Positions have the precision of `f32` about the
    /// cloud's origin; [`Document::describe`] has all digits.
    pub(crate) cloud: Arc<PointCloud>,
    /// The document that the cloud was made from.
    of: Document,
    parts: Vec<LayerPart>,
}

/// The points of one layer, which are contiguous in the cloud.
#[derive(Clone, Debug)]
pub(super) struct LayerPart {
    pub(super) layer: LayerId,
    /// Index of the first point in the shown cloud.
    pub(super) start: usize,
    pub(super) len: usize,
    /// Indices of the points in the layer, ascending; `None` for all points.
    points: Option<Arc<[u32]>>,
}

impl LayerPart {
    /// Index in the layer of the point at `index` of this part.
    fn point(&self, index: usize) -> usize {
        self.points.as_ref().map_or(index, |points| points[index] as usize)
    }

    /// The layer's points that are shown and that `has` accepts, as a set below `len`. `has` takes the index in the
    /// shown cloud.
    pub(super) fn bits(&self, len: usize, has: impl Fn(usize) -> bool + Sync) -> Bits {
        let Some(points) = &self.points else {
            return Bits::from_fn(len.min(self.len), |point| has(self.start + point));
        };
        Bits::from_words(len, |word| {
            let first = points.partition_point(|&point| (point as usize) < word * 64);
            let own = points[first..].iter().take_while(|&&point| point as usize / 64 == word);
            own.enumerate().fold(0, |bits, (i, &point)| bits | u64::from(has(self.start + first + i)) << (point % 64))
        })
    }
}

impl Document {
    /// The clipping box, if it is enabled.
    fn clips(&self) -> Option<&ClipBox> {
        self.clip.as_ref().filter(|clip| clip.enabled)
    }

    fn visible(&self) -> impl Iterator<Item = &Layer> {
        self.layers.iter().filter(|layer| layer.visible && !layer.cloud.is_empty())
    }

    /// The layer's visible points, ascending; `None` if all are visible.
    pub(super) fn seen(&self, layer: &Layer) -> Option<Vec<u32>> {
        let clip = self.clips();
        if clip.is_none() && !layer.is_thinned() {
            return None;
        }
        let seen = |point: usize| layer.has(point) && clip.is_none_or(|clip| clip.contains(layer.position(point)));
        points_where(layer.cloud.len(), seen)
    }

    /// The layer's points that are selected and visible, which an edit would change.
    pub(super) fn reached(&self, layer: &Layer) -> Bits {
        if !layer.visible || !layer.is_editable() {
            return Bits::default();
        }
        let there = layer.edits.selected.without(&layer.edits.hidden).without(&layer.edits.deleted);
        match self.clips() {
            Some(clip) if !there.is_empty() => {
                let seen = |point: usize| there.get(point) && clip.contains(layer.position(point));
                Bits::from_fn(layer.cloud.len(), seen)
            }
            _ => there,
        }
    }

    /// The layer's points that are visible and not selected.
    pub(super) fn others(&self, layer: &Layer) -> Bits {
        if !layer.visible || !layer.is_editable() {
            return Bits::default();
        }
        let clip = self.clips();
        Bits::from_fn(layer.cloud.len(), |point| {
            layer.has(point)
                && !layer.edits.selected.get(point)
                && clip.is_none_or(|clip| clip.contains(layer.position(point)))
        })
    }

    /// Largest number of bytes that [`shown`](Self::shown) takes beyond the document.
    /// [Check](autosplats::cloud::check_memory) before the call, as systems promise memory they do not have.
    pub(crate) fn shown_bytes(&self) -> usize {
        let bytes = |layer: &Layer| {
            let sets = if self.clips().is_some() || layer.is_thinned() { 8 * layer.cloud.len() } else { 0 };
            let colors = layer.tint.map_or(0, |_| 3 * layer.cloud.len());
            let alone = if layer.is_changed() || sets > 0 { layer.cloud.byte_len() } else { 0 };
            (sets + colors + alone, layer.cloud.byte_len() + colors)
        };
        let layers: Vec<_> = self.visible().map(|layer| (layer, bytes(layer))).collect();
        match layers.as_slice() {
            [(layer, (alone, _))] if layer.pose == DMat4::IDENTITY => *alone,
            several => several.iter().map(|(_, (alone, merged))| alone + merged).sum(),
        }
    }

    /// The one cloud to render: visible layers at their places, without hidden, deleted or clipped points.
    ///
    /// Attributes and coordinate system are kept as [merging](PointCloud::merge) keeps them; degrees become metres. A
    /// single unedited layer is shared, not copied.
    pub(crate) fn shown(&self) -> ShownCloud {
        let mut parts = Vec::new();
        let mut clouds: Vec<(&Layer, Cow<'_, PointCloud>)> = Vec::new();
        let mut start = 0;
        for layer in self.visible() {
            let points = self.seen(layer);
            let len = points.as_ref().map_or(layer.cloud.len(), Vec::len);
            if len > 0 {
                clouds.push((layer, layer.look(points.as_deref())));
                parts.push(LayerPart { layer: layer.id, start, len, points: points.map(Arc::from) });
                start += len;
            }
        }
        let cloud = match clouds.as_slice() {
            [(layer, Cow::Borrowed(_))] if layer.pose == DMat4::IDENTITY => Arc::clone(&layer.cloud),
            [(layer, Cow::Owned(_))] if layer.pose == DMat4::IDENTITY => {
                Arc::new(clouds.pop().map(|(_, cloud)| cloud.into_owned()).unwrap_or_default())
            }
            several => {
                let posed: Vec<_> = several.iter().map(|(layer, cloud)| (&**cloud, layer.pose)).collect();
                Arc::new(PointCloud::merged(&posed))
            }
        };
        ShownCloud { cloud, of: self.clone(), parts }
    }
}

impl Layer {
    /// Whether some points are hidden or deleted.
    fn is_thinned(&self) -> bool {
        !self.edits.hidden.is_empty() || !self.edits.deleted.is_empty()
    }

    /// Whether some points differ in colour or place from the file, apart from the pose.
    fn is_changed(&self) -> bool {
        !self.edits.moves.is_empty() || self.tint.is_some() || self.local.is_some()
    }

    /// The points with the given indices, or all, moved and coloured as shown, but without the pose.
    fn look(&self, points: Option<&[u32]>) -> Cow<'_, PointCloud> {
        if points.is_none() && !self.is_changed() {
            return Cow::Borrowed(&self.cloud);
        }
        let mut cloud = points.map_or_else(|| (*self.cloud).clone(), |points| self.cloud.pick(points));
        if let Some(local) = &self.local {
            cloud.to_metres_on(local);
        }
        self.move_points(&mut cloud, points, false);
        if let Some(tint) = self.tint {
            let tinted = vec![tint; cloud.len()];
            cloud = cloud.with_colors(tinted).unwrap_or_else(|error| unreachable!("a colour each: {error}"));
        }
        Cow::Owned(cloud)
    }

    /// Applies the moves to a cloud of the layer's points with the given indices, or all. `degrees` says that the cloud
    /// is in the file's degrees.
    pub(super) fn move_points(&self, cloud: &mut PointCloud, points: Option<&[u32]>, degrees: bool) {
        let local = self.local.as_ref().filter(|_| degrees);
        for (moved, matrix) in &self.edits.moves {
            let which = |index: usize| moved.get(points.map_or(index, |points| points[index] as usize));
            cloud.move_points(which, matrix, local);
        }
    }
}

/// The points below `len` that `has` accepts, ascending; `None` if all are accepted.
pub(super) fn points_where(len: usize, has: impl Fn(usize) -> bool + Sync) -> Option<Vec<u32>> {
    let points: Vec<u32> = (0..len).into_par_iter().filter(|&point| has(point)).map(|point| point as u32).collect();
    (points.len() < len).then_some(points)
}

impl ShownCloud {
    /// Whether [`Document::shown`] would make the same cloud of `document`. Names and the selection do not matter.
    pub(crate) fn shows(&self, document: &Document) -> bool {
        let layers = |document: &Document| document.visible().count();
        self.of.clips() == document.clips()
            && layers(&self.of) == layers(document)
            && self.of.visible().zip(document.visible()).all(|(own, other)| own.shows_same(other))
    }

    pub(crate) fn len(&self) -> usize {
        self.cloud.len()
    }

    /// Layer and index in the layer of a shown point.
    pub(crate) fn point(&self, index: usize) -> Option<(LayerId, usize)> {
        let part = &self.parts[self.parts.partition_point(|part| part.start <= index).checked_sub(1)?];
        let within = index - part.start;
        (within < part.len).then(|| (part.layer, part.point(within)))
    }

    /// Indices of a part of the points, ascending: a half of a half, and so on, `halvings` times. Of octrees it is the
    /// nodes that show most. Of other layers a hash of the index chooses, so that the part is always the same.
    pub(crate) fn thinned(&self, halvings: u32) -> Vec<u32> {
        let kept = |index: &u32| {
            let mixed = index.wrapping_mul(0x9E37_79B9).rotate_left(15).wrapping_mul(0x85EB_CA6B);
            mixed.checked_shr(32 - halvings).unwrap_or(0) == 0
        };
        let mut indices = Vec::new();
        for part in &self.parts {
            let tree = self.of.layer(part.layer).and_then(|layer| Some((layer.cloud.len(), layer.tree.as_ref()?)));
            match tree {
                Some((len, tree)) => {
                    let within = |point: usize| match &part.points {
                        Some(points) => points.partition_point(|&own| (own as usize) < point),
                        None => point,
                    };
                    for points in tree.leading(len, len >> halvings) {
                        let shown = within(points.start)..within(points.end);
                        indices.extend(shown.map(|index| (part.start + index) as u32));
                    }
                }
                None => {
                    let all = part.start as u32..(part.start + part.len) as u32;
                    indices.par_extend(all.into_par_iter().filter(kept));
                }
            }
        }
        indices
    }

    /// Names of the fields that colours can show, those of octrees included, which are read when they are shown.
    pub(crate) fn field_names(&self) -> Vec<String> {
        let mut names: Vec<String> = self.cloud.fields().iter().map(|field| field.name.clone()).collect();
        for (_, tree) in self.of.trees() {
            let more: Vec<_> = tree.open.tree.info().fields.iter().filter(|name| !names.contains(name)).collect();
            names.extend(more.into_iter().cloned());
        }
        names
    }

    /// Whether `hits` accepts a point of an octree, which cannot be selected.
    pub(crate) fn hits_tree(&self, hits: impl Fn(usize) -> bool) -> bool {
        let of_tree = |part: &&LayerPart| self.of.layer(part.layer).is_some_and(|layer| layer.tree.is_some());
        self.parts.iter().filter(of_tree).any(|part| (part.start..part.start + part.len).any(&hits))
    }

    /// A layer as it was when the cloud was made.
    pub(crate) fn layer(&self, id: LayerId) -> Option<&Layer> {
        self.of.layer(id)
    }

    pub(super) fn part(&self, layer: LayerId) -> Option<&LayerPart> {
        self.parts.iter().find(|part| part.layer == layer)
    }

    /// The shown points that are selected in `document`.
    pub(crate) fn selected(&self, document: &Document) -> Bits {
        let parts: Vec<_> = self.parts.iter().map(|part| (part, document.layer(part.layer))).collect();
        if let [(LayerPart { points: None, .. }, Some(layer))] = parts[..] {
            return layer.edits.selected.clone();
        }
        if parts.iter().all(|(_, layer)| layer.is_none_or(|layer| layer.edits.selected.is_empty())) {
            return Bits::default();
        }
        Bits::from_fn(self.len(), |index| {
            let (part, layer) = parts[parts.partition_point(|(part, _)| part.start <= index) - 1];
            layer.is_some_and(|layer| layer.edits.selected.get(part.point(index - part.start)))
        })
    }
}
