//! Reads recordings written by other programs. `interop/recordings.py` writes them and describes their content.
//!
//! Ignored by default, since the test needs Python with the packages of `interop/requirements.txt`. `cargo xtask peers`
//! installs them. To run the test with another Python:
//! `AUTOSPLATS_PYTHON=python3 cargo test -p autosplats-sources --test it interop:: -- --ignored`.

use std::{path::Path, process::Command, time::Duration};

use autosplats_cloud::glam::DVec3;
use autosplats_sources::{Next, Recording, RecordingOptions, Stream as _, Update};
use serde_json::Value;

#[test]
#[ignore = "needs Python: AUTOSPLATS_PYTHON has to name one"]
fn recordings_of_other_programs_are_the_points_they_wrote() {
    let python = std::env::var_os("AUTOSPLATS_PYTHON").expect("AUTOSPLATS_PYTHON names a Python with what is needed");
    let folder = tempfile::tempdir().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/interop/recordings.py");
    for seed in ["1", "2", "3"] {
        let recordings = folder.path().join(seed);
        let made = Command::new(&python).arg(&script).arg(&recordings).arg(seed).output().unwrap();
        let said = String::from_utf8_lossy(&made.stderr);
        assert!(made.status.success(), "{}: {said}", script.display());
        let mut checked = 0;
        for entry in std::fs::read_dir(&recordings).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "json") {
                check(&path.with_extension(""), &serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap());
                checked += 1;
            }
        }
        assert_eq!(checked, 26, "recordings of seed {seed}");
    }
}

fn check(path: &Path, expected: &Value) {
    let what = path.display();
    let mut recording =
        Recording::open(path, &RecordingOptions::default(), &()).unwrap_or_else(|error| panic!("{error}"));
    let channels = recording.channels().to_vec();
    let frames = expected["frames"].as_array().unwrap();
    let moved = expected["transforms"].as_bool().unwrap();
    assert_eq!(recording.summary().frame.as_deref(), moved.then_some("map"), "{what}");
    assert_eq!(recording.timeline().unwrap().len(), frames.len(), "{what}");
    for (index, frame) in frames.iter().enumerate() {
        let Next::Update(update) = recording.next(Duration::ZERO, &()).unwrap() else { panic!("{what} ends early") };
        let what = format!("{what}, frame {index}");
        assert_eq!(channels[update.channel], frame["topic"].as_str().unwrap(), "{what}");
        assert_eq!(update.stamp, frame["stamp"].as_i64().unwrap(), "{what}");
        check_points(&what, &update, frame);
    }
    assert_eq!(recording.next(Duration::ZERO, &()).unwrap(), Next::End, "{what}");
    assert_eq!(recording.statistics().refused, 0, "{what}");
}

fn check_points(what: &str, Update { cloud, .. }: &Update, frame: &Value) {
    let columns = frame["columns"].as_object().unwrap();
    // Null stands for NaN.
    let column = |name: &str| -> Vec<f64> {
        columns[name].as_array().unwrap().iter().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect()
    };
    let xyz = ["x", "y", "z"].map(column);
    assert_eq!(cloud.len(), xyz[0].len(), "{what}: points");
    for index in 0..cloud.len() {
        let wanted = DVec3::from(xyz.each_ref().map(|axis| axis[index]));
        let found = cloud.world_position(index);
        // Positions up to a hundred metres in f32. If one coordinate is NaN, all are.
        let same = found.abs_diff_eq(wanted, 2e-5) || !found.is_finite() && !wanted.is_finite();
        assert!(same, "{what}, point {index}: {found} is not {wanted}");
    }
    for name in columns.keys().filter(|name| !["x", "y", "z"].contains(&&***name)) {
        let field = cloud.field(name).unwrap_or_else(|| panic!("{what}: no field {name}"));
        for (index, wanted) in column(name).into_iter().enumerate() {
            let found = field.values.get(index);
            assert!(found == wanted || found.is_nan() && wanted.is_nan(), "{what}, {name} {index}: {found}, {wanted}");
        }
    }
    assert_eq!(cloud.fields().len(), columns.len() - 3, "{what}: fields");
    if !cloud.is_empty() {
        let sensor: Vec<f64> =
            frame["sensor"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect();
        let found = cloud.scans()[0].position();
        assert!(found.abs_diff_eq(DVec3::from_slice(&sensor), 1e-9), "{what}: the sensor stood at {found}");
    }
}
