//! What is done to points. Each edit says how many points it reached; with none, the document is as it was.

use autosplats::cloud::glam::{DMat4, DVec3};

use super::{Bits, Document, Layer, layers::can_place, shown::bounds};

impl Document {
    /// Hides the selected points, which are selected no longer.
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

    /// Deletes all that can be seen but is not selected; nothing if nothing is selected.
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

    /// Moves the selected points by an affine map of world coordinates; one that flattens them is refused.
    pub(crate) fn move_selected(&mut self, matrix: &DMat4) -> usize {
        if !can_place(matrix) || *matrix == DMat4::IDENTITY {
            return 0;
        }
        self.edit_reached(|layer, reached| {
            let own = if layer.pose == DMat4::IDENTITY { *matrix } else { layer.pose.inverse() * *matrix * layer.pose };
            let moves = &mut layer.edits.moves;
            match moves.last_mut() {
                // The same points once more: one move takes them all the way.
                Some((points, before)) if points == reached => {
                    *before = own * *before;
                    if *before == DMat4::IDENTITY {
                        moves.pop();
                    }
                }
                _ => moves.push((reached.clone(), own)),
            }
        })
    }

    /// Turns the selected points about the centre of their bounds.
    pub(crate) fn rotate_selected(&mut self, axis: DVec3, radians: f64) -> usize {
        let Some(([low, high], axis)) = self.selected_bounds().zip(axis.try_normalize()) else { return 0 };
        self.move_selected(&about(low.midpoint(high), DMat4::from_axis_angle(axis, radians)))
    }

    /// The least box along the axes that has all selected points in it.
    pub(crate) fn selected_bounds(&self) -> Option<[DVec3; 2]> {
        let boxes = self.layers.iter().filter_map(|layer| {
            let reached = self.reached(layer);
            bounds(layer.cloud.len(), |point| reached.get(point).then(|| layer.position(point)))
        });
        boxes.reduce(|[low, high], [min, max]| [low.min(min), high.max(max)])
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

/// A map that leaves `centre` where it is.
pub(crate) fn about(centre: DVec3, matrix: DMat4) -> DMat4 {
    DMat4::from_translation(centre) * matrix * DMat4::from_translation(-centre)
}
