//! The project's own tasks. `cargo xtask test` is everything CI runs.

mod formats;
mod layers;
mod lengths;
mod peers;
mod pictures;

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::Instant;

use anyhow::{Context as _, Result, bail, ensure};

const USAGE: &str = "\
usage: cargo xtask test               format, lints, build, tests, a minute of broken files among them, documentation,
                                  the rules between crates and stages, Zenoh and programs of others
       cargo xtask peers              of the tests those of Zenoh and with programs of others, for which it gets a Python
       cargo xtask fuzz [OPTIONS]     broken files for every reader, as long as wanted; --help tells the options
       cargo xtask quality [OPTIONS]  docs/QUALITY.md, from pictures held against the exact surface, in some ten minutes;
                                  --quick and --only NAME take some of them, --out DIR writes elsewhere
       cargo xtask formats            docs/FORMATS.md, from what the program says of its formats and of the test data;
                                  with --check only whether it is what this build makes
       cargo xtask pictures OUT [--program PATH]
                                  a fixed list of pictures, layers and normals in the empty folder OUT, with a hash of each
       cargo xtask pictures --compare BEFORE AFTER
                                  whether two such folders hold the same";

/// What everything is built with, so that what Zenoh needs is built once, and nothing beside it twice.
const FEATURES: [&str; 2] = ["--features", "autosplats-cli/zenoh"];

fn main() -> ExitCode {
    let typed: Vec<String> = std::env::args().skip(1).collect();
    let outcome = match typed.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["test"] => root().and_then(test),
        ["peers"] => root().and_then(peers::alone),
        ["fuzz", options @ ..] => root().and_then(|root| fuzz(root, options)),
        ["quality", options @ ..] => root().and_then(|root| quality(root, options)),
        ["formats"] => root().and_then(|root| formats::run(root, false)),
        ["formats", "--check"] => root().and_then(|root| formats::run(root, true)),
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

/// Broken files for every reader. Built like the tests, so that overflows are found too.
fn fuzz(root: &Path, options: &[&str]) -> Result<()> {
    cargo(root, &[&["run", "--locked", "--quiet", "-p", "autosplats-fuzz", "--"], options].concat())
}

/// Pictures against the exact surface. Its tests measure the small cases; this is built for speed, to measure all.
fn quality(root: &Path, options: &[&str]) -> Result<()> {
    cargo(root, &[&["run", "--locked", "--quiet", "--release", "-p", "autosplats-quality", "--"], options].concat())
}

/// Everything a change has to pass, cheapest first.
fn test(root: &Path) -> Result<()> {
    let start = Instant::now();
    let step = |name: &str, check: &dyn Fn() -> Result<()>| {
        println!("\n== {name}");
        let start = Instant::now();
        check().with_context(|| format!("step '{name}' failed"))?;
        println!("== {name}: {:.1} s", start.elapsed().as_secs_f64());
        Ok::<(), anyhow::Error>(())
    };
    step("test data", &|| find_data(root))?;
    step("graphics device", &find_device)?;
    step("screen in memory", &find_screen)?;
    let python = RefCell::new(Err(String::new()));
    step("programs of others", &|| {
        *python.borrow_mut() = peers::find_python(root)?;
        python.borrow().as_ref().err().into_iter().for_each(left_out);
        Ok(())
    })?;
    step("imports", &|| layers::check(root))?;
    step("lengths of files, comments and documents", &|| lengths::check(root))?;
    step("autosplats-cloud never reaches wgpu", &|| check_dependencies(root))?;
    step("format", &|| {
        component("fmt", "rustfmt")?;
        cargo(root, &["fmt", "--all", "--check"]).context("cargo fmt --all puts it right")
    })?;
    step("lints", &|| {
        component("clippy", "clippy")?;
        let clippy = ["clippy", "--locked", "--workspace"];
        let deny = ["--", "-D", "warnings"];
        cargo(root, &[&clippy[..], &FEATURES, &["--all-targets"], &deny].concat())?;
        // As it is built by default, of which a few lines are others.
        cargo(root, &[&clippy[..], &deny].concat())
    })?;
    let tests = |more: &[&str]| cargo(root, &[&["test", "--locked", "--workspace"][..], &FEATURES, more].concat());
    step("build", &|| tests(&["--no-run"]))?;
    step("tests", &|| tests(&[]))?;
    if let Ok(python) = &*python.borrow() {
        step("tests with programs of others", &|| peers::test(root, python, &["--ignored"]))?;
    }
    step("documentation", &|| {
        let mut command = cargo_command(root);
        // Of the libraries; with examples, though there are none, it stands on what the lints have built.
        command.args(["doc", "--locked", "--workspace", "--no-deps", "--lib", "--examples"]).args(FEATURES);
        run(command.env("RUSTDOCFLAGS", "-D warnings"))
    })?;
    println!("\nall passed in {:.0} s", start.elapsed().as_secs_f64());
    python.borrow().as_ref().err().into_iter().for_each(left_out);
    Ok(())
}

/// Says that something was not tested, where nobody overlooks it.
fn left_out(why: &String) {
    eprintln!("LEFT OUT: the tests with recordings and messages of other programs: {why}");
}

/// The real scans that some tests read lie beside the repository, as they may not be redistributed. CI has them.
fn find_data(root: &Path) -> Result<()> {
    let folder = std::env::var_os("AUTOSPLATS_DATA").map_or_else(|| root.join("../shared/data"), PathBuf::from);
    if folder.is_dir() {
        println!("{}", folder.display());
        return Ok(());
    }
    let absent = format!("{} is absent; AUTOSPLATS_DATA can name another folder", folder.display());
    ensure!(std::env::var_os("CI").is_none(), "{absent}");
    println!("{absent}. Tests on real scans are left out.");
    Ok(())
}

/// What Vulkan on the processor takes on Debian and its kin.
const SOFTWARE_VULKAN: [&str; 2] = ["libvulkan1", "mesa-vulkan-drivers"];

/// The GPU's tests run on any device, also on one that is a program on the processor. Where there is none it is installed
/// if that can be done without asking anybody.
fn find_device() -> Result<()> {
    let drivers = || {
        let folders = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"].map(Path::new);
        folders.into_iter().filter_map(|folder| folder.read_dir().ok()).flatten().flatten().count()
    };
    if !cfg!(target_os = "linux") || drivers() > 0 {
        println!("a driver is there, or comes with the system");
        return Ok(());
    }
    let absent = format!("there is no Vulkan driver; on Debian: apt-get install {}", SOFTWARE_VULKAN.join(" "));
    if install(&SOFTWARE_VULKAN) && drivers() > 0 {
        println!("installed {}", SOFTWARE_VULKAN.join(" "));
        return Ok(());
    }
    ensure!(std::env::var_os("CI").is_none(), "{absent}");
    println!("{absent}. Tests of the GPU are left out.");
    Ok(())
}

/// What a window on a screen in memory takes on Debian and its kin.
const SCREEN: [&str; 7] =
    ["xvfb", "libgl1", "libxkbcommon-x11-0", "libxcursor1", "libxi6", "libxrandr2", "libx11-xcb1"];

/// The window's test runs on a screen in memory. Where there is none it is installed if that can be done without asking
/// anybody.
fn find_screen() -> Result<()> {
    let found = || {
        let paths = std::env::var_os("PATH").unwrap_or_default();
        std::env::split_paths(&paths).any(|folder| folder.join("Xvfb").is_file())
    };
    if !cfg!(target_os = "linux") || found() {
        println!("Xvfb is there, or not of this system");
        return Ok(());
    }
    let absent = format!("there is no Xvfb; on Debian: apt-get install {}", SCREEN.join(" "));
    if install(&SCREEN) && found() {
        println!("installed {}", SCREEN.join(" "));
        return Ok(());
    }
    ensure!(std::env::var_os("CI").is_none(), "{absent}");
    println!("{absent}. The window's test is left out.");
    Ok(())
}

/// Installs packages of Debian, if that can be done without asking anybody; says whether it could.
fn install(packages: &[&str]) -> bool {
    let apt = |arguments: &[&str]| {
        let mut command = Command::new("apt-get");
        run(command.args(arguments).env("DEBIAN_FRONTEND", "noninteractive").stdout(Stdio::null()))
    };
    let arguments = [&["install", "--yes", "--no-install-recommends"][..], packages].concat();
    apt(&["update"]).and_then(|()| apt(&arguments)).is_ok()
}

/// Reading points must stay possible without a graphics stack.
fn check_dependencies(root: &Path) -> Result<()> {
    let mut command = cargo_command(root);
    command.args(["tree", "--locked", "-p", "autosplats-cloud", "-e", "normal,build", "--prefix", "none"]);
    let output = command.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    ensure!(output.status.success(), "cargo tree: {}", output.status);
    let tree = String::from_utf8(output.stdout)?;
    ensure!(tree.starts_with("autosplats-cloud "), "cargo tree shows something else: {tree}");
    if let Some(line) = tree.lines().find(|line| line.starts_with("wgpu")) {
        bail!("autosplats-cloud depends on {line}");
    }
    println!("{} packages", tree.lines().count());
    Ok(())
}

/// Says how to get a part of the toolchain that is not installed.
fn component(command: &str, component: &str) -> Result<()> {
    let found = Command::new("cargo").args([command, "--version"]).output().is_ok_and(|output| output.status.success());
    ensure!(found, "{component} is not installed; get it by: rustup component add {component}");
    Ok(())
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
