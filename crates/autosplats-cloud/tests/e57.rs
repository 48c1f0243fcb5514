//! E57: real files must be what other programs say, made ones come back as they were, broken ones are told.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

mod common;

use std::{
    io::Write as _,
    path::{Path, PathBuf},
    sync::Mutex,
};

use autosplats_cloud::{
    Axes, Error, FieldValues, PointCloud, Progress, ReadOptions, Unit, glam::DVec3, read_bytes, read_with,
};

fn data() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("AUTOSPLATS_DATA").map_or_else(beside, PathBuf::from);
    if folder.join("README.md").exists() {
        return Some(folder);
    }
    assert!(std::env::var_os("CI").is_none(), "the shared files are not at {}", folder.display());
    // Past the test harness, which would swallow what a passing test prints.
    let message = format!("SKIPPED: the shared files are not at {}; nothing is checked\n", folder.display());
    std::io::stderr().write_all(message.as_bytes()).unwrap();
    None
}

/// Remembers the notes.
#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Progress for Notes {
    fn report(&self, _fraction: f32) {}

    fn note(&self, note: &str) {
        self.0.lock().unwrap().push(note.into());
    }
}

fn load(path: &Path, options: &ReadOptions) -> (PointCloud, Vec<String>) {
    let notes = Notes::default();
    let cloud = read_with(path, options, &notes).unwrap_or_else(|error| panic!("{error}"));
    (cloud, notes.0.into_inner().unwrap())
}

fn bounds(cloud: &PointCloud) -> [DVec3; 2] {
    (0..cloud.len())
        .map(|i| cloud.world_position(i))
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], point| [low.min(point), high.max(point)])
}

/// File, points, bounds, whether there are colours.
type Case = (&'static str, usize, [f64; 3], [f64; 3], bool);

#[rustfmt::skip]
const CASES: &[Case] = &[
    ("scans/bunny_float.e57", 30_571, [-0.094689, 0.040011, -0.061873], [0.061009, 0.187321, 0.058799], false),
    ("scans/bunny_scaledint19.e57", 30_571, [-0.094689, 0.040011, -0.061873], [0.061009, 0.187321, 0.058799], false),
    ("scans/pump_room.e57", 155_201, [-2.903763, -5.301102, -1.899704], [1.721603, -0.792648, 1.843002], true),
    ("scans/rgb_float.e57", 2_090, [-9.77953, 4.513879, 295.5247], [-6.774238, 7.51546, 298.5322], true),
    ("scans/spherical.e57", 180, [6.341362e-7, -0.4999986, 0.0], [1.0, 0.4999998, 0.9999997], false),
    ("scans/two_scans.e57", 6, [-44.11944, 0.7053028, -0.6077], [-42.6395, 2.0578, 0.6667], true),
    ("malformed/e57_read_error.e57", 2_651, [0.0; 3], [0.0; 3], true),
    ("malformed/e57_invalid_cv_header.e57", 0, [f64::INFINITY; 3], [f64::NEG_INFINITY; 3], false),
    ("malformed/e57_empty.e57", 0, [f64::INFINITY; 3], [f64::NEG_INFINITY; 3], false),
];

#[test]
fn real_files_are_what_others_say() {
    let Some(folder) = data() else { return };
    for exact in [false, true] {
        for &(file, count, low, high, colored) in CASES {
            let (cloud, notes) = load(&folder.join(file), &ReadOptions { exact, ..ReadOptions::default() });
            assert_eq!((cloud.len(), cloud.colors().is_some()), (count, colored), "{file}");
            let [found_low, found_high] = bounds(&cloud);
            for (found, expected) in [(found_low, low), (found_high, high)] {
                let error = (found - DVec3::from(expected)).abs().max_element();
                assert!(count == 0 || error < 1e-6 * found.length().max(1.0), "{file}: {found} is not {expected:?}");
            }
            drop(notes);
        }
    }
}
