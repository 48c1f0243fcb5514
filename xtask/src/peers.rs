//! Programs of others that the tests hear and read: a Python whose packages write recordings and send messages.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail, ensure};

use crate::machine::install;
use crate::{FEATURES, cargo_command};

/// The packages and their versions.
const PACKAGES: &str = "crates/autosplats-sources/tests/interop/requirements.txt";
/// Where they are installed, below `target`; kept as long as the list is the same.
const FOLDER: &str = "interop-python";
/// What an environment of Python takes on Debian and its kin.
const PYTHON: [&str; 2] = ["python3-venv", "python3-pip"];
/// The test that needs a network with multicast, which nobody else uses.
const NEEDS_MULTICAST: &str = "whoever_answers_on_the_network_is_heard";

/// A Python that has the packages: the one that `AUTOSPLATS_PYTHON` names, or one that is made for it. Where there can
/// be none that is an error in CI; elsewhere it is told why there is none.
pub(crate) fn find_python(root: &Path) -> Result<Result<PathBuf, String>> {
    if let Some(python) = std::env::var_os("AUTOSPLATS_PYTHON") {
        println!("AUTOSPLATS_PYTHON names {}", Path::new(&python).display());
        return Ok(Ok(python.into()));
    }
    let packages = root.join(PACKAGES);
    let wanted = fs::read_to_string(&packages).with_context(|| packages.display().to_string())?;
    let folder = root.join("target").join(FOLDER);
    let python = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    // Written last, so that what was interrupted is made anew.
    let installed = folder.join("installed.txt");
    let runs = || quiet(Command::new(&python).arg("--version")).is_ok();
    if fs::read_to_string(&installed).is_ok_and(|there| there == wanted) && runs() {
        println!("{} has what {PACKAGES} lists", folder.display());
        return Ok(Ok(python));
    }
    let made = make(&folder, &python, &packages);
    if let Err(why) = made {
        // The error of a step, whose cause stands behind it.
        return if std::env::var_os("CI").is_some() { bail!("{why}") } else { Ok(Err(why)) };
    }
    fs::write(&installed, wanted).with_context(|| installed.display().to_string())?;
    println!("installed what {PACKAGES} lists in {}", folder.display());
    Ok(Ok(python))
}

/// Makes an environment with the packages, or says in a line what to do.
fn make(folder: &Path, python: &Path, packages: &Path) -> Result<(), String> {
    if folder.exists() {
        fs::remove_dir_all(folder).map_err(|error| format!("{}: {error}; remove it", folder.display()))?;
    }
    let environment = || quiet(Command::new("python3").args(["-m", "venv"]).arg(folder));
    if environment().is_err() {
        install(&PYTHON);
        environment().map_err(|why| {
            format!("no Python environment can be made: {why}; on Debian: apt-get install {}", PYTHON.join(" "))
        })?;
    }
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--requirement"];
    quiet(Command::new(python).args(pip).arg(packages)).map_err(|why| {
        format!("pip cannot install what {PACKAGES} lists: {why}; it needs Python 3.11 or newer, and the network once")
    })
}

/// Runs a program that says nothing unless it fails: then the last line of what it says is the error.
fn quiet(command: &mut Command) -> Result<(), String> {
    let output = command.stdin(Stdio::null()).output();
    let output = output.map_err(|error| format!("{} cannot be started: {error}", command.get_program().display()))?;
    if output.status.success() {
        return Ok(());
    }
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    let last = said.lines().map(str::trim).rfind(|line| !line.is_empty());
    Err(last.map_or_else(|| output.status.to_string(), str::to_owned))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_program_says_last_is_why_it_failed() {
        let shell = |script| quiet(Command::new("sh").args(["-c", script]));
        assert_eq!(shell("echo all is well"), Ok(()), "nothing to tell");
        assert_eq!(
            shell("echo first; echo '  the reason  ' >&2; echo >&2; exit 3"),
            Err("the reason".into()),
            "in a line"
        );
        assert!(shell("exit 3").is_err_and(|why| why.contains('3')), "at least its status");
        let absent = quiet(&mut Command::new("no-such-program"));
        assert!(absent.is_err_and(|why| why.starts_with("no-such-program cannot be started")), "nor does it exist");
    }
}
