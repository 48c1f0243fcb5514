//! Cost of a large document. Run by `cargo test --release -p autosplats-viewer costs -- --ignored --nocapture`.

use std::{hint::black_box, sync::Arc, time::Instant};

use autosplats::cloud::{
    FieldValues, PointCloud,
    glam::{DMat4, DVec3},
};
use autosplats::{Camera, Projection};

use super::super::{ClipBox, Document, Layer, Region, SelectMode};
use super::{FAR, edit, every};

/// A cloud of `len` points with the attributes of an aerial survey.
fn survey(len: usize) -> Arc<PointCloud> {
    let position = |i: usize| [(i % 4000) as f32 * 0.25, (i / 4000) as f32 * 0.25, (i % 97) as f32 * 0.1];
    let cloud = PointCloud::new(FAR, (0..len).map(position).collect())
        .with_residuals(vec![[1e-9; 3]; len])
        .and_then(|cloud| cloud.with_colors(vec![[1, 2, 3]; len]))
        .and_then(|cloud| cloud.with_field("Intensity", FieldValues::U16(vec![7; len])))
        .and_then(|cloud| cloud.with_field("Classification", FieldValues::U8(vec![7; len])))
        .and_then(|cloud| cloud.with_field("ReturnNumber", FieldValues::U8(vec![7; len])))
        .and_then(|cloud| cloud.with_field("NumberOfReturns", FieldValues::U8(vec![7; len])))
        .and_then(|cloud| cloud.with_field("PointSourceId", FieldValues::U16(vec![7; len])))
        .and_then(|cloud| cloud.with_field("GpsTime", FieldValues::F64(vec![7.0; len])));
    Arc::new(cloud.expect("one value a point"))
}

fn time<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = black_box(work());
    println!("{what:<40} {:>7.1} ms", start.elapsed().as_secs_f64() * 1e3);
    result
}

#[test]
#[ignore = "a measurement of a few seconds and 3 GB, which checks nothing"]
fn ten_million_points() {
    let len = 10_000_000;
    let mut document = Document::default();
    let id = document.add(Layer::new("survey", None, survey(len)));
    let shown = time("show an untouched layer", || document.shown());
    time("know that it is shown", || shown.shows(&document));
    let centre = FAR + DVec3::new(500.0, 300.0, 0.0);
    let projection = Projection::PerspectiveFovDeg(45.0);
    let camera = Camera { eye: centre + DVec3::Z * 900.0, look_at: centre, up: DVec3::Y, projection };
    let lens = camera.lens([1920, 1080]).expect("a camera");
    let circle = |i: usize| {
        let (sin, cos) = (i as f32 / 200.0 * std::f32::consts::TAU).sin_cos();
        [960.0 + 400.0 * cos, 540.0 + 400.0 * sin]
    };
    let lasso = Region::lasso(&(0..200).map(circle).collect::<Vec<_>>());
    time("select by a lasso of 200 corners", || {
        let inside = |index: usize| {
            let pixel = lens.to_pixel(shown.cloud.world_position(index));
            pixel.is_some_and(|(pixel, _)| lasso.contains(pixel.as_vec2().to_array()))
        };
        document.select(&shown, inside, SelectMode::Replace);
    });
    println!("{} selected", document.counts().selected);
    time("select all", || document.clone().select_all(&shown));
    time("invert", || document.clone().select_inverse(&shown));
    time("tell which are selected", || shown.selected(&document));
    time("count", || document.counts());
    time("bounds of all", || document.whole_bounds());
    time("bounds of what is selected", || document.selected_bounds());
    let mut deleted = document.clone();
    time("delete", || deleted.delete_selected());
    let shown = time("show after deleting", || deleted.shown());
    time("select all of what is left", || deleted.clone().select_all(&shown));
    deleted.select_all(&shown);
    time("tell which are selected", || shown.selected(&deleted));
    let mut moved = document.clone();
    time("move", || moved.move_selected(&DMat4::from_translation(DVec3::Z)));
    time("show after moving", || moved.shown());
    document.clip = Some(ClipBox::new(FAR, FAR + DVec3::new(500.0, 400.0, 10.0)));
    time("show a clipped half", || document.shown());
    document.clip = None;
    document.set_tint(id, Some([9; 3]));
    time("show tinted", || document.shown());
    document.set_tint(id, None);
    document.set_pose(id, DMat4::from_rotation_z(0.1));
    time("show placed", || document.shown());
    document.set_pose(id, DMat4::IDENTITY);
    edit(&mut document, id, |layer| layer.edits.deleted = every(len, 2));
    document.add(Layer::new("other", None, survey(len / 2)));
    time("show half of it beside another half", || document.shown());
}
