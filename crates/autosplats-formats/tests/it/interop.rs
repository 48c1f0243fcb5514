//! Octrees as other programs read them: laspy, and copclib over LAZ-perf.
//!
//! Ignored by default, since the test needs Python with packages. `cargo xtask peers` installs them.

use std::path::Path;
use std::process::Command;

use autosplats_formats::{TreeInput, TreeOptions, write_tree};

use crate::common::shared_data;

#[test]
#[ignore = "needs Python: AUTOSPLATS_PYTHON has to name one"]
fn other_programs_read_the_points_of_octrees() {
    let python = std::env::var_os("AUTOSPLATS_PYTHON").expect("AUTOSPLATS_PYTHON names a Python with what is needed");
    let Some(data) = shared_data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut pairs = Vec::new();
    // With GeoTIFF keys and text, extra bytes and degrees among them.
    for entry in std::fs::read_dir(data.join("scans")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "las" || extension == "laz") {
            let out = folder.path().join(path.file_stem().unwrap()).with_extension("copc.laz");
            let options = TreeOptions { memory: 512 << 20, keep_no_returns: true, ..TreeOptions::default() };
            write_tree(vec![TreeInput::Las(path.clone())], &out, &options, &()).unwrap();
            pairs.extend([path, out]);
        }
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/interop/octrees.py");
    let read = Command::new(python).arg(script).args(&pairs).output().unwrap();
    let [said, errors] = [read.stdout, read.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(read.status.success(), "{said}{errors}");
    assert!(pairs.len() >= 16 && said.lines().count() == pairs.len() / 2, "{said}");
}
