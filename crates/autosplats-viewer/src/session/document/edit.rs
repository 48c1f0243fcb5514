//! Edits of points. Each edit returns the number of points that it changed; with 0, the document is unchanged.

use std::sync::Arc;

use autosplats::cloud::{
    PointCloud,
    glam::{DMat4, DVec3},
};

use super::{Bits, Document, Layer, LayerId, bounds::bounds, layers::can_place};

/// Points held by a drag, with the moves applied to them before the drag.
#[derive(Clone, Debug)]
pub(crate) struct Grip(Vec<Gripped>);

#[derive(Clone, Debug)]
struct Gripped {
    layer: LayerId,
    cloud: Arc<PointCloud>,
    points: Bits,
    moves: Vec<(Bits, DMat4)>,
}

impl Document {
    /// Hides the selected points and deselects them.
    pub(crate) fn hide_selected(&mut self) -> usize {
        self.edit_reached(|layer, reached| {
            layer.edits.hidden = layer.edits.hidden.or(reached);
            layer.edits.selected = layer.edits.selected.without(reached);
        })
    }

    /// Shows all hidden points again.
    pub(crate) fn show_all(&mut self) -> usize {
        let count = self.counts().hidden;
        for layer in &mut self.layers {
            layer.edits.hidden = Bits::default();
        }
        count
    }

    /// Deletes the selected points.
    pub(crate) fn delete_selected(&mut self) -> usize {
        self.edit_reached(|layer, reached| {
            layer.edits.deleted = layer.edits.deleted.or(reached);
            layer.edits.selected = layer.edits.selected.without(reached);
        })
    }

    /// Deletes all visible points that are not selected; does nothing if nothing is selected.
    pub(crate) fn crop_to_selection(&mut self) -> usize {
        if self.layers.iter().all(|layer| self.reached(layer).is_empty()) {
            return 0;
        }
        let others: Vec<Bits> = self.layers.iter().map(|layer| self.others(layer)).collect();
        for (layer, others) in self.layers.iter_mut().zip(&others) {
            layer.edits.deleted = layer.edits.deleted.or(others);
        }
        others.iter().map(Bits::count).sum()
    }

    /// Moves the selected points by an affine map of world coordinates. A map without an inverse is refused.
    pub(crate) fn move_selected(&mut self, matrix: &DMat4) -> usize {
        if *matrix == DMat4::IDENTITY {
            return 0;
        }
        let grip = self.grip();
        self.move_gripped(&grip, matrix)
    }

    /// The selected points at their present places, from where a drag can move them repeatedly.
    pub(crate) fn grip(&self) -> Grip {
        let gripped = self.layers.iter().map(|layer| Gripped {
            layer: layer.id,
            cloud: Arc::clone(&layer.cloud),
            points: self.reached(layer),
            moves: layer.edits.moves.clone(),
        });
        Grip(gripped.filter(|gripped| !gripped.points.is_empty()).collect())
    }

    /// Moves gripped points from the places where they were gripped, replacing later moves. `matrix` is an affine map
    /// of world coordinates; the identity puts the points back. A map without an inverse is refused.
    pub(crate) fn move_gripped(&mut self, grip: &Grip, matrix: &DMat4) -> usize {
        if !can_place(matrix) {
            return 0;
        }
        let mut count = 0;
        for Gripped { layer, cloud, points, moves: before } in &grip.0 {
            // A layer that has been read again has other points.
            let there = |own: &&mut Layer| own.id == *layer && Arc::ptr_eq(&own.cloud, cloud);
            let Some(layer) = self.layers.iter_mut().find(there) else { continue };
            let own = if layer.pose == DMat4::IDENTITY { *matrix } else { layer.pose.inverse() * *matrix * layer.pose };
            let moves = &mut layer.edits.moves;
            moves.clone_from(before);
            match moves.last_mut() {
                _ if *matrix == DMat4::IDENTITY => {}
                // The last move has the same points, so that both are combined into one.
                Some((moved, before)) if moved == points => {
                    *before = own * *before;
                    if *before == DMat4::IDENTITY {
                        moves.pop();
                    }
                }
                _ => moves.push((points.clone(), own)),
            }
            count += points.count();
        }
        count
    }

    /// Turns the selected points about the centre of their bounds.
    pub(crate) fn rotate_selected(&mut self, axis: DVec3, radians: f64) -> usize {
        let Some(([low, high], axis)) = self.selected_bounds().zip(axis.try_normalize()) else { return 0 };
        self.move_selected(&about(low.midpoint(high), DMat4::from_axis_angle(axis, radians)))
    }

    /// Bounds of all selected points, world coordinates.
    pub(crate) fn selected_bounds(&self) -> Option<[DVec3; 2]> {
        let boxes = self.layers.iter().filter_map(|layer| {
            let reached = self.reached(layer);
            bounds(layer.cloud.len(), |point| reached.get(point).then(|| layer.position(point)))
        });
        boxes.reduce(join)
    }

    /// Bounds of all points that would be shown without the clipping box, world coordinates.
    pub(crate) fn whole_bounds(&self) -> Option<[DVec3; 2]> {
        self.layers.iter().filter(|layer| layer.visible).filter_map(Layer::bounds).reduce(join)
    }

    fn edit_reached(&mut self, edit: impl Fn(&mut Layer, &Bits)) -> usize {
        let reached: Vec<Bits> = self.layers.iter().map(|layer| self.reached(layer)).collect();
        for (layer, reached) in self.layers.iter_mut().zip(&reached) {
            if !reached.is_empty() {
                edit(layer, reached);
            }
        }
        reached.iter().map(Bits::count).sum()
    }
}

fn join([low, high]: [DVec3; 2], [min, max]: [DVec3; 2]) -> [DVec3; 2] {
    [low.min(min), high.max(max)]
}

/// A map that keeps `centre` in place.
pub(crate) fn about(centre: DVec3, matrix: DMat4) -> DMat4 {
    DMat4::from_translation(centre) * matrix * DMat4::from_translation(-centre)
}
