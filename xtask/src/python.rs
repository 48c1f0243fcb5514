//! The package of Python: built, tested and checked, and its wheel.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail, ensure};
use serde_json::Value;

use crate::environment::{self, find, pip, python_in, quiet};
use crate::{FEATURES, cargo_command, run};

/// The package.
const CRATE: &str = "crates/autosplats-py";
/// What its tests take.
const PACKAGES: &str = "crates/autosplats-py/requirements-dev.txt";
/// Where that is installed, below `target`.
const FOLDER: &str = "package-python";
/// What building a wheel takes, and what checks it.
const WHEEL_PACKAGES: &str = "crates/autosplats-py/requirements-wheel.txt";
const WHEEL_FOLDER: &str = "wheel-python";
/// Packs a wheel again, smaller.
const REPACK: &str = "xtask/src/repack.py";
/// Largest wheel, in bytes. Eight megabytes are wished for, and not reached (docs/decisions/0055-python-measured.md).
const MAX_WHEEL: u64 = 9_800_000;
/// Libraries that the wheel may need of a Linux system: those of its C library, and the compiler's.
const NEEDED: [&str; 6] =
    ["libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2", "libgcc_s.so.1", "ld-linux-x86-64.so.2"];
/// Pythons that the wheel is installed for.
const PYTHONS: [&str; 6] = ["3.10", "3.11", "3.12", "3.13", "3.14", "3.15"];
/// What an empty environment does with it.
const SMOKE: &str = "\
import autosplats, numpy, sys
points = numpy.random.default_rng(0).normal(size=(20000, 3))
points /= numpy.linalg.norm(points, axis=1, keepdims=True)
picture = autosplats.render(points, size=(320, 200))
assert picture.counts['covered'] > 5000
normals = autosplats.estimate_normals(points, orient='outward').normals
assert numpy.median((normals * points).sum(axis=1)) > 0.99
print(f'Python {sys.version.split()[0]}, numpy {numpy.__version__}: pixels sum to {int(picture.array.sum())}')
";

/// A Python that has what the tests of the package take.
pub(crate) fn find_python(root: &Path) -> Result<Result<PathBuf, String>> {
    find(root, FOLDER, PACKAGES)
}

/// Builds the package as all else is built, and runs its tests, and the checks of its types.
pub(crate) fn test(root: &Path, python: &Path) -> Result<()> {
    let library = build(root)?;
    let place = root.join("target/python-package");
    assemble(&root.join(CRATE).join("python/autosplats"), &library, &place.join("autosplats"))?;
    let python = |arguments: &[&str]| {
        let mut command = Command::new(python);
        command.args(arguments).current_dir(root.join(CRATE)).env("PYTHONPATH", &place).env("NODEVICE_SELECT", "1");
        // Else there are files of byte code beside the sources.
        command.env("PYTHONDONTWRITEBYTECODE", "1").env_remove("AUTOSPLATS_NUM_THREADS");
        let outcome = run(&mut command);
        outcome.with_context(|| format!("python {}", arguments.join(" ")))
    };
    python(&["-m", "pytest", "--durations=5"])?;
    let cache = root.join("target/mypy").display().to_string();
    python(&["-m", "mypy", "--strict", "--cache-dir", &cache, "python/autosplats"])?;
    python(&["-m", "mypy.stubtest", "autosplats._core"])
}

/// The package's tests without all others.
pub(crate) fn alone(root: &Path) -> Result<()> {
    let python = find_python(root)?.map_err(anyhow::Error::msg)?;
    test(root, &python)
}

/// Builds the library, with the features that everything is built with, and returns its path.
fn build(root: &Path) -> Result<PathBuf> {
    let mut command = cargo_command(root);
    // With examples, though there are none, it stands on what the tests have built.
    command.args(["build", "--locked", "--workspace", "--lib", "--examples"]).args(FEATURES);
    command.args(["--message-format", "json-render-diagnostics"]);
    let output = command.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    ensure!(output.status.success(), "cargo build: {}", output.status);
    library(&String::from_utf8(output.stdout)?).context("cargo builds no library _core")
}

/// The library among the messages of cargo.
fn library(messages: &str) -> Option<PathBuf> {
    let mut messages = messages.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    messages.find_map(|message| {
        let is_ours = message["target"]["name"] == "_core" && message["target"]["kind"][0] == "cdylib";
        is_ours.then(|| message["filenames"][0].as_str().map(PathBuf::from))?
    })
}

/// Puts the package's files and its library together.
fn assemble(source: &Path, library: &Path, place: &Path) -> Result<()> {
    if place.exists() {
        fs::remove_dir_all(place)?;
    }
    fs::create_dir_all(place)?;
    for entry in fs::read_dir(source)? {
        let entry = entry?;
        if entry.file_type()?.is_file() {
            fs::copy(entry.path(), place.join(entry.file_name()))?;
        }
    }
    let name = if cfg!(windows) { "_core.pyd" } else { "_core.abi3.so" };
    fs::copy(library, place.join(name)).with_context(|| library.display().to_string())?;
    Ok(())
}

/// Builds the wheel for distribution, checks what it needs, and installs it into an empty environment of every Python
/// that is found.
pub(crate) fn wheel(root: &Path) -> Result<()> {
    let python = find(root, WHEEL_FOLDER, WHEEL_PACKAGES)?.map_err(anyhow::Error::msg)?;
    let out = root.join("target/wheels");
    if out.exists() {
        fs::remove_dir_all(&out)?;
    }
    let mut maturin = Command::new(&python);
    maturin.args(["-m", "maturin", "build", "--locked", "--profile", "dist", "--out"]).arg(&out);
    maturin.current_dir(root.join(CRATE));
    // A C library of old is linked by zig, which comes as a package of Python: a program on the path, or none is found.
    if cfg!(target_os = "linux") {
        let paths = std::env::var_os("PATH").unwrap_or_default();
        let programs = python.parent().map(Path::to_path_buf);
        maturin.env("PATH", std::env::join_paths(programs.into_iter().chain(std::env::split_paths(&paths)))?);
        maturin.args(["--zig", "--compatibility", "manylinux2014"]);
    }
    run(&mut maturin)?;
    let wheel = only_wheel(&out)?;
    run(Command::new(&python).arg(root.join(REPACK)).arg(&wheel))?;
    let bytes = fs::metadata(&wheel)?.len();
    println!("{}: {bytes} bytes", wheel.display());
    ensure!(bytes <= MAX_WHEEL, "{bytes} bytes, {MAX_WHEEL} allowed");
    if cfg!(target_os = "linux") {
        run(Command::new(&python).args(["-m", "auditwheel", "show"]).arg(&wheel))?;
        let list = Command::new(&python).args(["-c", LIBRARIES]).arg(&wheel).output()?;
        ensure!(list.status.success(), "{}", String::from_utf8_lossy(&list.stderr));
        let needed = String::from_utf8(list.stdout)?;
        println!("needs {}", needed.trim());
        if let Some(more) = needed.split_whitespace().find(|name| !NEEDED.contains(name)) {
            bail!("the library needs {more}");
        }
    }
    run(Command::new(&python).args(["-m", "abi3audit", "--strict", "--report"]).arg(&wheel))?;
    let found = pythons();
    ensure!(!found.is_empty(), "no Python is found");
    found.iter().try_for_each(|python| install(root, python, &wheel))
}

/// Prints the libraries that the wheel's library needs.
const LIBRARIES: &str = "\
import io, sys, zipfile
from elftools.elf.elffile import ELFFile
wheel = zipfile.ZipFile(sys.argv[1])
name = next(name for name in wheel.namelist() if name.endswith('.so'))
dynamic = ELFFile(io.BytesIO(wheel.read(name))).get_section_by_name('.dynamic')
print(*(tag.needed for tag in dynamic.iter_tags() if tag.entry.d_tag == 'DT_NEEDED'))
";

fn only_wheel(folder: &Path) -> Result<PathBuf> {
    let files = fs::read_dir(folder)?.collect::<Result<Vec<_>, _>>()?;
    let mut wheels = files.iter().map(fs::DirEntry::path).filter(|path| path.extension() == Some(OsStr::new("whl")));
    wheels.next().context("maturin makes no wheel")
}

/// The Pythons of the path and of pyenv, one a version.
fn pythons() -> Vec<PathBuf> {
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let home = std::env::var_os("HOME").map(PathBuf::from).unwrap_or_default();
    let versions = fs::read_dir(home.join(".pyenv/versions")).into_iter().flatten().flatten();
    let folders: Vec<PathBuf> =
        versions.map(|version| version.path().join("bin")).chain(std::env::split_paths(&paths)).collect();
    let of = |version: &&str| {
        let candidates = folders.iter().map(|folder| folder.join(format!("python{version}")));
        // A shim of pyenv exists for versions that are not chosen, and fails.
        candidates.into_iter().find(|path| path.is_file() && quiet(Command::new(path).arg("--version")).is_ok())
    };
    PYTHONS.iter().filter_map(of).collect()
}

/// Installs the wheel into an empty environment and takes a picture there.
fn install(root: &Path, python: &Path, wheel: &Path) -> Result<()> {
    let folder = root.join("target/wheel-installed");
    environment::make(&folder, python).map_err(anyhow::Error::msg)?;
    let inside = python_in(&folder);
    pip(&inside, &[wheel]).map_err(anyhow::Error::msg)?;
    run(Command::new(&inside).args(["-I", "-c", SMOKE]).current_dir(&folder))?;
    let command = folder.join(if cfg!(windows) { "Scripts/autosplats.exe" } else { "bin/autosplats" });
    run(Command::new(command).arg("--version"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_library_is_found_among_messages() {
        let message = |name: &str, kind: &str, file: &str| {
            format!(r#"{{"target":{{"name":"{name}","kind":["{kind}"]}},"filenames":["{file}"]}}"#)
        };
        let lines = [message("autosplats", "lib", "/t/a.rlib"), message("_core", "cdylib", "/t/lib_core.so")];
        assert_eq!(library(&lines.join("\n")), Some("/t/lib_core.so".into()));
        assert_eq!(library(&lines[0]), None);
        assert_eq!(library(&message("_core", "custom-build", "/t/build")), None, "what builds it is another");
    }
}
