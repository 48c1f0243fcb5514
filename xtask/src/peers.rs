//! Programs of others that the tests hear and read: a Python whose packages write recordings and send messages.

use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context as _, Result, ensure};

use crate::environment::find;
use crate::{FEATURES, cargo_command};

/// The packages and their versions.
const PACKAGES: &str = "crates/autosplats-sources/tests/interop/requirements.txt";
/// Where they are installed, below `target`; kept as long as the list is the same.
const FOLDER: &str = "interop-python";
/// The test that needs a network with multicast, which nobody else uses.
const NEEDS_MULTICAST: &str = "whoever_answers_on_the_network_is_heard";

/// A Python that has the packages: the one that `AUTOSPLATS_PYTHON` names, or one that is made for it.
pub(crate) fn find_python(root: &Path) -> Result<Result<PathBuf, String>> {
    if let Some(python) = std::env::var_os("AUTOSPLATS_PYTHON") {
        println!("AUTOSPLATS_PYTHON names {}", Path::new(&python).display());
        return Ok(Ok(python.into()));
    }
    find(root, FOLDER, PACKAGES)
}

/// The tests that hear and read these programs; by `which` all of them, or those alone that need a Python.
pub(crate) fn test(root: &Path, python: &Path, which: &[&str]) -> Result<()> {
    let mut command = cargo_command(root);
    command.args(["test", "--locked", "--workspace"]).args(FEATURES).args([
        "--test",
        "it",
        "--",
        "remote::",
        "interop::",
    ]);
    command.args(which).args(["--skip", NEEDS_MULTICAST]).env("AUTOSPLATS_PYTHON", python);
    let output = command.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    let said = String::from_utf8_lossy(&output.stdout);
    print!("{said}");
    ensure!(output.status.success(), "{:?}: {}", command.get_args().collect::<Vec<_>>(), output.status);
    // A name that no test has any more would match nothing, and pass.
    for module in ["remote::", "interop::"] {
        ensure!(said.contains(&format!("test {module}")), "no test of {module} was run");
    }
    Ok(())
}

/// These tests without all others.
pub(crate) fn alone(root: &Path) -> Result<()> {
    let python = find_python(root)?.map_err(anyhow::Error::msg)?;
    test(root, &python, &["--include-ignored"])
}
