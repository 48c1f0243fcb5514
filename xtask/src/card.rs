//! `cargo xtask card`: where the time of a frame goes on a graphics card. One command for a machine that is lent for
//! minutes; `cargo xtask performance` makes the tables that are kept.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result};
use serde_json::Value;

/// Name and options of each scene, the most telling first.
const SCENES: [(&str, &str); 8] = [
    ("statue", "--scene statue:1M --frames 200"),
    ("paper", "--scene statue:1M --frames 200 -k 10 --points-per-pixel 1 --no-trim"),
    ("cathedral", "--scene cathedral:10M --frames 60"),
    ("noise", "--scene statue:1M --frames 100 --noise 0.005"),
    ("uploads", "--scene cathedral:10M --frames 20 --stream"),
    // The paper's engine in both forms, with as many points as its bunny.
    ("communication", "--scene statue:36K --frames 50 -k 10 --no-trim --engine splat-communication"),
    ("by raster", "--scene statue:36K --frames 50 -k 10 --no-trim --engine splat-communication-raster"),
    ("100M", "--scene cathedral:100M --frames 30"),
];
/// Passes that are listed, the longest.
const LISTED: usize = 8;

/// Measures every scene twice, by stages and by passes, and prints both. What one scene lacks does not end the others.
pub(crate) fn run(program: &Path) {
    for (name, options) in SCENES {
        for each in ["", "--passes"] {
            match bench(program, &format!("{options} {each}")).and_then(|bench| described(&bench)) {
                Ok(lines) => println!("{name} {each}\n{lines}"),
                Err(error) => println!("{name} {each}\n  {error:#}"),
            }
        }
    }
}

fn bench(program: &Path, options: &str) -> Result<Value> {
    let mut command = Command::new(program);
    command.args(["bench", "--backend", "gpu", "--json", "--quiet"]).args(options.split_whitespace());
    let output = command.stdin(Stdio::null()).env("NODEVICE_SELECT", "1").output()?;
    let message = String::from_utf8_lossy(&output.stderr);
    anyhow::ensure!(output.status.success(), "{}", message.trim());
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// The figures of a bench: device and clock, frame and stages, and the longest passes if they are timed.
fn described(bench: &Value) -> Result<String> {
    let run = &bench["runs"][0];
    let ms = |value: &Value| value.as_f64().context("the bench lacks a time");
    let times = &run["timings_ms"];
    let mut lines = vec![format!("  {}", run["device"]["name"].as_str().unwrap_or("?"))];
    if let (Some(now), Some(most)) = (run["clock"]["median_mhz"].as_u64(), run["clock"]["most_mhz"].as_u64()) {
        lines[0] += &format!(", {now} MHz of {most}");
    }
    let [frame, picture, upload] = [&times["frame"], &run["picture_ms"], &times["upload"]].map(ms);
    lines.push(format!("  frame {:.3} picture {:.3} upload {:.3}", frame?, picture?, upload?));
    let stages = ["project", "search", "fit", "adapt", "splat", "shade"];
    let stages = stages.map(|stage| ms(&times[stage]).map(|ms| format!("{stage} {ms:.3}")));
    lines.push(format!("  {}", stages.into_iter().collect::<Result<Vec<_>>>()?.join(" ")));
    if let Some(between) = run["between_passes_ms"].as_f64() {
        let passes = run["passes"].as_array().context("the bench lacks passes")?;
        let each = 1e3 * between / passes.len().max(2).saturating_sub(1) as f64;
        lines.push(format!("  {} passes, {between:.3} between them, {each:.1} µs each", passes.len()));
        lines.push(format!("  {}", longest(passes)?));
    }
    Ok(lines.join("\n"))
}

/// The longest passes, each with its number of runs and their total.
fn longest(passes: &[Value]) -> Result<String> {
    let mut sums: BTreeMap<&str, (usize, f64)> = BTreeMap::new();
    for pass in passes {
        let sum = sums.entry(pass["pass"].as_str().context("a pass without a name")?).or_default();
        *sum = (sum.0 + 1, sum.1 + pass["ms"].as_f64().context("a pass without a time")?);
    }
    let mut sums: Vec<_> = sums.into_iter().collect();
    sums.sort_by(|(_, (_, a)), (_, (_, b))| b.total_cmp(a));
    let told = sums.iter().take(LISTED).map(|(pass, (runs, ms))| format!("{pass} x{runs} {ms:.3}"));
    Ok(told.collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_bench_is_described() {
        let pass = |pass: &str, ms: f64| json!({ "pass": pass, "ms": ms });
        let times = json!({
            "project": 0.25, "search": 0.5, "fit": 0.0, "adapt": 0.0, "splat": 0.0, "shade": 0.125, "frame": 1.0,
            "upload": 0.0,
        });
        let mut bench = json!({ "runs": [{
            "device": { "name": "a card" }, "clock": { "median_mhz": 1965, "most_mhz": 1980 }, "picture_ms": 2.0,
            "timings_ms": times, "between_passes_ms": 0.125,
            "passes": [pass("fit/fit", 0.125), pass("search/search", 0.25), pass("fit/fit", 0.25)],
        }] });
        let lines = "  a card, 1965 MHz of 1980\n  frame 1.000 picture 2.000 upload 0.000\n  \
                     project 0.250 search 0.500 fit 0.000 adapt 0.000 splat 0.000 shade 0.125\n  \
                     3 passes, 0.125 between them, 62.5 µs each\n  fit/fit x2 0.375, search/search x1 0.250";
        assert_eq!(described(&bench).expect("all is there"), lines);
        bench["runs"][0]["timings_ms"]["fit"] = Value::Null;
        assert!(described(&bench).is_err(), "a time is missing");
    }
}
