//! Clouds in degrees: shown, moved and placed in metres, written as they were read.

use std::sync::Arc;

use autosplats::cloud::{
    Crs, PointCloud, Scan, Unit,
    glam::{DMat4, DVec3},
};
use autosplats_formats::{ReadOptions, read, read_with};

use super::super::{Bits, Document, ExportScope, Layer, LayerId, Replace, SelectMode, export};
use super::{cloud, edit};

fn degrees(corner: DVec3) -> Arc<PointCloud> {
    let crs = Crs { unit: Some(Unit::Degree), vertical_unit: Some(Unit::Metre), ..Crs::default() };
    let line = (0..10).map(|i| [i as f32 / 1024.0, 0.0, 0.0]).collect();
    let cloud = PointCloud::new(corner, line).with_crs(crs).with_residuals(vec![[1e-12, 0.0, 0.0]; 10]);
    let world_from_sensor = DMat4::from_translation(corner);
    Arc::new(cloud.expect("one each").with_scans(vec![Scan { name: None, world_from_sensor, points: 0..10 }]))
}

fn neighbours() -> (Document, [LayerId; 2]) {
    let mut document = Document::default();
    let ids = [10.0, 10.0625]
        .map(|longitude| document.add(Layer::new("tile", None, degrees(DVec3::new(longitude, 50.0, 100.0)))));
    (document, ids)
}

#[test]
fn neighbours_keep_their_places_to_each_other() {
    let (document, [first, second]) = neighbours();
    let shown = document.shown();
    assert_eq!(shown.cloud.crs().unit, Some(Unit::Metre), "in metres");
    let place = |id, point| document.layer(id).expect("there").position(point);
    let way = place(second, 0) - place(first, 0);
    // Length of a sixteenth of a degree of longitude there.
    assert!((way.x - 4481.0).abs() < 1.0 && way.y.abs() < 1e-6, "{way}");
    for (id, start) in [(first, 0), (second, 10)] {
        for point in 0..10 {
            let off = shown.cloud.world_position(start + point) - place(id, point);
            // One f32 step at some kilometres.
            assert!(off.length() < 1e-3, "point {point} is off by {off}");
        }
    }
}

#[test]
fn sensors_of_an_overview_stand_where_they_stood() {
    let (mut document, [first, second]) = neighbours();
    let shift = DVec3::new(0.0, 7.0, 0.0);
    let posed = Layer::new("posed", None, degrees(DVec3::new(10.0, 50.0, 100.0)));
    let posed = document.add(posed.opened_at(DMat4::from_translation(shift)));
    let overview = document.overview();
    let place = |id| document.layer(id).expect("there").position(0);
    // The points differ from the corner by their residuals.
    for (scan, id) in overview.scans().iter().zip([first, second, posed]) {
        assert!(scan.position().distance(place(id)) < 1e-3, "{} is not {}", scan.position(), place(id));
    }
    assert_eq!(overview.scans().len(), 3, "one each");
    assert_eq!(overview.crs().unit, Some(Unit::Metre), "not what the file has");
    let mut document = Document::default();
    document
        .add(Layer::new("in its own frame", None, cloud(10, DVec3::ZERO)).opened_at(DMat4::from_translation(shift)));
    let [scan] = document.overview().scans().to_vec().try_into().expect("one sensor");
    assert_eq!(scan.position(), shift, "the origin moves with the points");
}

#[test]
fn a_file_read_again_stays_on_the_map() {
    let (mut document, [_, second]) = neighbours();
    let place = document.layers[1].position(3);
    let shown = document.shown();
    document.select_all(&shown);
    document.delete_selected();
    document.reload(second, &degrees(DVec3::new(10.0625, 50.0, 100.0)));
    assert_eq!(document.layers[1].position(3), place, "where it was");
    assert_eq!(document.counts_of(&document.layers[1]).deleted, 0, "with all its points");
    document.reload(second, &cloud(10, DVec3::ZERO));
    assert_eq!(document.layers[1].position(3), document.layers[1].file_position(3), "metres are on no map");
}

#[test]
fn edits_in_metres_are_written_in_degrees() {
    let (mut document, [first, second]) = neighbours();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("out.ply");
    let old = [first, second].map(|id| document.layer(id).expect("there").position(1));
    let shown = document.shown();
    document.select(&shown, |index| index % 10 == 1, SelectMode::Replace);
    document.move_selected(&DMat4::from_translation(DVec3::new(3.0, 4.0, 5.0)));
    document.set_pose(second, DMat4::from_translation(DVec3::new(0.0, 0.0, 7.0)));
    edit(&mut document, first, |layer| layer.edits.deleted = Bits::from_fn(10, |point| point == 0));
    export(&document, ExportScope::All, &path, Replace::Nothing, &()).expect("written");
    let options = ReadOptions { exact: true, ..ReadOptions::default() };
    let written = read_with(&path, &options, &()).expect("read again");
    assert_eq!(written.len(), 19, "all but the deleted one");
    let file = |index: usize| written.world_position(index);
    let off = file(1) - document.layers[0].file_position(2);
    // One f64 step at 50.
    assert!(off.abs().max_element() < 1e-14, "what did not move keeps its digits: {off}");
    let local = document.layers[0].local.expect("a map");
    for (index, wanted) in [
        (0, old[0] + DVec3::new(3.0, 4.0, 5.0)),
        (9, document.layers[1].position(0)),
        (10, old[1] + DVec3::new(3.0, 4.0, 12.0)),
    ] {
        let off = local.metres(file(index)) - wanted;
        // One f64 step at 50 degrees is about a nanometre.
        assert!(off.length() < 1e-8, "point {index} is off by {off}");
    }
    // PLY cannot hold places of sensors.
    let sensors = [0, 1].map(|layer| document.layers[layer].exact(None, true).scans()[0].position());
    assert!(sensors[0].abs_diff_eq(DVec3::new(10.0, 50.0, 100.0), 1e-9), "a sensor stays: {sensors:?}");
    assert!(
        sensors[1].abs_diff_eq(DVec3::new(10.0625, 50.0, 107.0), 1e-9),
        "one is placed with its layer: {sensors:?}"
    );
}

#[test]
fn beside_metres_all_is_written_in_metres() {
    let (mut document, _) = neighbours();
    document.add(Layer::new("metres", None, cloud(10, DVec3::ZERO)));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("out.ply");
    export(&document, ExportScope::All, &path, Replace::Nothing, &()).expect("written");
    let written = read(&path, &()).expect("read again");
    let shown = document.shown();
    for index in 0..30 {
        let off = written.world_position(index) - shown.cloud.world_position(index);
        assert!(off.length() < 2e-3, "point {index} is as shown, off by {off}");
    }
}
