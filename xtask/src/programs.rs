//! The programs of tests that cargo builds, run beside each other: many tests wait, for files that change and points
//! that come, while others compute.

use std::fs::File;
use std::io::{Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};
use serde_json::Value;

use crate::lanes::in_lanes;
use crate::{FEATURES, cargo_command};

/// Programs that run at a time.
const LANES: usize = 3;

/// What a program may take at the most: far more than any does, and less than whoever started the tests waits.
const LIMIT: Duration = Duration::from_secs(40 * 60);

/// Programs that take longest, in this order; what comes last in its lane should be short.
const LONGEST_FIRST: [&str; 4] = ["autosplats-quality it", "autosplats it", "autosplats lib", "autosplats-fuzz"];

/// One program of tests.
struct Program {
    /// The package and the target.
    name: String,
    /// Where cargo would run it: the folder of the package.
    folder: PathBuf,
    executable: PathBuf,
}

/// All programs of tests of the workspace, and the command that some of them run.
pub(crate) struct Programs {
    tests: Vec<Program>,
    command: Option<PathBuf>,
}

impl Programs {
    pub(crate) fn build(root: &Path) -> Result<Self> {
        let mut command = cargo_command(root);
        command.args(["test", "--locked", "--workspace"]).args(FEATURES);
        command.args(["--no-run", "--message-format", "json-render-diagnostics"]);
        let output = command.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
        ensure!(output.status.success(), "cargo test --no-run: {}", output.status);
        let programs = Self::from_messages(&String::from_utf8(output.stdout)?)?;
        println!("{} programs of tests", programs.tests.len());
        Ok(programs)
    }

    fn from_messages(messages: &str) -> Result<Self> {
        let mut programs = Self { tests: Vec::new(), command: None };
        for line in messages.lines() {
            let message: Value = serde_json::from_str(line).context("a message of cargo")?;
            let Some(executable) = message["executable"].as_str() else { continue };
            let target = &message["target"];
            let [name, kind] = [&target["name"], &target["kind"][0]].map(|text| text.as_str().unwrap_or_default());
            if message["profile"]["test"] != true {
                if name == "autosplats" && kind == "bin" {
                    programs.command = Some(executable.into());
                }
                continue;
            }
            let manifest = message["manifest_path"].as_str().context("a message of cargo names the manifest")?;
            let folder = Path::new(manifest).parent().context("a manifest lies in a folder")?.to_owned();
            let package = message["package_id"].as_str().and_then(package_name).context("a package has a name")?;
            let target = if kind == "test" { name } else { kind };
            programs.tests.push(Program { name: format!("{package} {target}"), folder, executable: executable.into() });
        }
        ensure!(!programs.tests.is_empty(), "cargo builds no test");
        let place = |program: &Program| {
            LONGEST_FIRST.iter().position(|name| program.name.starts_with(name)).unwrap_or(LONGEST_FIRST.len())
        };
        programs.tests.sort_by_key(place);
        Ok(programs)
    }

    /// The command, as built for the tests.
    pub(crate) fn command(&self) -> Result<&Path> {
        self.command.as_deref().context("cargo builds no command autosplats")
    }

    /// Runs all of them, prints what each says when it ends, and fails if any did.
    pub(crate) fn run(&self) -> Result<()> {
        let outcomes = in_lanes(LANES, &self.tests, |program| {
            let start = Instant::now();
            let output = program.run();
            (program.name.as_str(), tell(&program.name, output, start.elapsed().as_secs_f64()))
        });
        let failed: Vec<&str> = outcomes.iter().filter(|(_, passed)| !passed).map(|(name, _)| *name).collect();
        if !failed.is_empty() {
            bail!("failed: {}", failed.join(", "));
        }
        Ok(())
    }
}

impl Program {
    /// Runs it to its end, or to the [time limit](LIMIT).
    fn run(&self) -> Result<Output> {
        println!("-- {} starts", self.name);
        let mut command = Command::new(&self.executable);
        // As in `cargo_command`: else Mesa says for each device that there is no Wayland.
        command.current_dir(&self.folder).env("NODEVICE_SELECT", "1").env("CARGO_MANIFEST_DIR", &self.folder);
        // Files, not pipes: a program that says much does not wait for whoever reads it.
        let [mut stdout, mut stderr] = [tempfile::tempfile()?, tempfile::tempfile()?];
        command.stdin(Stdio::null()).stdout(stdout.try_clone()?).stderr(stderr.try_clone()?);
        let mut child = command.spawn().with_context(|| self.executable.display().to_string())?;
        let start = Instant::now();
        let status = loop {
            match child.try_wait()? {
                Some(status) => break status,
                None if start.elapsed() > LIMIT => {
                    child.kill()?;
                    println!("-- {}: stopped after {} minutes", self.name, LIMIT.as_secs() / 60);
                    break child.wait()?;
                }
                None => thread::sleep(Duration::from_millis(50)),
            }
        };
        let read = |file: &mut File| -> Result<Vec<u8>> {
            let mut bytes = Vec::new();
            file.rewind()?;
            file.read_to_end(&mut bytes)?;
            Ok(bytes)
        };
        Ok(Output { status, stdout: read(&mut stdout)?, stderr: read(&mut stderr)? })
    }
}

/// Prints what a program said, and returns whether it passed.
fn tell(name: &str, output: Result<Output>, seconds: f64) -> bool {
    // Held, so that what two programs say is not mixed.
    let _out = std::io::stdout().lock();
    println!("\n-- {name}: {seconds:.1} s");
    match output {
        Ok(output) => {
            // Where standard output is closed nobody reads it.
            let _ = std::io::stdout().write_all(&output.stdout);
            let _ = std::io::stdout().write_all(&output.stderr);
            if !output.status.success() {
                println!("-- {name}: {}", output.status);
            }
            output.status.success()
        }
        Err(error) => {
            println!("-- {name}: {error:#}");
            false
        }
    }
}

/// The name in a package id such as `path+file:///folder/crates/name#0.1.0` or `…/folder#name@0.1.0`.
fn package_name(id: &str) -> Option<&str> {
    let (path, version) = id.rsplit_once('#')?;
    match version.split_once('@') {
        Some((name, _)) => Some(name),
        None => path.rsplit('/').next(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(package: &str, name: &str, kind: &str, test: bool) -> String {
        format!(
            r#"{{"package_id":"path+file:///a/{package}#0.1.0","manifest_path":"/a/{package}/Cargo.toml","target":{{"name":"{name}","kind":["{kind}"]}},"profile":{{"test":{test}}},"executable":"/t/{name}-{kind}"}}"#
        )
    }

    #[test]
    fn tests_and_the_command_are_told_apart() {
        let lines = [
            message("autosplats-output", "autosplats_output", "lib", true),
            message("autosplats-cli", "autosplats", "bin", false),
            message("autosplats-cli", "autosplats", "bin", true),
            message("autosplats-quality", "it", "test", true),
            r#"{"reason":"build-finished","success":true}"#.to_owned(),
        ];
        let programs = Programs::from_messages(&lines.join("\n")).expect("messages");
        let names: Vec<&str> = programs.tests.iter().map(|program| program.name.as_str()).collect();
        assert_eq!(
            names,
            ["autosplats-quality it", "autosplats-output lib", "autosplats-cli bin"],
            "the longest first"
        );
        assert_eq!(programs.command().expect("the command"), Path::new("/t/autosplats-bin"), "not its tests");
        assert!(Programs::from_messages("").is_err(), "no test at all is an error");
    }

    #[cfg(unix)]
    #[test]
    fn a_program_that_fails_is_named() {
        let program = |script: &str, name: &str| Program {
            name: name.to_owned(),
            folder: std::env::temp_dir(),
            executable: script.into(),
        };
        let run = |tests| Programs { tests, command: None }.run();
        assert!(run(vec![program("true", "good")]).is_ok(), "all pass");
        let error = run(vec![program("false", "bad"), program("true", "good")]).expect_err("one fails").to_string();
        assert!(error.contains("bad") && !error.contains("good"), "{error}");
        assert!(run(vec![program("/no/such/program", "absent")]).is_err(), "one cannot be started");
    }
}
