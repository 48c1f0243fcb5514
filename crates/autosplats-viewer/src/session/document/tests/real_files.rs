//! Files of scanners and other programs, opened and written again.
//!
//! The files lie beside the repository, in `../shared/data`, or where `AUTOSPLATS_DATA` says. Without them these tests
//! report that nothing is checked; if `CI` is set they fail.

use std::{path::Path, sync::Arc};

use autosplats::cloud::PointCloud;
use autosplats_formats::{ReadOptions, read_with};

use super::super::{Document, ExportScope, Layer, Replace, export, pick::file_text};
use super::{edit, every};
use crate::tests::data;

fn exact(path: &Path) -> PointCloud {
    let options = ReadOptions { exact: true, ..ReadOptions::default() };
    read_with(path, &options, &()).unwrap_or_else(|error| panic!("{error}"))
}

/// Files with integer steps, floats and doubles; far from the origin, with scans, with more than eight bits per colour,
/// and in degrees.
const FILES: [&str; 9] = [
    "scans/autzen_thin.las",
    "scans/autzen_trim.laz",
    "scans/ign_lambert93_extrabytes.laz",
    "scans/latlon_degrees.las",
    "scans/autzen_utm_f64.pcd",
    "scans/pump_room.e57",
    "scans/bunny_scaledint19.e57",
    "scans/two_scans.e57",
    "models/armadillo_normals.ply",
];

#[test]
fn own_formats_keep_all_digits() {
    let Some(data) = data() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    for file in FILES {
        let path = data.join(file);
        let mut document = Document::default();
        let cloud = Arc::new(exact(&path));
        let id = document.add(Layer::new(file, Some(path.clone()), Arc::clone(&cloud)));
        for step in [None, Some(3)] {
            if let Some(step) = step {
                edit(&mut document, id, |layer| layer.edits.deleted = every(cloud.len(), step));
            }
            let target = folder.path().join(format!("{}-{}", step.is_some(), file.replace('/', "-")));
            export(&document, ExportScope::Layer(id), &target, Replace::Nothing, &()).expect("written");
            let written = exact(&target);
            let kept: Vec<u32> =
                (0..cloud.len() as u32).filter(|i| step.is_none_or(|step| i % step as u32 > 0)).collect();
            let wanted = cloud.pick(&kept);
            assert_eq!(written.len(), wanted.len(), "{file}: points");
            let digits = |cloud: &PointCloud| (0..kept.len()).map(|index| file_text(cloud, index)).collect::<Vec<_>>();
            let both = digits(&written).into_iter().zip(digits(&wanted));
            // Without steps, the shortest text depends on the origin of the cloud. The next check covers these
            // coordinates.
            let steps = wanted.resolution().is_some();
            let unlike: Vec<_> = both.filter(|(written, wanted)| steps && written != wanted).collect();
            assert!(unlike.is_empty(), "{file}: to the last digit: {:?} of {}", unlike.first(), unlike.len());
            for index in 0..kept.len() {
                let off = written.world_position(index) - wanted.world_position(index);
                // A step or two of f64, about different origins.
                let room = 4.0 * f64::EPSILON * wanted.world_position(index).abs().max_element();
                assert!(off.abs().max_element() <= room, "{file}: point {index} is off by {off}");
            }
            assert_eq!(written.colors(), wanted.colors(), "{file}: colours");
            for field in wanted.fields() {
                assert!(
                    written.field(&field.name).is_some_and(|own| own.values == field.values),
                    "{file}: {}",
                    field.name
                );
            }
            assert_eq!(written.crs(), wanted.crs(), "{file}: coordinate system");
            assert_eq!(written.scans().len(), wanted.scans().len(), "{file}: scans");
        }
    }
}
