//! `cargo xtask test`: everything that a change has to pass, cheapest first.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Instant;

use anyhow::{Context as _, Result, bail, ensure};

use crate::machine::{component, find_data, find_device, find_screen, left_out};
use crate::programs::Programs;
use crate::{FEATURES, cargo, cargo_command, formats, layers, lengths, peers, python, run};

/// Steps that report their time, and the time of each for the summary.
struct Steps {
    start: Instant,
    done: Vec<(&'static str, f64)>,
}

impl Steps {
    fn new() -> Self {
        Self { start: Instant::now(), done: Vec::new() }
    }

    fn step<T>(&mut self, name: &'static str, check: impl FnOnce() -> Result<T>) -> Result<T> {
        println!("\n== {name}");
        let start = Instant::now();
        let outcome = check().with_context(|| format!("step '{name}' failed"))?;
        let seconds = start.elapsed().as_secs_f64();
        println!("== {name}: {seconds:.1} s");
        self.done.push((name, seconds));
        Ok(outcome)
    }

    fn summary(&self) {
        println!("\nseconds by step");
        self.done.iter().for_each(|(name, seconds)| println!("{seconds:8.1}  {name}"));
        println!("\nall passed in {:.0} s", self.start.elapsed().as_secs_f64());
    }
}

/// Everything, in one profile and one set of features, so that no crate is built twice for its tests.
pub(crate) fn everything(root: &Path) -> Result<()> {
    let mut steps = Steps::new();
    let [peer_python, package_python] = [(); 2].map(|()| RefCell::new(Err(String::new())));
    steps.step("what the machine has", || {
        find_data(root)?;
        find_device()?;
        find_screen()?;
        *peer_python.borrow_mut() = peers::find_python(root)?;
        *package_python.borrow_mut() = python::find_python(root)?;
        tell_left_out(&peer_python.borrow(), &package_python.borrow());
        component("fmt", "rustfmt")?;
        component("clippy", "clippy")
    })?;
    cheap(root, &mut steps)?;
    let deny = ["--", "-D", "warnings"];
    steps.step("lints", || {
        cargo(root, &[&["clippy", "--locked", "--workspace"][..], &FEATURES, &["--all-targets"], &deny].concat())
    })?;
    // What is there only without Zenoh or without the window. Of the whole workspace, so that dependencies have the
    // same features and are not checked again.
    steps.step("lints without Zenoh and without the window", || {
        cargo(root, &[&["clippy", "--locked", "--workspace", "--no-default-features"][..], &deny].concat())
    })?;
    steps.step("documentation", || {
        let mut command = cargo_command(root);
        // With examples, though there are none, the libraries' documentation stands on what the lints have checked.
        command.args(["doc", "--locked", "--workspace", "--no-deps", "--lib", "--examples"]).args(FEATURES);
        run(command.env("RUSTDOCFLAGS", "-D warnings"))
    })?;
    let programs = steps.step("build of tests", || Programs::build(root))?;
    steps.step("tests", || programs.run())?;
    steps.step("tests of examples", || {
        cargo(root, &[&["test", "--locked", "--workspace", "--doc"][..], &FEATURES].concat())
    })?;
    steps.step("docs/FORMATS.md", || formats::check(root, programs.command()?))?;
    if let Ok(python) = &*peer_python.borrow() {
        steps.step("tests with programs of others", || peers::test(root, python, &["--ignored"]))?;
    }
    if let Ok(python) = &*package_python.borrow() {
        steps.step("the package of Python", || python::test(root, python))?;
    }
    steps.summary();
    tell_left_out(&peer_python.borrow(), &package_python.borrow());
    Ok(())
}

/// Says what is not tested for want of a Python.
fn tell_left_out(peers: &Result<PathBuf, String>, package: &Result<PathBuf, String>) {
    let what = ["the tests with recordings and messages of other programs", "the tests of the package of Python"];
    for (what, python) in what.into_iter().zip([peers, package]) {
        python.as_ref().err().into_iter().for_each(|why| left_out(what, why));
    }
}

/// What takes seconds.
pub(crate) fn rules(root: &Path) -> Result<()> {
    let mut steps = Steps::new();
    component("fmt", "rustfmt")?;
    cheap(root, &mut steps)?;
    steps.summary();
    Ok(())
}

fn cheap(root: &Path, steps: &mut Steps) -> Result<()> {
    steps.step("format", || cargo(root, &["fmt", "--all", "--check"]).context("cargo fmt --all puts it right"))?;
    steps.step("imports", || layers::check(root))?;
    steps.step("lengths of files, comments and documents", || lengths::check(root))?;
    steps
        .step("crates of points never reach wgpu", || POINTS.iter().try_for_each(|name| check_dependencies(root, name)))
}

/// Crates that must stay usable without a graphics stack.
const POINTS: [&str; 5] =
    ["autosplats-cloud", "autosplats-formats", "autosplats-remote", "autosplats-scenes", "autosplats-sources"];

fn check_dependencies(root: &Path, name: &str) -> Result<()> {
    let mut command = cargo_command(root);
    command.args(["tree", "--locked", "-p", name, "--all-features", "-e", "normal,build", "--prefix", "none"]);
    let output = command.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    ensure!(output.status.success(), "cargo tree: {}", output.status);
    let tree = String::from_utf8(output.stdout)?;
    ensure!(tree.starts_with(&format!("{name} ")), "cargo tree shows something else: {tree}");
    if let Some(line) = tree.lines().find(|line| line.starts_with("wgpu")) {
        bail!("{name} depends on {line}");
    }
    println!("{name}: {} packages", tree.lines().count());
    Ok(())
}
