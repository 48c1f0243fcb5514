//! Pages of measurements, from files of results alone, and the text of `docs/PERFORMANCE.md`.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde_json::Value;

const HEAD: &str = "\
# Performance

Written by `cargo xtask performance`. Changes here are lost.

- `cargo xtask performance --machine NAME` measures the `dist` build and writes `performance/NAME.json` and this page.
- This command measures medians of three runs that take turns. A run of a frame is the median of ten frames after a
  warm-up. A machine's line names what differs for its rows.
- Machines are shared with other work: times vary by a third. Compare results of one machine and commit only.
- Settings: *paper* is `-k 10 --points-per-pixel 1 --no-trim`; *noise* is `--noise 0.005` with the default settings.
- Stages of a GPU are timed by the GPU. *picture* ends when the picture is in main memory.
- [Stages beside their bytes](performance/GPU.md).

## Machines

";

/// A page: its head, and its tables.
pub(crate) struct Page {
    pub(crate) head: &'static str,
    pub(crate) tables: &'static [Table],
}

/// The page of all that this task measures.
pub(super) const PERFORMANCE: Page = Page { head: HEAD, tables: &TABLES };

/// Per table its title, a text, its columns of words and its columns of numbers. The rows are the list of that title in
/// each machine's file, and the columns are keys of a row.
const TABLES: [Table; 5] = [
    ["Frames", "In milliseconds.", "scene size settings on", "project search fit adapt splat shade frame picture"],
    ["Normals", "Seconds of `autosplats normals`. It reads a PLY file and writes one.", "cloud k", "s"],
    ["Reading", "Files of `scene:statue:2M` with colours, in the page cache.", "format", "ms Mpoints/s"],
    ["Memory", "Of `autosplats render` at 1760x900, from a PLY file. Its mapped pages count.", "cloud", "peak-MB"],
    [
        "Other programs",
        "*times* is their time over ours. kiddo: `cargo bench -p autosplats --bench kd_tree`, ten neighbours of \
         visible points, medians of ratios. Normals: `--bench normals`, Open3D and pymeshlab by hand. Readers: `cargo \
         bench -p autosplats-formats --bench peers`, 2 million points, best of three. The paper's engines beside the \
         screen grid, on the GPU: `autosplats bench paper`.",
        "task program",
        "ms ours times",
    ],
];

/// Title, text, columns of words and columns of numbers.
pub(crate) type Table = [&'static str; 4];

/// The columns of words of a table.
pub(super) fn words(title: &str) -> impl Iterator<Item = &'static str> {
    TABLES.into_iter().filter(move |table| table[0] == title).flat_map(|table| table[2].split(' '))
}

/// The whole page, from each machine's name and file.
pub(crate) fn page(Page { head, tables }: &Page, machines: &BTreeMap<String, Value>) -> String {
    let mut page = (*head).to_owned();
    for (name, file) in machines {
        let [machine, commit, date] = ["machine", "commit", "date"].map(|key| cell(&file[key]));
        let _ = writeln!(page, "- **{name}**: {machine}. Commit {commit}, {date}.");
    }
    for [title, about, words, numbers] in *tables {
        // A table without rows is left out.
        if machines.values().all(|file| file[*title].as_array().is_none_or(Vec::is_empty)) {
            continue;
        }
        let row = |first: &str, cell: &dyn Fn(&str) -> String| {
            let cells: Vec<_> = words.split(' ').chain(numbers.split(' ')).map(cell).collect();
            format!("| {first} | {} |\n", cells.join(" | "))
        };
        let rule = words.split(' ').map(|_| "---|").chain(numbers.split(' ').map(|_| "--:|")).collect::<String>();
        let _ = write!(page, "\n## {title}\n\n{about}\n\n{}|---|{rule}\n", row("machine", &str::to_owned));
        for (name, file) in machines {
            for values in file[*title].as_array().into_iter().flatten() {
                page += &row(name, &|key| cell(&values[key]));
            }
        }
    }
    page
}

/// A word as it is, a number with three digits, and a dash for what is missing or takes no time.
fn cell(value: &Value) -> String {
    match (value.as_str(), value.as_f64()) {
        (Some(word), _) => word.to_owned(),
        (None, Some(number)) if number > 0.0 => {
            let decimals = (2 - number.log10().floor() as i32).clamp(0, 2) as usize;
            format!("{number:.decimals$}")
        }
        _ => "–".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_made_of_a_file() {
        let rows =
            serde_json::json!([{"format": "ply", "ms": 7.058, "Mpoints/s": 12.84}, {"format": "laz", "ms": 73369.2}]);
        let file = serde_json::json!({"machine": "a CPU", "commit": "abc", "date": "2026-01-02", "Reading": rows});
        let page = page(&PERFORMANCE, &BTreeMap::from([("one".to_owned(), file)]));
        let table = "| machine | format | ms | Mpoints/s |\n|---|---|--:|--:|\n\
                     | one | ply | 7.06 | 12.8 |\n| one | laz | 73369 | – |\n";
        assert!(page.ends_with(table) && page.matches("\n## ").count() == 2, "no table without rows: {page}");
        assert!(page.contains("\n- **one**: a CPU. Commit abc, 2026-01-02.\n"), "{page}");
    }
}
