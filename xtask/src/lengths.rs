//! The rules of length: files that can be read at once, lines of comment that fit a screen, documents that stay small.

use std::fs::read_to_string;
use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result, ensure};

/// Lines of a Rust or WGSL file.
const FILE_LINES: usize = 500;
/// Columns of a line of comment; `rustfmt` holds code to the same.
const COMMENT_COLUMNS: usize = 120;
/// Bytes of each document.
const DOCUMENT_BYTES: [(&str, usize); 7] = [
    ("ARCHITECTURE.md", 12_000),
    ("README.md", 10_000),
    ("CHANGELOG.md", 4_000),
    ("CONTRIBUTING.md", 3_000),
    ("docs/PERFORMANCE.md", 8_000),
    ("docs/performance/GPU.md", 8_000),
    ("docs/QUALITY.md", 8_000),
];

/// Checks every file that git knows, or would add.
pub(crate) fn check(root: &Path) -> Result<()> {
    let mut git = Command::new("git");
    git.current_dir(root).args(["ls-files", "--cached", "--others", "--exclude-standard"]);
    let output = git.output().context("git lists the files")?;
    ensure!(output.status.success(), "git ls-files: {}", output.status);
    let listed = String::from_utf8(output.stdout)?;
    let mut wrong = Vec::new();
    let mut files = 0;
    for name in listed.lines().filter(|name| name.ends_with(".rs") || name.ends_with(".wgsl")) {
        // Deleted, and not yet said to git.
        let Ok(text) = read_to_string(root.join(name)) else { continue };
        files += 1;
        wrong.extend(too_long(name, &text));
    }
    ensure!(files > 0, "git lists no source in {}", root.display());
    for (name, most) in DOCUMENT_BYTES {
        let length = read_to_string(root.join(name)).with_context(|| name.to_owned())?.len();
        if length > most {
            wrong.push(format!("{name}: {length} bytes, {most} allowed"));
        }
    }
    ensure!(wrong.is_empty(), "too long:\n  {}", wrong.join("\n  "));
    println!("{files} files");
    Ok(())
}

/// What is too long in a file.
fn too_long(name: &str, text: &str) -> Vec<String> {
    let lines = text.lines().count();
    let comments = text.lines().enumerate().filter(|(_, line)| {
        line.trim_start().starts_with("//")
            && line.chars().count() > COMMENT_COLUMNS
            && line.split_whitespace().count() > 2
    });
    let mut wrong: Vec<_> = comments
        .map(|(at, line)| format!("{name}:{}: {} columns, {COMMENT_COLUMNS} allowed", at + 1, line.chars().count()))
        .collect();
    if lines > FILE_LINES {
        wrong.push(format!("{name}: {lines} lines, {FILE_LINES} allowed"));
    }
    wrong
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_files_and_long_comments_are_found() {
        let words = "word ".repeat(30);
        assert_eq!(too_long("a.rs", &format!("code\n    // {words}\n")).len(), 1, "a long comment");
        assert_eq!(too_long("a.rs", &format!("code(\"{words}\")\n")).len(), 0, "code is left to rustfmt");
        assert_eq!(too_long("a.rs", &format!("// {}\n", "u".repeat(150))).len(), 0, "an address cannot be wrapped");
        assert_eq!(too_long("a.rs", &"line\n".repeat(501)).len(), 1, "a long file");
        assert_eq!(too_long("a.rs", &"line\n".repeat(500)).len(), 0, "as long as allowed");
    }
}
