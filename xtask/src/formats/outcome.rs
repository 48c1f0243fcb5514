//! Result of one file, or of several equal ones in sequence.

use std::fmt::Write as _;
use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};
use serde_json::Value;

/// Time limit of a command.
const COMMAND_TIMEOUT: Duration = Duration::from_secs(120);

/// Results of `info` and `render` for a file.
pub(super) struct FileOutcome {
    report: Value,
    /// Why there is no report, or no picture.
    error: Option<String>,
    rendered: bool,
}

impl FileOutcome {
    /// Examines and renders a file of `data`.
    pub(super) fn of(program: &Path, data: &Path, name: &str, picture: &Path) -> Result<Self> {
        let info = run(program, data, &["info", "--scan", "--json", "--quiet", name])?;
        let report: Value =
            info.as_ref().map_or(Value::Null, |info| serde_json::from_str(&info.stdout).unwrap_or_default());
        let error = match &info {
            None => Some(format!("no answer within {} s", COMMAND_TIMEOUT.as_secs())),
            Some(info) if info.code.is_none() => Some("the program crashed".into()),
            Some(_) => report["error"].as_str().map(str::to_owned),
        };
        let picture = picture.display().to_string();
        let render = run(program, data, &["render", name, "-o", &picture, "--size", "160x120", "--quiet"])?;
        let rendered = render.as_ref().is_some_and(|render| render.code == Some(0));
        let said = render.map_or_else(
            || format!("no picture within {} s", COMMAND_TIMEOUT.as_secs()),
            |render| render.stderr.lines().last().unwrap_or_default().trim_start_matches("error: ").to_owned(),
        );
        let error = error.or_else(|| (!rendered).then(|| format!("not rendered: {said}")));
        let error = error.map(|error| error.replace(&format!("{name}: "), ""));
        Ok(Self { report, error, rendered })
    }

    /// Whether no reader accepts the file.
    pub(super) fn is_unknown(&self) -> bool {
        self.error.as_ref().is_some_and(|error| error.contains("unknown format"))
    }

    /// Values that files of one row share: all except numbers of points, bounds and digits in notes.
    fn kind(&self) -> [String; 5] {
        let without_digits = |text: String| text.chars().filter(|c| !c.is_ascii_digit()).collect();
        [self.format(), self.attributes(), self.system(), without_digits(self.notes()), self.rendered.to_string()]
    }

    fn format(&self) -> String {
        self.report["format"].as_str().unwrap_or_default().into()
    }

    fn points(&self) -> Option<u64> {
        self.report["points"].as_u64()
    }

    fn attributes(&self) -> String {
        let list = self.report["attributes"].as_array().into_iter().flatten();
        list.filter_map(|attribute| attribute["name"].as_str()).collect::<Vec<_>>().join(" ")
    }

    /// Smallest and largest coordinates.
    fn bounds(&self) -> Option<[[f64; 3]; 2]> {
        let end = |which: &str| {
            let values = self.report["bounds"][which].as_array()?;
            Some([values.first()?.as_f64()?, values.get(1)?.as_f64()?, values.get(2)?.as_f64()?])
        };
        Some([end("min")?, end("max")?])
    }

    fn system(&self) -> String {
        let crs = &self.report["crs"];
        let mut parts: Vec<String> =
            ["unit", "name"].iter().filter_map(|part| crs[part].as_str()).map(Into::into).collect();
        parts.extend(crs["epsg"].as_u64().map(|code| format!("EPSG:{code}")));
        parts.join(", ")
    }

    fn sensors(&self) -> usize {
        self.report["scans"].as_array().map_or(0, Vec::len)
    }

    fn notes(&self) -> String {
        let warnings = self.report["warnings"].as_array().into_iter().flatten().filter_map(Value::as_str);
        let error = match &self.error {
            Some(error) if self.is_unknown() => Some(error.split(';').next().unwrap_or_default()),
            error => error.as_deref(),
        };
        warnings.chain(error).collect::<Vec<_>>().join("; ")
    }
}

/// A row of the table: one file, or several equal ones.
pub(super) struct FileRow {
    first: String,
    last: String,
    files: usize,
    outcome: FileOutcome,
    points: Option<[u64; 2]>,
    bounds: Option<[[f64; 3]; 2]>,
}

impl FileRow {
    pub(super) fn new(name: String, outcome: FileOutcome) -> Self {
        let points = outcome.points().map(|points| [points; 2]);
        Self { last: name.clone(), first: name, files: 1, points, bounds: outcome.bounds(), outcome }
    }

    /// Whether a file continues the sequence of this row.
    pub(super) fn continues(&self, name: &str, outcome: &FileOutcome) -> bool {
        let pattern = |name: &str| name.replace(|c: char| c.is_ascii_digit(), "0");
        // Digits number the frames, so names are compared with every digit replaced by 0.
        pattern(name) == pattern(&self.first) && outcome.kind() == self.outcome.kind()
    }

    pub(super) fn add(&mut self, name: &str, outcome: &FileOutcome) {
        self.last = name.into();
        self.files += 1;
        if let (Some(points), Some(all)) = (outcome.points(), &mut self.points) {
            *all = [all[0].min(points), all[1].max(points)];
        }
        if let (Some(more), Some(all)) = (outcome.bounds(), &mut self.bounds) {
            for axis in 0..3 {
                all[0][axis] = all[0][axis].min(more[0][axis]);
                all[1][axis] = all[1][axis].max(more[1][axis]);
            }
        }
    }

    pub(super) fn files(&self) -> usize {
        self.files
    }

    pub(super) fn is_read(&self) -> bool {
        self.outcome.report["scanned"] == true && self.outcome.report["error"].is_null()
    }

    pub(super) fn is_rendered(&self) -> bool {
        self.outcome.rendered
    }

    pub(super) fn to_markdown(&self) -> String {
        let name = match self.files {
            1 => self.first.clone(),
            files => format!("{} .. {} ({files} files)", self.first, self.last.rsplit('/').next().unwrap_or_default()),
        };
        let points = match self.points {
            None => String::new(),
            Some([least, most]) if least == most => least.to_string(),
            Some([least, most]) => format!("{least} to {most}"),
        };
        let bounds = self.bounds.map_or_else(String::new, |bounds| {
            let [low, high] = bounds.map(|end| end.map(seven_digits).join(", "));
            format!("({low}) .. ({high})")
        });
        let sensors = match self.outcome.sensors() {
            0 => String::new(),
            count => count.to_string(),
        };
        let cells = [
            name,
            self.outcome.format(),
            points,
            self.outcome.attributes(),
            bounds,
            self.outcome.system(),
            sensors,
            self.outcome.notes(),
            if self.outcome.rendered { "yes" } else { "no" }.into(),
        ];
        let mut row = String::from("|");
        for cell in cells {
            let _ = write!(row, " {} |", cell.replace('|', "\\|").replace('<', "&lt;"));
        }
        row + "\n"
    }
}

/// Formats a number with seven digits, like the data's own table.
fn seven_digits(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let decimals = (6 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Exit code and output of a command.
struct CommandOutput {
    /// `None` if a signal ended the command.
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

/// Runs the program in the folder of the data, so that messages contain no absolute paths. Returns `None` after
/// `COMMAND_TIMEOUT`.
fn run(program: &Path, data: &Path, arguments: &[&str]) -> Result<Option<CommandOutput>> {
    let mut command = Command::new(program);
    command.current_dir(data).args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().context("cannot start the program")?;
    let (mut stdout, mut stderr) = (child.stdout.take().context("a pipe")?, child.stderr.take().context("a pipe")?);
    // Both pipes are read while the program runs, since a full pipe would block it.
    let read_out = std::thread::spawn(move || {
        let mut text = String::new();
        stdout.read_to_string(&mut text).map(|_| text)
    });
    let read_err = std::thread::spawn(move || {
        let mut text = String::new();
        stderr.read_to_string(&mut text).map(|_| text)
    });
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break Some(status);
        }
        if start.elapsed() > COMMAND_TIMEOUT {
            child.kill()?;
            child.wait()?;
            break None;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let stdout = read_out.join().ok().context("the output cannot be read")??;
    let stderr = read_err.join().ok().context("the output cannot be read")??;
    Ok(status.map(|status| CommandOutput { code: status.code(), stdout, stderr }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(points: u64, rendered: bool) -> FileOutcome {
        let report = serde_json::json!({
            "format": "PLY", "points": points, "scanned": true, "error": null, "warnings": [format!("{points} odd | ones")],
            "bounds": {"min": [0.0, -1.5, 0.0], "max": [points as f64, 1.0, 5_403_547.5]},
        });
        FileOutcome { report, error: None, rendered }
    }

    #[test]
    fn equal_files_share_a_row() {
        let mut row = FileRow::new("a/frame_001.ply".into(), outcome(10, true));
        assert!(row.continues("a/frame_002.ply", &outcome(12, true)), "only numbers differ");
        assert!(!row.continues("b/frame_002.ply", &outcome(12, true)), "another folder");
        assert!(!row.continues("a/frame_002.ply", &outcome(12, false)), "another outcome");
        row.add("a/frame_002.ply", &outcome(12, true));
        let expected = "| a/frame_001.ply .. frame_002.ply (2 files) | PLY | 10 to 12 |  | (0, -1.5, 0) .. (12, 1, 5403548) \
                        |  |  | 10 odd \\| ones | yes |\n";
        assert_eq!(row.to_markdown(), expected, "one row, with the range of both");
    }
}
