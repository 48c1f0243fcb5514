//! Observed reading: progress, notes, early points, and cancellation.

use std::{
    path::{Path, PathBuf},
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
};

use crate::common::{colors, positions};
use autosplats_cloud::{Error, PointCloud, Progress, glam::DVec3};
use autosplats_formats::{ReadOptions, read, read_with, write, written_formats};

/// Enough points for several chunks of every format.
const POINTS: usize = 1_500_000;

/// Stores every report, and cancels at a given check.
#[derive(Default)]
struct Watcher {
    fractions: Mutex<Vec<f32>>,
    chunks: Mutex<Vec<PointCloud>>,
    notes: Mutex<Vec<String>>,
    looks: AtomicUsize,
    cancel_at: Option<usize>,
}

impl Progress for Watcher {
    fn report(&self, fraction: f32) {
        self.fractions.lock().unwrap().push(fraction);
    }

    fn cancelled(&self) -> bool {
        let looks = self.looks.fetch_add(1, Ordering::SeqCst);
        self.cancel_at.is_some_and(|at| looks >= at)
    }

    fn note(&self, note: &str) {
        self.notes.lock().unwrap().push(note.into());
    }

    fn wants_chunks(&self) -> bool {
        self.cancel_at.is_none()
    }

    fn chunk(&self, points: PointCloud) {
        self.chunks.lock().unwrap().push(points);
    }
}

/// Files of formats without a writer: other encodings, lists, and meshes.
fn unwritten(folder: &Path, points: &[[f32; 3]]) -> Vec<PathBuf> {
    let count = points.len();
    let xyz = "property float x\nproperty float y\nproperty float z\nend_header\n";
    let floats = |point: &[f32; 3]| point.map(f32::to_le_bytes).into_iter().flatten().collect::<Vec<u8>>();
    let rows = |before: &str| points.iter().map(|[x, y, z]| format!("{before}{x} {y} {z}\n")).collect::<String>();
    let header = format!("element vertex {count}\n");
    let text_ply = format!("ply\nformat ascii 1.0\n{header}{xyz}{}", rows(""));
    let list = "property list uchar uchar ids\n";
    let mut list_ply = format!("ply\nformat binary_little_endian 1.0\n{header}{list}{xyz}").into_bytes();
    list_ply.extend(points.iter().flat_map(|point| [vec![1, 7], floats(point)].concat()));
    let text_pcd = format!(
        "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\nHEIGHT 1\nPOINTS {count}\nDATA ascii\n{}",
        rows("")
    );
    let mut stl = [&[b' '; 80][..], &(count as u32 / 3).to_le_bytes()].concat();
    for corners in points.chunks_exact(3) {
        stl.extend([0; 12]);
        stl.extend(corners.iter().flat_map(floats));
        stl.extend([0; 2]);
    }
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},
        "mode":0}}]}}],"accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteLength":{0}}}],"buffers":[{{"uri":"a.bin","byteLength":{0}}}]}}"#,
        12 * count
    );
    std::fs::write(folder.join("a.bin"), points.iter().flat_map(floats).collect::<Vec<u8>>()).unwrap();
    let files = [
        ("text.ply", text_ply.into_bytes()),
        ("list.ply", list_ply),
        ("text.pcd", text_pcd.into_bytes()),
        ("a.off", format!("OFF\n{count} 0 0\n{}", rows("")).into_bytes()),
        ("a.obj", rows("v ").into_bytes()),
        ("a.stl", stl),
        ("a.gltf", json.into_bytes()),
    ];
    let write = |(name, bytes): (&str, Vec<u8>)| {
        std::fs::write(folder.join(name), bytes).unwrap();
        folder.join(name)
    };
    files.into_iter().map(write).collect()
}

/// One file of every format.
fn files(folder: &Path) -> Vec<PathBuf> {
    let cloud = PointCloud::new(DVec3::new(5e5, 5e6, 0.0), positions(POINTS)).with_colors(colors(POINTS)).unwrap();
    let names = written_formats().flat_map(|(_, extensions)| extensions).filter(|extension| !extension.contains('.'));
    let written = names.map(|extension| {
        let path = folder.join(format!("a.{extension}"));
        write(&cloud, &path, &()).unwrap();
        path
    });
    written.chain(unwritten(folder, cloud.positions())).collect()
}

#[test]
fn points_come_in_order_before_the_end() {
    let folder = tempfile::tempdir().unwrap();
    for path in files(folder.path()) {
        let watcher = Watcher::default();
        let whole = read(&path, &watcher).unwrap();
        let chunks = watcher.chunks.into_inner().unwrap();
        assert!(chunks.len() > 1, "{}: {} chunks", path.display(), chunks.len());
        let mut at = 0;
        for chunk in &chunks {
            for i in (0..chunk.len()).step_by(997) {
                let (early, late) = (chunk.world_position(i), whole.world_position(at + i));
                assert!((early - late).abs().max_element() < 0.01, "{}: {early} is {late}", path.display());
            }
            at += chunk.len();
        }
        assert_eq!(at, whole.len(), "{}: the chunks hold all points", path.display());
        let fractions = watcher.fractions.into_inner().unwrap();
        assert!(fractions.is_sorted(), "{}: progress never falls: {fractions:?}", path.display());
        assert_eq!(fractions.last(), Some(&1.0), "{}: and ends at 1", path.display());
        assert!(fractions.len() > 4, "{}: {fractions:?} is little news", path.display());
    }
}

#[test]
fn reading_ends_when_it_is_to() {
    let folder = tempfile::tempdir().unwrap();
    for path in files(folder.path()) {
        for look in [0, 1, 4] {
            let watcher = Watcher { cancel_at: Some(look), ..Watcher::default() };
            let outcome = read(&path, &watcher);
            assert!(matches!(outcome, Err(Error::Cancelled)), "{} at look {look}", path.display());
            let looks = watcher.looks.load(Ordering::SeqCst);
            assert!(looks <= look + 4, "{} at look {look}: {looks} more looks", path.display());
        }
    }
}

#[test]
fn points_without_a_return_are_dropped_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let mut points = positions(50);
    points[3] = [0.0; 3];
    points[7] = [0.0; 3];
    write(&PointCloud::new(DVec3::ZERO, points), &path, &()).unwrap();
    let watcher = Watcher::default();
    assert_eq!(read(&path, &watcher).unwrap().len(), 48, "two of fifty are at the sensor");
    let notes = watcher.notes.into_inner().unwrap();
    assert_eq!(notes, ["dropped 2 of 50 points at (0, 0, 0), where nothing was measured"], "and it is told");
    let options = ReadOptions { keep_no_returns: true, ..ReadOptions::default() };
    assert_eq!(read_with(&path, &options, &()).unwrap().len(), 50, "unless they are wanted");
}
