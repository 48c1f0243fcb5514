//! Export of points.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
};

use autosplats::cloud::{
    Error, FieldValues, PointCloud, Progress, Scan,
    glam::{DMat4, DVec3},
};
use autosplats_formats::{ReadOptions, read_with, write};

use super::super::{ClipBox, Document, ExportError, ExportScope, Exported, Layer, Replace, export};
use super::{FAR, cloud, document, edit, every, select_every};

fn exact(path: &Path) -> PointCloud {
    let options = ReadOptions { exact: true, ..ReadOptions::default() };
    read_with(path, &options, &()).unwrap_or_else(|error| panic!("{error}"))
}

/// Exports to a new file and reads it again.
fn round_trip(document: &Document, what: ExportScope) -> PointCloud {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("out.ply");
    let Exported { points } = export(document, what, &path, Replace::Nothing, &()).expect("written");
    let written = exact(&path);
    assert_eq!(written.len(), points, "as many as said");
    written
}

#[test]
fn all_that_was_asked_for_is_written_with_all_digits() {
    let (mut document, [first, second]) = document();
    select_every(&mut document, 3);
    document.move_selected(&DMat4::from_rotation_translation(Default::default(), DVec3::new(0.1, 1e-7, 4e3)));
    edit(&mut document, first, |layer| {
        layer.edits.hidden = every(1000, 7);
        layer.edits.deleted = every(1000, 5);
    });
    document.clip = Some(ClipBox::new(FAR - 10.0, FAR + DVec3::new(1.0, 0.5, 5e3)));
    for what in [
        ExportScope::Shown,
        ExportScope::Selected,
        ExportScope::Layer(second),
        ExportScope::All,
        ExportScope::Layer(first),
    ] {
        let written = round_trip(&document, what);
        let mut wanted = Vec::new();
        for layer in &document.layers {
            for point in 0..layer.cloud.len() {
                let (edits, place) = (&layer.edits, layer.position(point));
                let seen = !edits.hidden.get(point) && document.clip.is_some_and(|clip| clip.contains(place));
                let chosen = match what {
                    ExportScope::Shown => seen,
                    ExportScope::Selected => seen && edits.selected.get(point),
                    ExportScope::Layer(id) => id == layer.id,
                    ExportScope::All => true,
                };
                if chosen && !edits.deleted.get(point) {
                    let color = layer.cloud.colors().map(|colors| colors[point]);
                    wanted.push((place, color, u64::MAX - point as u64));
                }
            }
        }
        assert_eq!(written.len(), wanted.len(), "{what:?}: neither more nor less");
        let Some(FieldValues::U64(ids)) = written.field("Id").map(|field| &field.values) else {
            // PLY has no 64-bit integers, so that only the places are compared.
            check_places(&written, &wanted.iter().map(|(place, ..)| *place).collect::<Vec<_>>());
            continue;
        };
        assert_eq!(*ids, wanted.iter().map(|(_, _, id)| *id).collect::<Vec<_>>(), "{what:?}: their attributes");
    }
    let written = round_trip(&document, ExportScope::Layer(first));
    let colors: Vec<_> = (0..1000).filter(|i| i % 5 > 0).map(|i| [i as u8, (i / 256) as u8, 7]).collect();
    assert_eq!(written.colors(), Some(&colors[..]), "their colours");
}

fn check_places(written: &PointCloud, wanted: &[DVec3]) {
    for (index, wanted) in wanted.iter().enumerate() {
        let place = written.world_position(index);
        // One or two steps of f64 at 5e6.
        assert!(place.abs_diff_eq(*wanted, 2e-9), "point {index}: {place} is not {wanted}");
    }
}

#[test]
fn layers_of_single_precision_keep_their_digits_together() {
    let mut document = Document::default();
    for place in [FAR, FAR + DVec3::new(1000.1, 0.0, 0.0)] {
        document.add(Layer::new("part", None, Arc::new(PointCloud::new(place, vec![[0.1; 3], [0.2; 3]]))));
    }
    let places: Vec<DVec3> =
        document.layers.iter().flat_map(|layer| [0, 1].map(|point| layer.position(point))).collect();
    check_places(&round_trip(&document, ExportScope::All), &places);
}

#[test]
fn sensors_go_with_their_layer() {
    let scan = Scan { name: None, world_from_sensor: DMat4::from_translation(FAR), points: 10..90 };
    let mut document = Document::default();
    let own = (*cloud(100, FAR)).clone().with_scans(vec![scan]);
    let id = document.add(Layer::new("scan", None, Arc::new(own)));
    edit(&mut document, id, |layer| layer.edits.deleted = every(100, 2));
    document.set_pose(id, DMat4::from_translation(DVec3::Z));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("out.e57");
    export(&document, ExportScope::All, &path, Replace::Nothing, &()).expect("written");
    let written = exact(&path);
    let sensor = written.scans().iter().find(|scan| scan.points.len() == 40).expect("half of its points");
    assert!(sensor.position().abs_diff_eq(FAR + DVec3::Z, 1e-9), "moved with it: {}", sensor.position());
}

/// A layer read from a file, and its folder.
fn opened() -> (tempfile::TempDir, PathBuf, Document) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("in.ply");
    write(&cloud(100, FAR), &path, &()).expect("an input");
    let mut document = Document::default();
    let id = document.add(Layer::new("in", Some(path.clone()), Arc::new(exact(&path))));
    edit(&mut document, id, |layer| layer.edits.deleted = every(100, 2));
    (folder, path, document)
}

#[test]
fn files_are_replaced_only_if_that_is_said() {
    let (folder, input, document) = opened();
    let old = fs::read(&input).expect("the input");
    let other = folder.path().join("other.ply");
    fs::write(&other, "precious").expect("a file");
    let roundabout = folder.path().join("..").join(folder.path().file_name().expect("a name")).join("in.ply");
    let mut inputs = vec![input.clone(), roundabout];
    #[cfg(unix)]
    {
        inputs.push(folder.path().join("link.ply"));
        std::os::unix::fs::symlink(&input, &inputs[2]).expect("a link");
    }
    for path in &inputs {
        for replace in [Replace::Nothing, Replace::Files] {
            let refused = export(&document, ExportScope::All, path, replace, &());
            assert!(matches!(refused, Err(ExportError::Input { .. })), "{}: {refused:?}", path.display());
        }
    }
    let refused = export(&document, ExportScope::All, &other, Replace::Nothing, &());
    assert!(matches!(refused, Err(ExportError::Exists { .. })), "{refused:?}");
    assert_eq!(fs::read(&input).expect("the input"), old, "the input is as it was");
    assert_eq!(fs::read(&other).expect("the file"), b"precious", "the other one, too");

    export(&document, ExportScope::All, &other, Replace::Files, &()).expect("may be replaced");
    assert_eq!(exact(&other).len(), 50, "the half that is left");
    for path in &inputs {
        export(&document, ExportScope::All, path, Replace::Inputs, &()).expect("may be replaced");
        assert_eq!(exact(&input).len(), 50, "{}", path.display());
    }
    #[cfg(unix)]
    assert!(inputs[2].symlink_metadata().expect("the link").is_symlink(), "a link stays a link");
}

/// Cancels at once, or records notes.
#[derive(Default)]
struct Watcher {
    stop: bool,
    notes: Mutex<Vec<String>>,
}

impl Progress for Watcher {
    fn report(&self, _: f32) {}

    fn cancelled(&self) -> bool {
        self.stop
    }

    fn note(&self, note: &str) {
        self.notes.lock().expect("no thread panicked").push(note.into());
    }
}

#[test]
fn what_fails_leaves_all_as_it_was() {
    let (folder, input, mut document) = opened();
    let old = fs::read(&input).expect("the input");
    let new = folder.path().join("new.ply");
    let stop = Watcher { stop: true, ..Watcher::default() };
    for path in [&input, &new] {
        let stopped = export(&document, ExportScope::All, path, Replace::Inputs, &stop);
        assert!(matches!(stopped, Err(ExportError::Cancelled)), "{stopped:?}");
    }
    let none = export(&document, ExportScope::Selected, &input, Replace::Inputs, &());
    assert!(matches!(none, Err(ExportError::Nothing)), "{none:?}");
    let unknown = export(&document, ExportScope::All, &folder.path().join("new.jpg"), Replace::Inputs, &());
    assert!(matches!(unknown, Err(ExportError::Cloud(Error::UnknownOutput { .. }))), "{unknown:?}");
    let nowhere = export(&document, ExportScope::All, &folder.path().join("no/new.ply"), Replace::Inputs, &());
    assert!(matches!(nowhere, Err(ExportError::Cloud(Error::Io { .. }))), "{nowhere:?}");
    document.layers.clear();
    let empty = export(&document, ExportScope::All, &new, Replace::Inputs, &());
    assert!(matches!(empty, Err(ExportError::Nothing)), "{empty:?}");
    assert_eq!(fs::read(&input).expect("the input"), old, "the input is as it was");
    assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 1, "and nothing is beside it");
}

#[test]
fn losses_are_told() {
    let mut document = Document::default();
    document.add(Layer::new("a", None, cloud(10, FAR)));
    document.add(Layer::new("b", None, Arc::new(PointCloud::new(FAR, vec![[0.0; 3]]))));
    let folder = tempfile::tempdir().expect("a folder");
    let watcher = Watcher::default();
    export(&document, ExportScope::All, &folder.path().join("out.ply"), Replace::Nothing, &watcher).expect("written");
    let notes = watcher.notes.into_inner().expect("no thread panicked");
    assert_eq!(notes.first().map(|note| &**note), Some("not all layers have Id; it is left out"), "{notes:?}");
}
