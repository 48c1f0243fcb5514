//! The project's own tasks. `cargo xtask test` is everything CI runs.

mod card;
mod environment;
mod formats;
mod lanes;
mod layers;
mod lengths;
mod machine;
mod peers;
mod performance;
mod pictures;
mod programs;
mod python;
mod test;
mod walk;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context as _, Result, bail, ensure};

const USAGE: &str = "\
usage: cargo xtask test               runs every check of CI: rules, lints, documentation, build, tests
       cargo xtask rules              runs the checks that take seconds: format, imports, lengths, dependencies
       cargo xtask peers              runs the tests with Zenoh and with programs of others; installs their Python packages
       cargo xtask python             builds and tests the package of Python, and checks its types
       cargo xtask wheel              builds its wheel for distribution, checks it, and installs it for every Python found
       cargo xtask fuzz [OPTIONS]     gives broken files to every reader; --help lists the options
       cargo xtask faults [ROUNDS]    signals, races, cut files and little memory at random moments, by default 13 times,
                                  which are more than 2,000 runs of the command in half an hour
       cargo xtask quality [OPTIONS]  measures pictures against exact surfaces, in ten minutes, prints what changed since
                                  docs/quality/measures.json, and writes that file and docs/QUALITY.md anew unless an
                                  error grew by more than 3 %; --quick and --only NAME measure some cases; see --help
       cargo xtask quality --compare BEFORE AFTER
                                  what changed between two such files; fails if an error grew by more than 3 %
       cargo xtask formats            docs/FORMATS.md, from what the program says of its formats and of the test data;
                                  with --check only whether it is what this build makes, with --program PATH by that
                                  build of the command
       cargo xtask performance --page | --machine NAME [--only TEXT] [--program PATH --commit HASH]
                                  docs/PERFORMANCE.md, from docs/performance/*.json; NAME.json is measured first, in some ten
                                  minutes, with --only those jobs that contain TEXT, as gpu does, with --program another build
       cargo xtask card [--page | [--program PATH] [--commit HASH]]
                                  where the time of a frame goes on a graphics card, by stages and by passes, in some six
                                  minutes; without a card only what is counted. Writes docs/performance/gpu/DEVICE.json
                                  and docs/performance/GPU.md. The program is built unless it is given
       cargo xtask pictures OUT [--program PATH]
                                  a fixed list of pictures, layers and normals in the empty folder OUT, with a hash of each
       cargo xtask pictures --compare BEFORE AFTER
                                  whether two such folders hold the same
       cargo xtask walk FRAMES.jsonl OUT.svg
                                  a chart of memory, time and points of each frame of a film through an octree, from the
                                  lines that render --camera-path --json prints";

/// What everything is built with, so that what Zenoh needs is built once, and nothing beside it twice.
const FEATURES: [&str; 2] = ["--features", "autosplats-cli/zenoh"];

fn main() -> ExitCode {
    let typed: Vec<String> = std::env::args().skip(1).collect();
    let outcome = match typed.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["test"] => root().and_then(test::everything),
        ["rules"] => root().and_then(test::rules),
        ["peers"] => root().and_then(peers::alone),
        ["python"] => root().and_then(python::alone),
        ["wheel"] => root().and_then(python::wheel),
        ["fuzz", options @ ..] => root().and_then(|root| fuzz(root, options)),
        ["faults"] => root().and_then(|root| faults(root, "13")),
        ["faults", rounds] => root().and_then(|root| faults(root, rounds)),
        ["quality", options @ ..] => root().and_then(|root| quality(root, options)),
        ["formats"] => root().and_then(|root| formats::write(root, &formats::build(root)?)),
        ["formats", "--program", program] => root().and_then(|root| formats::write(root, program.as_ref())),
        ["formats", "--check"] => root().and_then(|root| formats::check(root, &formats::build(root)?)),
        ["performance", options @ ..] => root().and_then(|root| performance::run(root, options)),
        ["card", options @ ..] => root().and_then(|root| card::run(root, options)),
        ["pictures", "--compare", before, after] => {
            root().and_then(|root| pictures::run(root, &pictures::Task::Compare([before.as_ref(), after.as_ref()])))
        }
        ["pictures", out, rest @ ..] if !out.starts_with('-') => root().and_then(|root| {
            let program = match rest {
                [] => None,
                ["--program", program] => Some(Path::new(program)),
                _ => bail!("pictures takes no {}\n{USAGE}", rest.join(" ")),
            };
            pictures::run(root, &pictures::Task::Render { out: out.as_ref(), program })
        }),
        ["walk", frames, out] => walk::run(frames.as_ref(), out.as_ref()),
        [] | ["help" | "-h" | "--help"] => {
            println!("{USAGE}");
            Ok(())
        }
        _ => Err(anyhow::anyhow!("there is no task '{}'\n{USAGE}", typed.join(" "))),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("\nerror: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn root() -> Result<&'static Path> {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask has a workspace around it")
}

/// Broken files for every reader. Built for speed, as inputs count in millions; overflows are found as in the tests.
fn fuzz(root: &Path, options: &[&str]) -> Result<()> {
    let program = ["run", "--locked", "--quiet", "--profile", "fuzz", "-p", "autosplats-fuzz", "--"];
    cargo(root, &[&program, options].concat())
}

/// The tests of faults at random moments, again and again. Built like the tests, which are there already.
fn faults(root: &Path, rounds: &str) -> Result<()> {
    ensure!(rounds.parse::<u32>().is_ok_and(|rounds| rounds > 0), "'{rounds}' is no number of rounds");
    let mut command = cargo_command(root);
    command.args(["test", "--locked", "--workspace"]).args(FEATURES).args(["--test", "faults", "--test", "limits"]);
    run(command.args(["--no-fail-fast", "--", "--test-threads=2"]).env("AUTOSPLATS_ROUNDS", rounds))
}

/// Pictures against exact surfaces. Built for speed, as all cases are measured; the tests measure the small ones.
fn quality(root: &Path, options: &[&str]) -> Result<()> {
    cargo(root, &[&["run", "--locked", "--quiet", "--release", "-p", "autosplats-quality", "--"], options].concat())
}

/// Builds the command without the window in a profile, and returns its path.
fn build_command(root: &Path, profile: &str) -> Result<PathBuf> {
    let command = ["--package", "autosplats-cli", "--no-default-features"];
    cargo(root, &[&["build", "--locked", "--profile", profile][..], &command].concat())?;
    let this_program = std::env::current_exe()?;
    let target = this_program.ancestors().nth(2).context("cargo xtask runs target/debug/xtask")?;
    Ok(target.join(profile).join(format!("autosplats{}", std::env::consts::EXE_SUFFIX)))
}

fn cargo(root: &Path, arguments: &[&str]) -> Result<()> {
    run(cargo_command(root).args(arguments))
}

fn cargo_command(root: &Path) -> Command {
    let mut command = Command::new("cargo");
    // Else Mesa says for each device it looks for that there is no Wayland, where there is none.
    command.current_dir(root).env("NODEVICE_SELECT", "1");
    command
}

fn run(command: &mut Command) -> Result<()> {
    let status = command.status().context("cannot start cargo")?;
    ensure!(status.success(), "{:?}: {status}", command.get_args().collect::<Vec<_>>());
    Ok(())
}
