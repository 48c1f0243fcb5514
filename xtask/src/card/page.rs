//! The text of `docs/performance/GPU.md`, from files of results alone.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result};
use serde_json::Value;

use crate::performance::machines;
use crate::performance::page::{Page, page};

/// One JSON file per device, and one of predictions.
pub(super) const FOLDER: &str = "docs/performance/gpu";
const PAGE: &str = "docs/performance/GPU.md";
/// The last times of a card that were taken stage by stage.
const BEFORE: &str = "docs/performance/h200.json";
/// Columns of bandwidths, in bytes a millisecond.
const BANDWIDTHS: [(&str, f64); 3] = [("4300-GB/s", 4300e6), ("360-GB/s", 360e6), ("60-GB/s", 60e6)];

const TEXT: Page = Page {
    head: "\
# Stages of a frame on a GPU

Written by `cargo xtask card`. Changes here are lost.

- With a graphics card this command measures. Without one, software Vulkan counts dispatches and bytes, and predictions
  stand in place of times.
- *dispatches* are those of a frame. Software has ten more in *adapt*, as a card merges levels of cells
  and sizes of balls, and two less in *search*.
- *chain* is how much longer a stage makes the longest chain of dispatches that wait for each other.
- *MB* are the buffers that dispatches bind, twice where a pass may write. This is a bound by allocation, not traffic:
  buffers sized for the whole screen count whole, whatever a frame touches of them.
- *4300-GB/s* and others are milliseconds that these bytes take at that bandwidth. An H200 was measured to have 4300, an
  RTX 3060 has 360 by its data sheet, 60 is assumed for two channels of DDR4 or DDR5. Passes that touch less are faster.
- *measured* are milliseconds of the device of the row. *56e866a* are those of an H200 at that commit, before one compute
  pass a frame and many lanes (decisions 0052 and 0058).

## Devices

",
    tables: &[
        [
            "Stages",
            "At 1760x900. Settings are those of [performance](../PERFORMANCE.md).",
            "scene settings stage",
            "dispatches chain MB 4300-GB/s 360-GB/s 60-GB/s measured 56e866a",
        ],
        [
            "Predicted, not measured",
            "Milliseconds on an H200. *56e866a* was measured. *step-1* is one compute pass, fewer dispatches and parallel \
             uploads, 15 % more or less. *step-2* is long work by many lanes, 30 % more or less.",
            "scene settings stage",
            "56e866a step-1 step-2",
        ],
    ],
};

/// Writes the page from the files that are there.
pub(super) fn write(root: &Path) -> Result<()> {
    std::fs::write(root.join(PAGE), text(root)?).context(PAGE)
}

fn text(root: &Path) -> Result<String> {
    let before = std::fs::read_to_string(root.join(BEFORE)).context(BEFORE)?;
    let before = serde_json::from_str(&before).context(BEFORE)?;
    Ok(page(&TEXT, &completed(machines(&root.join(FOLDER))?, &before)))
}

/// The files with what follows from their rows. Predictions go once a card was measured.
fn completed(mut files: BTreeMap<String, Value>, before: &Value) -> BTreeMap<String, Value> {
    let is_measured = |file: &Value| rows(file, "Stages").any(|row| row["measured"].is_number());
    if files.values().any(is_measured) {
        files.retain(|_, file| rows(file, "Predicted, not measured").next().is_none());
    }
    for row in files.values_mut().flat_map(|file| file["Stages"].as_array_mut().into_iter().flatten()) {
        let bytes = row["bytes"].as_f64().unwrap_or_default();
        row["MB"] = (bytes / 1e6).into();
        for (name, bandwidth) in BANDWIDTHS {
            row[name] = (bytes / bandwidth).into();
        }
        let same = |other: &&Value| ["scene", "size", "settings"].iter().all(|&key| other[key] == row[key]);
        let ms = rows(before, "Frames")
            .find(same)
            .map_or(Value::Null, |other| other[row["stage"].as_str().unwrap_or_default()].clone());
        row["56e866a"] = ms;
        // Words stand as they are, without decimals.
        for key in ["dispatches", "chain"] {
            row[key] = row[key].to_string().into();
        }
    }
    files
}

fn rows<'a>(file: &'a Value, title: &str) -> impl Iterator<Item = &'a Value> {
    file[title].as_array().into_iter().flatten()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_page_is_what_the_files_give() {
        let root = crate::root().expect("the repository");
        let there = std::fs::read_to_string(root.join(PAGE)).expect("the page");
        assert!(there == text(root).expect("files"), "{PAGE} is not up to date: cargo xtask card --page writes it");
    }

    #[test]
    fn bytes_become_times_and_predictions_end_with_a_measurement() {
        let row = json!({ "scene": "s", "size": "1x1", "settings": "paper", "stage": "fit", "dispatches": 7, "chain": 5,
                          "bytes": 43_000_000 });
        let before = json!({ "Frames": [{ "scene": "s", "size": "1x1", "settings": "paper", "fit": 0.5 }] });
        let counted = json!({ "Stages": [row] });
        let predicted = json!({ "Predicted, not measured": [{ "scene": "s", "stage": "fit", "step-1": 0.25 }] });
        let mut files = BTreeMap::from([("a".to_owned(), counted), ("b".to_owned(), predicted)]);
        let made = page(&TEXT, &completed(files.clone(), &before));
        assert!(made.contains("| a | s | paper | fit | 7 | 5 | 43.0 | 0.01 | 0.12 | 0.72 | – | 0.50 |"), "{made}");
        assert!(made.contains("| b | s | – | fit | – | 0.25 | – |"), "{made}");
        files.get_mut("a").expect("one")["Stages"][0]["measured"] = 0.125.into();
        let made = page(&TEXT, &completed(files, &before));
        assert!(made.contains("0.72 | 0.12 | 0.50 |") && !made.contains("## Predicted"), "{made}");
    }
}
