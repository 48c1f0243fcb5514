//! `cargo xtask performance`: measures the command, built with the profile `dist`, into a file of `docs/performance/`,
//! and writes `docs/PERFORMANCE.md` from all files there.

mod measure;
pub(crate) mod page;

use std::collections::BTreeMap;
use std::fs::{read_dir, read_to_string, write};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, ensure};
use serde_json::Value;

use self::page::PERFORMANCE;
use crate::build_command;

/// One JSON file per machine: what it is, the commit, the date, and a list of rows for each table.
const FOLDER: &str = "docs/performance";
const PAGE: &str = "docs/PERFORMANCE.md";
const OPTIONS: [&str; 4] = ["--machine", "--program", "--commit", "--only"];

/// Measures, unless the words are `--page` alone, and writes the page. If the machine's name has a folder, its file
/// goes there, and no page is written: a machine with a GPU may have no repository.
pub(crate) fn run(root: &Path, words: &[&str]) -> Result<()> {
    if words != ["--page"] {
        let options: BTreeMap<_, _> = words.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
        let is_known = options.len() * 2 == words.len() && options.keys().all(|name| OPTIONS.contains(name));
        ensure!(is_known, "performance takes --page, or {} with a value each", OPTIONS.join(", "));
        let machine = options.get("--machine").context("--machine NAME is missing; NAME.json gets the results")?;
        let described = || answer(Command::new("git").current_dir(root).args(["describe", "--always", "--dirty"]));
        let commit = options.get("--commit").map_or_else(described, |commit| Ok((*commit).to_owned()))?;
        let find = |path: &&str| Path::new(path).canonicalize().with_context(|| (*path).to_owned());
        let program = options.get("--program").map_or_else(|| build_command(root, "dist"), find)?;
        let mut results = measure::all(&program, options.get("--only").copied().unwrap_or_default())?;
        results["commit"] = commit.into();
        results["date"] = answer(Command::new("date").args(["-u", "+%F"]))?.into();
        write_results(&root.join(FOLDER).join(format!("{machine}.json")), &results)?;
        if machine.contains(['/', '\\']) {
            return Ok(());
        }
    }
    write(root.join(PAGE), page::page(&PERFORMANCE, &machines(&root.join(FOLDER))?)).context(PAGE)
}

/// Writes a file of results, with a line per row.
pub(crate) fn write_results(path: &Path, results: &Value) -> Result<()> {
    let text = results.to_string().replace("[{", "[\n{").replace("},{", "},\n{") + "\n";
    write(path, text).with_context(|| path.display().to_string())
}

/// What a command prints.
pub(crate) fn answer(command: &mut Command) -> Result<String> {
    let output = command.output().with_context(|| format!("cannot start {}", command.get_program().display()))?;
    let message = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "{:?}: {}", command.get_args().collect::<Vec<_>>(), message.trim());
    Ok(String::from_utf8(output.stdout)?.trim().to_owned())
}

/// Each machine's name and file in a folder of such files, in the order of names.
pub(crate) fn machines(folder: &Path) -> Result<BTreeMap<String, Value>> {
    let read = |path: PathBuf| -> Result<_> {
        let file = serde_json::from_str(&read_to_string(&path)?).with_context(|| path.display().to_string())?;
        Ok((path.file_stem().unwrap_or_default().display().to_string(), file))
    };
    let entries = read_dir(folder).with_context(|| folder.display().to_string())?;
    let paths = entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>>>()?;
    paths.into_iter().filter(|path| path.extension().is_some_and(|end| end == "json")).map(read).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_small_and_what_the_files_give() {
        let root = crate::root().expect("the repository");
        let page = page::page(&PERFORMANCE, &machines(&root.join(FOLDER)).expect("files of results"));
        assert!(page.len() <= 8_000, "{} bytes: leave out rows or files, as `lengths.rs` says", page.len());
        let there = read_to_string(root.join(PAGE)).expect("the page");
        assert!(there == page, "{PAGE} is not up to date: cargo xtask performance --page writes it");
    }
}
