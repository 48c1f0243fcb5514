//! Tests of the document as a whole.

mod costs;
mod degrees;
mod editing;
mod exporting;
mod keeping;
mod picking;
mod real_files;
mod selecting;
mod showing;

use std::sync::Arc;

use autosplats::cloud::{
    FieldValues, PointCloud,
    glam::{DMat4, DVec3},
};

use super::{Bits, Document, Layer, LayerId, SelectMode, ShownCloud};

/// A place so far from the origin that the step of `f32` is half a metre.
const FAR: DVec3 = DVec3::new(512_000.0, 5_400_000.0, 300.0);

/// Points scattered over the unit cube about a place, with colours, residuals and numbers that `f64` does not hold.
fn cloud(len: usize, place: DVec3) -> Arc<PointCloud> {
    let position = |i: usize| [0, 1, 2].map(|axis| (i * [7, 13, 29][axis] % 101) as f32 / 100.0);
    let cloud = PointCloud::new(place, (0..len).map(position).collect())
        .with_residuals(vec![[1e-9, -1e-9, 0.0]; len])
        .and_then(|cloud| cloud.with_colors((0..len).map(|i| [i as u8, (i / 256) as u8, 7]).collect()))
        .and_then(|cloud| cloud.with_field("Id", FieldValues::U64((0..len as u64).map(|i| u64::MAX - i).collect())));
    Arc::new(cloud.expect("one value a point"))
}

/// Two layers side by side, the second one placed by a pose.
fn document() -> (Document, [LayerId; 2]) {
    let mut document = Document::default();
    let first = document.add(Layer::new("first", None, cloud(1000, FAR)));
    let pose = DMat4::from_translation(FAR) * DMat4::from_rotation_y(0.25);
    let second = document.add(Layer::new("second", None, cloud(700, DVec3::X)).opened_at(pose));
    (document, [first, second])
}

/// Changes the edits of a layer.
fn edit(document: &mut Document, id: LayerId, change: impl FnOnce(&mut Layer)) {
    change(document.layers.iter_mut().find(|layer| layer.id == id).expect("the layer is there"));
}

/// Selects every `step`th of the shown points.
fn select_every(document: &mut Document, step: usize) -> ShownCloud {
    let shown = document.shown();
    document.select(&shown, |index| index.is_multiple_of(step), SelectMode::Replace);
    shown
}

fn every(len: usize, step: usize) -> Bits {
    Bits::from_fn(len, |point| point.is_multiple_of(step))
}

/// The whole content of a document as text; clouds are identified by their address.
fn contents(document: &Document) -> String {
    let layers = document.layers.iter().map(|layer| {
        let Layer { id, name, path, cloud, visible, tint, pose, edits, .. } = layer;
        format!("{id:?} {name} {path:?} {:p} {visible} {tint:?} {pose:?} {edits:?}\n", Arc::as_ptr(cloud))
    });
    layers.chain([format!("{:?}", document.clip)]).collect()
}
