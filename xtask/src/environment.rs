//! Environments of Python, made for the tests below `target`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail};

use crate::machine::install;

/// What an environment of Python takes on Debian and its kin.
const PYTHON: [&str; 2] = ["python3-venv", "python3-pip"];

/// A Python in `folder` below `target` that has the packages that a file lists; kept as long as the list is the same.
/// Where there can be none that is an error in CI; elsewhere it is told why there is none.
pub(crate) fn find(root: &Path, folder: &str, packages: &str) -> Result<Result<PathBuf, String>> {
    let list = root.join(packages);
    let wanted = fs::read_to_string(&list).with_context(|| list.display().to_string())?;
    let folder = root.join("target").join(folder);
    let python = python_in(&folder);
    // Written last, so that what was interrupted is made anew.
    let installed = folder.join("installed.txt");
    let runs = || quiet(Command::new(&python).arg("--version")).is_ok();
    if fs::read_to_string(&installed).is_ok_and(|there| there == wanted) && runs() {
        println!("{} has what {packages} lists", folder.display());
        return Ok(Ok(python));
    }
    let made = make(&folder, Path::new("python3")).and_then(|()| {
        let arguments = ["--requirement".as_ref(), list.as_os_str()];
        pip(&python, &arguments).map_err(|why| {
            format!(
                "pip cannot install what {packages} lists: {why}; it needs Python 3.11 or newer, and the network once"
            )
        })
    });
    if let Err(why) = made {
        // The error of a step, whose cause stands behind it.
        return if std::env::var_os("CI").is_some() { bail!("{why}") } else { Ok(Err(why)) };
    }
    fs::write(&installed, wanted).with_context(|| installed.display().to_string())?;
    println!("installed what {packages} lists in {}", folder.display());
    Ok(Ok(python))
}

/// The Python of an environment.
pub(crate) fn python_in(folder: &Path) -> PathBuf {
    folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" })
}

/// Makes an empty environment of a Python, or says in a line what to do.
pub(crate) fn make(folder: &Path, python: &Path) -> Result<(), String> {
    if folder.exists() {
        fs::remove_dir_all(folder).map_err(|error| format!("{}: {error}; remove it", folder.display()))?;
    }
    let environment = || quiet(Command::new(python).args(["-m", "venv"]).arg(folder));
    environment().or_else(|_| {
        install(&PYTHON);
        environment().map_err(|why| {
            format!("no Python environment can be made: {why}; on Debian: apt-get install {}", PYTHON.join(" "))
        })
    })
}

/// Installs by pip.
pub(crate) fn pip(python: &Path, arguments: &[impl AsRef<std::ffi::OsStr>]) -> Result<(), String> {
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    quiet(Command::new(python).args(install).args(arguments))
}

/// Runs a program that says nothing unless it fails: then the last line of what it says is the error.
pub(crate) fn quiet(command: &mut Command) -> Result<(), String> {
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
