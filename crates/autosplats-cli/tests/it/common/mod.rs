//! Runs the built command as a user would, in a folder of its own.

#![allow(dead_code, reason = "each test file uses a part of it")]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Substitute for ffmpeg: a script that stores its arguments and its input.
#[cfg(unix)]
pub(crate) const STORE_INPUT: &str = "echo \"$@\" > words; for last; do :; done; cat > \"$last\"";

/// Number of evenly spread points on the unit sphere.
pub(crate) const SPHERE_POINTS: usize = 6000;

/// Camera in front of the unit sphere.
pub(crate) const FRONT: [&str; 8] = ["--eye", "0,-4,0", "--look-at", "0,0,0", "--up", "0,0,1", "--fov", "40"];

/// Says that something is not tested on this machine. Not by `println!`, whose words a test that passes keeps.
pub(crate) fn left_out(what: &str, why: &str) {
    use std::io::Write as _;
    let _ = writeln!(std::io::stderr(), "left out: {what}: {why}");
}

/// Times that faults at random moments are repeated. `cargo xtask faults` asks for more.
pub(crate) fn rounds() -> u64 {
    let asked = std::env::var("AUTOSPLATS_ROUNDS").ok();
    asked.map_or(1, |text| text.parse().expect("AUTOSPLATS_ROUNDS is a number"))
}

/// A temporary folder, initially empty, in which the command runs.
pub(crate) struct Folder(tempfile::TempDir);

/// Exit code and output of a run.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder can be made"))
    }

    /// A folder with `sphere.ply`: coloured, with an intensity that grows with x.
    pub(crate) fn with_sphere() -> Self {
        let folder = Self::new();
        folder.write("sphere.ply", &sphere_ply());
        folder
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: &str) {
        fs::write(self.path(name), content).expect("the temporary folder can be written");
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Names of all entries, in order.
    pub(crate) fn list(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).expect("the temporary folder can be read");
        let mut names: Vec<_> = entries
            .map(|entry| entry.expect("an entry can be read").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        #[cfg(unix)]
        hear_signals();
        let mut command = Command::new(env!("CARGO_BIN_EXE_autosplats"));
        command.current_dir(self.0.path()).args(arguments).stdin(Stdio::null());
        // Prevents tests from opening a window by mistake.
        command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
        command
    }

    /// Installs a shell script as ffmpeg. Returns the `PATH` that finds it.
    #[cfg(unix)]
    pub(crate) fn with_ffmpeg(&self, script: &str) -> String {
        use std::os::unix::fs::PermissionsExt as _;
        fs::create_dir_all(self.path("bin")).expect("a folder");
        self.write("bin/ffmpeg", &format!("#!/bin/sh\n[ \"$1\" = -version ] && exit\n{script}\n"));
        fs::set_permissions(self.path("bin/ffmpeg"), fs::Permissions::from_mode(0o755)).expect("a program");
        format!("{}:{}", self.path("bin").display(), std::env::var("PATH").expect("a path"))
    }

    pub(crate) fn run(&self, arguments: &[&str]) -> Outcome {
        let Output { status, stdout, stderr } = self.command(arguments).output().expect("the command starts");
        Outcome {
            code: status.code(),
            stdout: String::from_utf8(stdout).expect("standard output is UTF-8"),
            stderr: String::from_utf8(stderr).expect("standard error is UTF-8"),
        }
    }

    /// Runs the command, which must succeed.
    pub(crate) fn succeed(&self, arguments: &[&str]) -> Outcome {
        let outcome = self.run(arguments);
        assert_eq!(outcome.code, Some(0), "{arguments:?}: {}", outcome.stderr);
        outcome
    }

    /// Runs the command, which must fail with `code`, print one line that contains all of `words`, and leave no new
    /// file.
    pub(crate) fn fail(&self, arguments: &[&str], code: i32, words: &[&str]) {
        let before = self.list();
        let Outcome { code: found, stdout, stderr } = self.run(arguments);
        assert_eq!(found, Some(code), "{arguments:?}: {stderr}");
        assert_eq!(stdout, "", "{arguments:?} fails, so there is no data");
        assert!(stderr.starts_with("error: "), "{arguments:?}: {stderr}");
        assert_eq!(stderr.trim_end().lines().count(), 1, "{arguments:?}: one line, not {stderr}");
        for word in words {
            assert!(stderr.contains(word), "{arguments:?}: '{word}' is not in {stderr}");
        }
        assert_eq!(self.list(), before, "{arguments:?} leaves nothing behind");
    }
}

/// Makes started commands hear signals, which would inherit that the tests ignore them, as programs in the background
/// of a script do. A signal that this process handles has its default in those that it starts.
#[cfg(unix)]
fn hear_signals() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
    use signal_hook::flag::{register, register_conditional_default};
    use std::sync::{Arc, Once, atomic::AtomicBool};
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        for signal in [SIGINT, SIGQUIT, SIGTERM] {
            register_conditional_default(signal, Arc::new(AtomicBool::new(true))).expect("it can be handled");
        }
        register(SIGHUP, Arc::default()).expect("it can be handled");
    });
}

/// Position of point `index` of the sphere.
pub(crate) fn sphere_point(index: usize) -> [f64; 3] {
    let height = 1.0 - (2 * index + 1) as f64 / SPHERE_POINTS as f64;
    let angle = index as f64 * 2.399_963_229_728_653;
    let radius = (1.0 - height * height).sqrt();
    [radius * angle.cos(), radius * angle.sin(), height]
}

pub(crate) fn sphere_ply() -> String {
    let points = (0..SPHERE_POINTS).map(|index| {
        let [x, y, z] = sphere_point(index);
        format!("{x:.6} {y:.6} {z:.6} 200 100 50 {:.3}", 10.0 * x)
    });
    ply(&["float x", "float y", "float z", "uchar red", "uchar green", "uchar blue", "float intensity"], points)
}

/// An ASCII PLY file with one row per point.
pub(crate) fn ply(properties: &[&str], rows: impl Iterator<Item = String>) -> String {
    let rows: Vec<_> = rows.collect();
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", rows.len());
    for property in properties {
        let _ = writeln!(text, "property {property}");
    }
    text + "end_header\n" + &rows.iter().map(|row| format!("{row}\n")).collect::<String>()
}

/// An ASCII PLY file of bare positions.
pub(crate) fn points_ply(points: &[&str]) -> String {
    ply(&["float x", "float y", "float z"], points.iter().map(|point| (*point).to_owned()))
}

/// Folder of real scans, if present. Required in CI.
pub(crate) fn data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("AUTOSPLATS_DATA").map_or(beside, PathBuf::from);
    let found = folder.canonicalize().ok();
    assert!(found.is_some() || std::env::var_os("CI").is_none(), "CI has the test data at {}", folder.display());
    if found.is_none() {
        println!("{} is absent: this test checks nothing. AUTOSPLATS_DATA can name another folder.", folder.display());
    }
    found
}
