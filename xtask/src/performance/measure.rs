//! The measurements. All jobs take turns, so that a busy minute of a shared machine does not hit one job alone.

use std::collections::BTreeMap;
use std::fs::read_to_string;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};
use serde_json::{Value, json};

use super::{answer, page};

/// Runs of each job. Results are their medians.
const ROUNDS: usize = 3;

/// A job makes a row: the title of its table, and the row's words. Those that end in "gpu" need a hardware GPU.
const JOBS: &str = "\
Frames statue:100K 960x540 default cpu, Frames statue:1M 1760x900 default cpu, Frames statue:1M 1760x900 noise cpu, \
Frames statue:1M 1760x900 paper cpu, Frames statue:1M 3840x2160 default cpu, \
Frames cathedral:3M 1760x900 default cpu, Frames cathedral:3M 1760x900 paper cpu, \
Frames cathedral:10M 1760x900 default cpu, \
Frames statue:1M 1760x900 default gpu, Frames statue:1M 1760x900 noise gpu, Frames statue:1M 1760x900 paper gpu, \
Frames statue:1M 3840x2160 default gpu, Frames cathedral:3M 1760x900 default gpu, \
Frames cathedral:10M 1760x900 default gpu, Frames cathedral:100M 1760x900 default gpu, \
Normals statue:1M 10, Normals statue:1M 40, Normals cathedral:10M 10, Reading ply, Reading pcd, Reading las, \
Reading laz, Reading e57, Reading xyz, Memory statue:1M, Memory cathedral:10M";

/// Numbers of a row, by the names of their columns.
type Numbers = BTreeMap<&'static str, f64>;

/// Measures the jobs whose text contains `only`. Returns a description of the machine and a list of rows per table.
pub(super) fn all(program: &Path, only: &str) -> Result<Value> {
    let folder = tempfile::tempdir()?;
    let program = Program { path: program, folder: folder.path() };
    let doctor = program.json(&["doctor", "--json"])?;
    let gpu = doctor["adapters"].as_array().into_iter().flatten().find(|adapter| adapter["software"] == false);
    let jobs = JOBS.split(", ").filter(|job| job.contains(only) && (gpu.is_some() || !job.ends_with("gpu")));
    let mut jobs: Vec<_> = jobs.map(|job| (job, Vec::new())).collect();
    ensure!(!jobs.is_empty(), "no job of this machine contains '{only}'");
    for round in 1..=ROUNDS {
        for (job, samples) in &mut jobs {
            println!("round {round} of {ROUNDS}: {job}");
            samples.push(program.measure(job).with_context(|| job.to_string())?);
        }
    }
    let mut tables: BTreeMap<&str, Vec<BTreeMap<&str, Value>>> = BTreeMap::new();
    for (job, samples) in &jobs {
        let (title, words) = job.split_once(' ').context("a job is a title and words")?;
        let mut row: BTreeMap<_, _> = page::words(title).zip(words.split(' ').map(Value::from)).collect();
        for key in samples[0].keys() {
            row.insert(key, median(samples.iter().filter_map(|numbers| numbers.get(key).copied())).into());
        }
        tables.entry(title).or_default().push(row);
    }
    let text = |value: &Value| value.as_str().unwrap_or("?").to_owned();
    let gpu = gpu.map(|gpu| format!("; {}, {}", text(&gpu["name"]), text(&gpu["driver"]))).unwrap_or_default();
    let [name, threads, simd] = ["name", "threads", "simd_used"].map(|key| &doctor["cpu"][key]);
    let mut results = json!(tables);
    results["machine"] = format!("{}, {threads} threads, {}{gpu}", text(name), text(simd)).into();
    Ok(results)
}

/// The command, and the folder for its files.
struct Program<'a> {
    path: &'a Path,
    folder: &'a Path,
}

impl Program<'_> {
    /// The numbers of a job, measured once.
    fn measure(&self, job: &str) -> Result<Numbers> {
        let render = |file, size| {
            ["render", file, "-o", "picture.png", "--size", size, "--supersample", "1", "--backend", "cpu", "--json"]
        };
        let number = |value: &Value| value.as_f64().context("the program's JSON lacks a number");
        match job.split(' ').collect::<Vec<_>>()[..] {
            ["Frames", scene, size, settings, on] => {
                let options: &[&str] = match settings {
                    "paper" => &["-k", "10", "--points-per-pixel", "1", "--no-trim"],
                    "noise" => &["--noise", "0.005"],
                    _ => &[],
                };
                let bench = ["bench", "--json", "--frames", "10", "--scene", scene, "--size", size, "--backend", on];
                let run = &self.json(&[&bench, options].concat())?["runs"][0];
                let stages = ["project", "search", "fit", "adapt", "splat", "shade", "frame"];
                let times = stages.map(|stage| (stage, &run["timings_ms"][stage]));
                let times = times.into_iter().chain([("picture", &run["picture_ms"])]);
                times.map(|(key, ms)| Ok((key, number(ms)?))).collect()
            }
            ["Normals", cloud, k] => {
                let file = self.file(cloud, "ply")?;
                let start = Instant::now();
                answer(&mut self.command(&["normals", &file, "normals.ply", "-k", k, "--force"]))?;
                Ok([("s", start.elapsed().as_secs_f64())].into())
            }
            ["Reading", extension] => {
                let found = self.json(&render(&self.file("statue:2M", extension)?, "64x64"))?;
                let ms = number(&found["timings_ms"]["read"])?;
                Ok([("ms", ms), ("Mpoints/s", number(&found["counts"]["points"])? / ms / 1e3)].into())
            }
            ["Memory", cloud] => {
                let mut command = self.command(&render(&self.file(cloud, "ply")?, "1760x900"));
                let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
                let status_file = format!("/proc/{}/status", child.id());
                let mut numbers = Numbers::new();
                // The kernel keeps the peak itself, so only a peak in the last milliseconds is missed.
                while child.try_wait()?.is_none() {
                    let peak_mb = read_to_string(&status_file).ok().and_then(|text| peak_mb(&text));
                    numbers.extend(peak_mb.map(|peak_mb| ("peak-MB", peak_mb)));
                    sleep(Duration::from_millis(2));
                }
                ensure!(child.wait()?.success(), "render fails");
                Ok(numbers)
            }
            _ => bail!("no such job"),
        }
    }

    /// The name of a file with the points of a scene. Writes it once.
    fn file(&self, cloud: &str, extension: &str) -> Result<String> {
        let name = format!("{}.{extension}", cloud.replace(':', "-"));
        if !self.folder.join(&name).exists() {
            answer(&mut self.command(&["convert", &format!("scene:{cloud}"), &name]))?;
        }
        Ok(name)
    }

    fn json(&self, words: &[&str]) -> Result<Value> {
        Ok(serde_json::from_str(&answer(&mut self.command(words))?)?)
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(self.path);
        command.current_dir(self.folder).args(words).stdin(Stdio::null()).env("NODEVICE_SELECT", "1");
        command
    }
}

/// Peak resident memory in megabytes, from the status of a process. Only Linux has such a file.
fn peak_mb(status: &str) -> Option<f64> {
    let kibibytes = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB"))?;
    Some(kibibytes.parse::<f64>().ok()? * 1024.0 / 1e6)
}

/// The middle value, to three decimals.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<_> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    (values[values.len() / 2] * 1e3).round() / 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peaks_and_medians_are_found() {
        let status = "Name:\tautosplats\nVmPeak:\t  900 kB\nVmHWM:\t  390625 kB\nVmRSS:\t  12 kB\n";
        assert_eq!(peak_mb(status), Some(400.0), "resident memory, not address space");
        assert_eq!(median([9.0, 1.0, 3.0004].into_iter()), 3.0, "neither the first nor the mean");
    }
}
