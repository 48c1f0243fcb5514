//! `cargo xtask formats`: writes docs/FORMATS.md from the program's own description of its formats and from the test
//! data.

mod kinds;
mod outcome;
mod words;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{read_dir, read_to_string};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail, ensure};
use serde_json::Value;

use crate::lanes::in_lanes;
use crate::{FEATURES, cargo_command};

use self::kinds::{KINDS, KINDS_TEXT};
use self::outcome::{FileOutcome, FileRow};
use self::words::{FIELD_TEXT, FILES_TEXT, FORMAT_TEXTS, HEAD_TEXT};

/// Files that are looked at beside each other.
const PROCESSES: usize = 2;

/// The document, from the repository's root.
const DOCUMENT: &str = "docs/FORMATS.md";

/// Files that accompany point files, with what they are.
const COMPANION_FILES: [(&str, &str); 4] = [
    ("README.md", "documentation"),
    (".conf", "poses of scans"),
    ("pose.txt", "poses of pictures"),
    ("color_", "colour picture"),
];

/// Writes the document.
pub(crate) fn write(root: &Path, program: &Path) -> Result<()> {
    let target = root.join(DOCUMENT);
    std::fs::write(&target, document(root, program)?).with_context(|| target.display().to_string())?;
    println!("{}", target.display());
    Ok(())
}

/// Checks that the document is what this build writes. Where there is no data this says that nothing is checked; where
/// `CI` is set it fails.
pub(crate) fn check(root: &Path, program: &Path) -> Result<()> {
    if data(root).is_err() && std::env::var_os("CI").is_none() {
        println!("the test data are absent: {DOCUMENT} is not checked");
        return Ok(());
    }
    let there = read_to_string(root.join(DOCUMENT)).unwrap_or_default();
    let document = document(root, program)?;
    let differing = there.lines().zip(document.lines()).find(|(there, new)| there != new);
    if let Some((there, new)) = differing {
        println!("there: {there}\nmade:  {new}");
    }
    ensure!(there == document, "{DOCUMENT} is not what this build makes; cargo xtask formats writes it");
    println!("{DOCUMENT} is up to date");
    Ok(())
}

fn data(root: &Path) -> Result<PathBuf> {
    let data = std::env::var_os("AUTOSPLATS_DATA").map_or_else(|| root.join("../shared/data"), PathBuf::from);
    data.canonicalize().with_context(|| format!("{}: the test data are needed", data.display()))
}

/// The folder of small files with a fault each, beside the test data.
fn field(data: &Path) -> Result<PathBuf> {
    let field = data.join("../field");
    field.canonicalize().with_context(|| format!("{}: the field cases are needed", field.display()))
}

fn document(root: &Path, program: &Path) -> Result<String> {
    let mut document = HEAD_TEXT.to_owned();
    formats(program, &mut document)?;
    schema(program, &mut document)?;
    kinds(&mut document);
    let data = data(root)?;
    files(program, &data, FILES_TEXT, &mut document)?;
    files(program, &field(&data)?, FIELD_TEXT, &mut document)?;
    Ok(document)
}

/// Builds the command as the tests have it, and returns where it is.
pub(crate) fn build(root: &Path) -> Result<PathBuf> {
    let mut command = cargo_command(root);
    command
        .args(["build", "--locked", "--workspace", "--bin", "autosplats", "--message-format", "json"])
        .args(FEATURES);
    let output = command.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    ensure!(output.status.success(), "cargo build: {}", output.status);
    let messages = String::from_utf8(output.stdout)?;
    let mut programs = messages.lines().filter_map(|line| {
        let message: Value = serde_json::from_str(line).ok()?;
        Some(PathBuf::from(message["executable"].as_str()?))
    });
    programs.next_back().context("cargo builds no program")
}

/// Writes the tables of formats, read and written.
fn formats(program: &Path, document: &mut String) -> Result<()> {
    let output = Command::new(program).args(["doctor", "--json"]).output().context("cannot start the program")?;
    let found: Value = serde_json::from_slice(&output.stdout).context("doctor --json")?;
    document.push_str("\n## Read\n\n| format | extensions | kept | not kept |\n|---|---|---|---|\n");
    let list = |which: &str| found["formats"][which].as_array().cloned().unwrap_or_default();
    for format in list("read") {
        let (name, extensions) = name_and_extensions(&format);
        let Some(words) = FORMAT_TEXTS.iter().find(|words| words.name == name) else {
            bail!("format {name}: describe it in xtask/src/formats/words.rs");
        };
        let _ = writeln!(document, "| {name} | {extensions} | {} | {} |", words.kept, words.not_kept);
    }
    document.push_str(
        "\n## Written\n\nThe extension of the output selects the format.\n\n| format | extensions |\n|---|---|\n",
    );
    for format in list("written") {
        let (name, extensions) = name_and_extensions(&format);
        let _ = writeln!(document, "| {name} | {extensions} |");
    }
    Ok(())
}

fn name_and_extensions(format: &Value) -> (&str, String) {
    let extensions = format["extensions"].as_array().into_iter().flatten().filter_map(Value::as_str);
    let extensions: Vec<_> = extensions.map(|extension| format!("`.{extension}`")).collect();
    (format["name"].as_str().unwrap_or_default(), extensions.join(" "))
}

/// Copies the description of the JSON from the program's help.
fn schema(program: &Path, document: &mut String) -> Result<()> {
    let output = Command::new(program).args(["info", "--help"]).output().context("cannot start the program")?;
    let help = String::from_utf8(output.stdout)?;
    let start = help.find("Fields of the JSON").context("info --help does not list the fields of its JSON")?;
    document.push_str(
        "\n## The JSON of info\n\n`autosplats info --json` prints one object, or an array for several inputs.\n\n",
    );
    let _ = writeln!(document, "```text\n{}\n```", help[start..].trim_end());
    Ok(())
}

/// Writes the table of kinds of faults.
fn kinds(document: &mut String) {
    let _ = write!(document, "\n{KINDS_TEXT}\n| what a file has | what becomes of it |\n|---|---|\n");
    for kind in KINDS {
        let _ = writeln!(document, "| {} | {} |", kind.fault, kind.outcome);
    }
}

/// Writes the table of the files of a folder.
fn files(program: &Path, data: &Path, text: &str, document: &mut String) -> Result<()> {
    let mut names = Vec::new();
    collect(data, data, &mut names)?;
    let pictures = tempfile::tempdir()?;
    let mut rows: Vec<FileRow> = Vec::new();
    let mut others: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let companion = |name: &str| {
        let base = name.rsplit('/').next().unwrap_or(name);
        COMPANION_FILES.iter().find(|(part, _)| base.starts_with(part) || base.ends_with(part)).map(|(_, about)| *about)
    };
    let is_recording = |name: &str| (name.ends_with(".mcap") && !name.contains("lfs")) || name.ends_with(".bag");
    let outcomes = in_lanes(PROCESSES, &names, |name| {
        if companion(name).is_some() || is_recording(name) {
            return Ok(None);
        }
        println!("{name}");
        // Each lane needs a picture of its own.
        let picture = pictures.path().join(format!("{}.png", name.replace('/', "_")));
        FileOutcome::of(program, data, name, &picture).map(Some)
    });
    for (name, outcome) in names.into_iter().zip(outcomes) {
        let Some(outcome) = outcome? else {
            let about = companion(&name).unwrap_or("recordings (played)");
            others.entry(about.to_owned()).or_default().push(name);
            continue;
        };
        match rows.last_mut().filter(|row| row.continues(&name, &outcome)) {
            Some(row) => row.add(&name, &outcome),
            None => rows.push(FileRow::new(name, outcome)),
        }
    }
    document.push('\n');
    document.push_str(text);
    document
        .push_str("\n| file | format | points | attributes | bounds | unit, system | sensors | notes | rendered |\n");
    document.push_str("|---|---|---|---|---|---|---|---|---|\n");
    rows.iter().for_each(|row| document.push_str(&row.to_markdown()));
    let points: usize = rows.iter().map(FileRow::files).sum();
    let read: usize = rows.iter().filter(|row| row.is_read()).map(FileRow::files).sum();
    let rendered: usize = rows.iter().filter(|row| row.is_rendered()).map(FileRow::files).sum();
    let _ = writeln!(document, "\nOf {points} point files, {read} are read and {rendered} are rendered.");
    if !others.is_empty() {
        document.push_str("\nFiles without points:\n\n");
    }
    for (about, names) in others {
        let _ = writeln!(document, "- {about}: {}", names.join(", "));
    }
    Ok(())
}

/// Names of all files below `folder`, relative to `data`, in order.
fn collect(data: &Path, folder: &Path, names: &mut Vec<String>) -> Result<()> {
    for entry in read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.is_dir() {
            collect(data, &path, names)?;
        } else {
            let parts: Vec<_> = path.strip_prefix(data)?.iter().map(|part| part.to_string_lossy()).collect();
            names.push(parts.join("/"));
        }
    }
    names.sort();
    Ok(())
}
