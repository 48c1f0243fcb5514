//! The one cloud that is rendered, and whose points its points are.

use std::{borrow::Cow, sync::Arc};

use autosplats::cloud::{
    PointCloud,
    glam::{DMat4, DVec3},
};
use rayon::prelude::*;

use super::{Bits, ClipBox, Document, Layer, LayerId};

/// What is to be seen of a document: one cloud, and where each of its points comes from. Clones share all that is big.
#[derive(Clone, Debug)]
pub(crate) struct Shown {
    /// The points, at their places in the world and in the colours they are shown in. Positions are as fine as `f32`
    /// about its origin; [`Document::describe`] has all digits.
    pub(crate) cloud: Arc<PointCloud>,
    /// What it was made of.
    of: Document,
    parts: Vec<Part>,
}

/// The points of one layer, which are side by side.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) layer: LayerId,
    /// Where they begin in the shown cloud.
    pub(super) start: usize,
    pub(super) len: usize,
    /// Which of the layer's points they are, ascending; all of them if nothing is said.
    points: Option<Arc<[u32]>>,
}

impl Part {
    /// Which of the layer's points is the one at `index` of this part.
    fn point(&self, index: usize) -> usize {
        self.points.as_ref().map_or(index, |points| points[index] as usize)
    }

    /// Those of the layer's `len` points that are shown and that `has`, asked for their indices in the shown cloud, says
    /// yes to.
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
    /// The clipping box, if it clips.
    fn clips(&self) -> Option<&ClipBox> {
        self.clip.as_ref().filter(|clip| clip.enabled)
    }

    fn visible(&self) -> impl Iterator<Item = &Layer> {
        self.layers.iter().filter(|layer| layer.visible && !layer.cloud.is_empty())
    }

    /// Those of a layer's points that can be seen, ascending; nothing if all can.
    pub(super) fn seen(&self, layer: &Layer) -> Option<Vec<u32>> {
        let clip = self.clips();
        if clip.is_none() && !layer.is_thinned() {
            return None;
        }
        let seen = |point: usize| layer.has(point) && clip.is_none_or(|clip| clip.contains(layer.position(point)));
        points_where(layer.cloud.len(), seen)
    }

    /// Those of a layer's points that an edit of the selection is about: selected, and to be seen.
    pub(super) fn reached(&self, layer: &Layer) -> Bits {
        if !layer.visible || layer.incomplete {
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

    /// Those of a layer's points that can be seen and are not selected.
    pub(super) fn others(&self, layer: &Layer) -> Bits {
        if !layer.visible || layer.incomplete {
            return Bits::default();
        }
        let clip = self.clips();
        Bits::from_fn(layer.cloud.len(), |point| {
            layer.has(point)
                && !layer.edits.selected.get(point)
                && clip.is_none_or(|clip| clip.contains(layer.position(point)))
        })
    }

    /// Bytes that [`shown`](Self::shown) will take at most, beyond what the document has. Systems promise memory they do not
    /// have: [ask](autosplats::cloud::check_memory) before.
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

    /// The one cloud to be rendered: visible layers at their places, without what is hidden, deleted or clipped.
    ///
    /// Fields, coordinate system and the like are kept as [merging](PointCloud::merge) keeps them; those in degrees become
    /// metres. A single layer to which nothing was done is shared, not copied.
    pub(crate) fn shown(&self) -> Shown {
        let mut parts = Vec::new();
        let mut clouds: Vec<(&Layer, Cow<'_, PointCloud>)> = Vec::new();
        let mut start = 0;
        for layer in self.visible() {
            let points = self.seen(layer);
            let len = points.as_ref().map_or(layer.cloud.len(), Vec::len);
            if len > 0 {
                clouds.push((layer, layer.look(points.as_deref())));
                parts.push(Part { layer: layer.id, start, len, points: points.map(Arc::from) });
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
        Shown { cloud, of: self.clone(), parts }
    }
}

impl Layer {
    /// Whether some of its points are not there or not to be seen.
    fn is_thinned(&self) -> bool {
        !self.edits.hidden.is_empty() || !self.edits.deleted.is_empty()
    }

    /// Whether some of its points look or lie otherwise than in the file, but for its pose.
    fn is_changed(&self) -> bool {
        !self.edits.moves.is_empty() || self.tint.is_some() || self.local.is_some()
    }

    /// Its points with the indices given, or all, moved and coloured as they are shown, but not placed in the world.
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

    /// Applies the moves to a cloud of the layer's points with the indices given, or all; in the degrees of the file if
    /// `degrees` says that these are its coordinates.
    pub(super) fn move_points(&self, cloud: &mut PointCloud, points: Option<&[u32]>, degrees: bool) {
        let local = self.local.as_ref().filter(|_| degrees);
        for (moved, matrix) in &self.edits.moves {
            let which = |index: usize| moved.get(points.map_or(index, |points| points[index] as usize));
            cloud.move_points(which, matrix, local);
        }
    }
}

/// The points below `len` that `has` says yes to, ascending; nothing if all are.
pub(super) fn points_where(len: usize, has: impl Fn(usize) -> bool + Sync) -> Option<Vec<u32>> {
    let points: Vec<u32> = (0..len).into_par_iter().filter(|&point| has(point)).map(|point| point as u32).collect();
    (points.len() < len).then_some(points)
}

impl Shown {
    /// Whether this is what [`Document::shown`] would make of the document now. Names and the selection do not matter.
    pub(crate) fn shows(&self, document: &Document) -> bool {
        let layers = |document: &Document| document.visible().count();
        self.of.clips() == document.clips()
            && layers(&self.of) == layers(document)
            && self.of.visible().zip(document.visible()).all(|(own, other)| own.looks_like(other))
    }

    /// Number of points.
    pub(crate) fn len(&self) -> usize {
        self.cloud.len()
    }

    /// The layer of a shown point, and which of the layer's points it is.
    pub(crate) fn point(&self, index: usize) -> Option<(LayerId, usize)> {
        let part = &self.parts[self.parts.partition_point(|part| part.start <= index).checked_sub(1)?];
        let within = index - part.start;
        (within < part.len).then(|| (part.layer, part.point(within)))
    }

    pub(super) fn part(&self, layer: LayerId) -> Option<&Part> {
        self.parts.iter().find(|part| part.layer == layer)
    }

    /// Which of the shown points are selected in the document.
    pub(crate) fn selected(&self, document: &Document) -> Bits {
        let parts: Vec<_> = self.parts.iter().map(|part| (part, document.layer(part.layer))).collect();
        if let [(Part { points: None, .. }, Some(layer))] = parts[..] {
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

/// The least box that has all places in it that are finite; nothing if there is none.
pub(super) fn bounds(len: usize, place: impl Fn(usize) -> Option<DVec3> + Sync) -> Option<[DVec3; 2]> {
    let none = || [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let join = |[low, high]: [DVec3; 2], [min, max]: [DVec3; 2]| [low.min(min), high.max(max)];
    let grow = |bounds, index| match place(index) {
        Some(place) if place.is_finite() => join(bounds, [place; 2]),
        _ => bounds,
    };
    let [low, high] = (0..len).into_par_iter().with_min_len(1 << 10).fold(none, grow).reduce(none, join);
    low.cmple(high).all().then_some([low, high])
}
