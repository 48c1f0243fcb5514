//! The rule between the renderer's stages: a stage may import what comes before it in the frame, never what comes after.

use std::fs::{read_dir, read_to_string};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};

/// The stages in the order of a frame; the renderer uses them all. Normals of whole clouds are no stage, but stand on the
/// search and the fit.
const ORDER: [&str; 8] = ["project", "search", "fit", "normals", "adapt", "splat", "shade", "renderer"];

/// Checks every Rust file below `source`, the renderer's `src` folder.
pub(crate) fn check(source: &Path) -> Result<()> {
    let mut files = Vec::new();
    collect(source, &mut files)?;
    ensure!(!files.is_empty(), "there is no Rust file in {}", source.display());
    let mut wrong = Vec::new();
    for path in &files {
        let room = path.strip_prefix(source)?.components().next().context("a file has a name")?;
        let room = room.as_os_str().to_string_lossy().trim_end_matches(".rs").to_owned();
        if room == "lib" {
            continue;
        }
        let text = read_to_string(path).with_context(|| path.display().to_string())?;
        wrong.extend(forbidden(&room, &text).map(|import| format!("{} imports {import}", path.display())));
    }
    ensure!(wrong.is_empty(), "against the order {}:\n  {}", ORDER.join(" < "), wrong.join("\n  "));
    println!("{} files", files.len());
    Ok(())
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    for entry in read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files.sort();
    Ok(())
}

/// The stages that a file of `room` names although they come after it. What is no stage comes before all.
fn forbidden(room: &str, text: &str) -> impl Iterator<Item = String> {
    let rank = |name: &str| ORDER.iter().position(|stage| *stage == name);
    let own = rank(room);
    imported(text).into_iter().filter(move |name| rank(name).is_some_and(|stage| own.is_none_or(|own| stage > own)))
}

/// The modules named right after each `crate::`, in comments not.
fn imported(text: &str) -> Vec<String> {
    let code: String =
        text.lines().filter(|line| !line.trim_start().starts_with("//")).map(|line| format!("{line}\n")).collect();
    let word = |text: &str| text.chars().take_while(|&c| c.is_alphanumeric() || c == '_').collect::<String>();
    let mut names = Vec::new();
    for (at, prefix) in code.match_indices("crate::") {
        let path = &code[at + prefix.len()..];
        let Some(group) = path.strip_prefix('{') else {
            names.push(word(path));
            continue;
        };
        // The first words between the commas of the outermost braces.
        let mut depth = 0;
        let mut start = 0;
        for (position, character) in group.char_indices() {
            match character {
                '{' => depth += 1,
                '}' if depth > 0 => depth -= 1,
                ',' | '}' if depth == 0 => {
                    names.push(word(group[start..position].trim_start()));
                    start = position + 1;
                    if character == '}' {
                        break;
                    }
                }
                _ => {}
            }
        }
    }
    names.retain(|name| !name.is_empty());
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_every_form_of_import() {
        let text = "use crate::Error;\nuse crate::fit::{Surfels, Axes};\nuse crate::{\n    splat::{GBuffer, cpu::{A, B}},\n    \
                    project,\n};\n// use crate::shade\nlet x = crate::search::f();\n";
        assert_eq!(imported(text), ["Error", "fit", "splat", "project", "search"], "and none in comments");
    }

    #[test]
    fn later_stages_are_forbidden() {
        let text = "use crate::project::A;\nuse crate::splat::B;";
        let wrong = |room| forbidden(room, text).collect::<Vec<_>>();
        assert_eq!(wrong("fit"), ["splat"], "fit comes before splat");
        assert_eq!(wrong("normals"), ["splat"], "normals need no picture");
        assert_eq!(wrong("shade"), Vec::<String>::new(), "shade comes after both");
        assert_eq!(wrong("camera"), ["project", "splat"], "what is no stage uses none");
    }
}
