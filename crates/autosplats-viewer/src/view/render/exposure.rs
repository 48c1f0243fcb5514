//! How bright pictures are, unless the user says.

use autosplats::cloud::PointCloud;
use autosplats::cloud::glam::DMat4;
use autosplats::usual_exposure;

use crate::session::{Document, LayerId};

/// The default brightness of colours. It is fixed by the first picture of a set of layers, so that edits and playing do
/// not change the brightness.
#[derive(Default)]
pub(super) struct Exposure {
    found: Option<f32>,
    /// The layers that `found` belongs to, with their tints.
    layers: Vec<(LayerId, Option<[u8; 3]>)>,
}

impl Exposure {
    /// The brightness for a document and its points.
    pub(super) fn of(&mut self, document: &Document, cloud: &PointCloud) -> f32 {
        if document.layers.iter().any(|layer| layer.incomplete) {
            // More points, and with them colours, may follow.
            self.layers.clear();
            return usual_exposure(cloud);
        }
        // Which nodes of octrees are there first is left to chance.
        let samples: Vec<_> = document.trees().map(|(_, tree)| (&*tree.open.sample, DMat4::IDENTITY)).collect();
        let layers: Vec<_> = document.layers.iter().map(|layer| (layer.id, layer.tint)).collect();
        if self.layers != layers {
            (self.found, self.layers) = (None, layers);
        }
        *self.found.get_or_insert_with(|| match &*samples {
            [] => usual_exposure(cloud),
            [(sample, _)] => usual_exposure(sample),
            several => usual_exposure(&PointCloud::merged(several)),
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use autosplats::cloud::glam::DVec3;

    use super::*;
    use crate::session::Layer;

    #[test]
    fn brightness_stays_while_layers_are_edited_and_play() {
        let gray = |level| {
            let cloud = PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; 100]).with_colors(vec![[level; 3]; 100]);
            Arc::new(cloud.expect("as many"))
        };
        let [dark, bright] = [40, 200].map(gray);
        let mut document = Document::default();
        let id = document.add(Layer::new("cellar", None, Arc::clone(&dark)));
        let mut exposure = Exposure::default();
        assert!(exposure.of(&document, &dark) > 4.0);
        assert_eq!(exposure.of(&document, &bright), usual_exposure(&dark), "the next frame of the same");
        document.remove(id);
        document.add(Layer::new("yard", None, Arc::clone(&bright)));
        assert_eq!(exposure.of(&document, &bright), 1.0, "another file");
    }
}
