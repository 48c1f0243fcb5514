//! `cargo xtask card`: where the time of a frame goes on a graphics card. One command for a machine that is lent for
//! minutes: it prints what it finds, and writes `docs/performance/GPU.md` with the dispatches, bytes and times of each
//! stage. Without a card, software Vulkan counts the dispatches and bytes.

mod page;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail, ensure};
use serde_json::{Value, json};

use crate::build_command;
use crate::performance::{answer, write_results};

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
/// The scenes of the page, with the words of their rows. A device without a card counts those that it can render soon.
const KEPT: [(&str, [&str; 2]); 4] = [
    ("statue", ["statue:1M", "default"]),
    ("paper", ["statue:1M", "paper"]),
    ("cathedral", ["cathedral:10M", "default"]),
    ("100M", ["cathedral:100M", "default"]),
];
const COUNTED: [&str; 3] = ["statue", "paper", "cathedral"];
const OPTIONS: [&str; 2] = ["--program", "--commit"];
/// Stages in the order of the tables; the last is their sum.
const STAGES: [&str; 7] = ["project", "search", "fit", "adapt", "splat", "shade", "frame"];
/// Passes that are listed, the longest.
const LISTED: usize = 8;

/// Measures, unless the word is `--page`, and writes the page.
pub(crate) fn run(root: &Path, words: &[&str]) -> Result<()> {
    if words != ["--page"] {
        let options: BTreeMap<_, _> = words.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
        let is_known = options.len() * 2 == words.len() && options.keys().all(|name| OPTIONS.contains(name));
        ensure!(is_known, "card takes --page, or {} with a value each", OPTIONS.join(", "));
        let described = || answer(Command::new("git").current_dir(root).args(["describe", "--always", "--dirty"]));
        let commit = options.get("--commit").map_or_else(described, |commit| Ok((*commit).to_owned()))?;
        let find = |path: &&str| Path::new(path).canonicalize().with_context(|| (*path).to_owned());
        let program = options.get("--program").map_or_else(|| build_command(root, "dist"), find)?;
        let doctor: Value = serde_json::from_str(&answer(Command::new(&program).args(["doctor", "--json"]))?)?;
        let is_card = doctor["adapters"].as_array().into_iter().flatten().any(|adapter| adapter["software"] == false);
        let benches = if is_card { measure(&program) } else { count(&program) };
        let (name, mut results) = results(&benches, is_card)?;
        results["commit"] = commit.into();
        results["date"] = answer(Command::new("date").args(["-u", "+%F"]))?.into();
        write_results(&root.join(page::FOLDER).join(format!("{name}.json")), &results)?;
    }
    page::write(root)
}

/// Measures every scene twice, by stages and by passes, prints both, and returns the first of those that are kept.
/// What one scene lacks does not end the others.
fn measure(program: &Path) -> Vec<(&'static str, Value)> {
    let mut kept = Vec::new();
    for (name, options) in SCENES {
        for each in ["", "--passes"] {
            let measured = bench(program, &format!("{options} {each}"));
            match measured.and_then(|bench| Ok((described(&bench)?, bench))) {
                Ok((lines, bench)) => {
                    println!("{name} {each}\n{lines}");
                    kept.extend(each.is_empty().then_some((name, bench)));
                }
                Err(error) => println!("{name} {each}\n  {error:#}"),
            }
        }
    }
    kept
}

/// Renders the scenes that a device without a card can. Their times say nothing of a card.
fn count(program: &Path) -> Vec<(&'static str, Value)> {
    let mut counted = Vec::new();
    for (name, options) in SCENES.into_iter().filter(|(name, _)| COUNTED.contains(name)) {
        match bench(program, &options.replace("--frames 200", "--frames 1").replace("--frames 60", "--frames 1")) {
            Ok(bench) => counted.push((name, bench)),
            Err(error) => println!("{name}\n  {error:#}"),
        }
    }
    counted
}

/// The file of a device: its name, and its rows of stages, with times if it is a card.
fn results(benches: &[(&str, Value)], is_card: bool) -> Result<(String, Value)> {
    let mut rows = Vec::new();
    for (name, bench) in benches {
        let Some((_, [scene, settings])) = KEPT.into_iter().find(|(kept, _)| kept == name) else { continue };
        let run = &bench["runs"][0];
        let work = run["work"].as_array().context("the bench lacks its work")?;
        for stage in STAGES {
            let of_stage: Vec<_> = work.iter().filter(|work| stage == "frame" || work["stage"] == stage).collect();
            if of_stage.is_empty() {
                continue;
            }
            let sum = |key: &str| of_stage.iter().filter_map(|work| work[key].as_u64()).sum::<u64>();
            let [dispatches, chain, bytes] = ["dispatches", "chain", "bytes"].map(sum);
            let size = format!("{}x{}", bench["size"][0], bench["size"][1]);
            let mut row = json!({ "scene": scene, "size": size, "settings": settings, "stage": stage });
            row["dispatches"] = dispatches.into();
            row["chain"] = chain.into();
            row["bytes"] = bytes.into();
            if is_card {
                row["measured"] = run["timings_ms"][stage].clone();
            }
            rows.push(row);
        }
    }
    let Some((_, first)) = benches.first() else { bail!("no scene was rendered") };
    let run = &first["runs"][0];
    let text = |value: &Value| value.as_str().unwrap_or("?").to_owned();
    let device = text(&run["device"]["name"]);
    let adapter = &run["device"]["adapter"];
    let mut machine = format!("{device}, {}, driver {}", text(&adapter["backend"]), text(&adapter["driver"]));
    if let (Some(now), Some(most)) = (run["clock"]["median_mhz"].as_u64(), run["clock"]["most_mhz"].as_u64()) {
        machine += &format!(", SM clock {now} MHz of {most}");
    }
    if !is_card {
        machine += "; software, so counted and not measured";
    }
    Ok((file_name(&device), json!({ "machine": machine, "Stages": rows })))
}

/// The words of a device's name before any bracket, joined by dashes.
fn file_name(device: &str) -> String {
    let words = device.split('(').next().unwrap_or_default().to_lowercase();
    let words: Vec<_> =
        words.split(|letter: char| !letter.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect();
    if words.is_empty() { "card".to_owned() } else { words.join("-") }
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

    #[test]
    fn the_stages_of_a_bench_are_rows() {
        let work =
            |stage: &str, dispatches: u64| json!({ "stage": stage, "dispatches": dispatches, "chain": 2, "bytes": 8 });
        let bench = json!({ "size": [1760, 900], "runs": [{
            "device": { "name": "A Card (TM)", "adapter": { "backend": "Vulkan", "driver": "1" } },
            "clock": { "median_mhz": 1965, "most_mhz": 1980 }, "timings_ms": { "fit": 0.25, "frame": 1.0 },
            "work": [work("fit", 3), work("splat", 4)],
        }] });
        let (name, file) = results(&[("paper", bench.clone())], true).expect("rows");
        assert_eq!(
            (name.as_str(), &file["machine"]),
            ("a-card", &json!("A Card (TM), Vulkan, driver 1, SM clock 1965 MHz of 1980"))
        );
        let words = json!({ "scene": "statue:1M", "size": "1760x900", "settings": "paper" });
        let row = |stage: &str, [dispatches, chain, bytes]: [u64; 3]| {
            let mut row = words.clone();
            (row["stage"], row["dispatches"], row["chain"], row["bytes"]) =
                (stage.into(), dispatches.into(), chain.into(), bytes.into());
            row
        };
        let counted = [row("fit", [3, 2, 8]), row("splat", [4, 2, 8]), row("frame", [7, 4, 16])];
        let (_, software) = results(&[("paper", bench.clone()), ("noise", bench)], false).expect("rows");
        assert_eq!(software["Stages"], json!(counted), "no times of software, no scene that is only printed");
        assert_eq!(file["Stages"][2]["measured"], 1.0);
        assert!(results(&[], true).is_err());
    }
}
