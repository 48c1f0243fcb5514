//! What the tests need of the machine: found, installed where nobody has to be asked, or named as left out.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Result, ensure};

use crate::run;

/// Says that something was not tested, where nobody overlooks it.
pub(crate) fn left_out(what: &str, why: &str) {
    eprintln!("LEFT OUT: {what}: {why}");
}

/// The real scans that some tests read lie beside the repository, as they may not be redistributed. CI has them.
pub(crate) fn find_data(root: &Path) -> Result<()> {
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

/// The GPU's tests run on any device, also on one that is a program on the processor. Where there is none it is
/// installed if that can be done without asking anybody.
pub(crate) fn find_device() -> Result<()> {
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
pub(crate) fn find_screen() -> Result<()> {
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
pub(crate) fn install(packages: &[&str]) -> bool {
    let apt = |arguments: &[&str]| {
        let mut command = Command::new("apt-get");
        run(command.args(arguments).env("DEBIAN_FRONTEND", "noninteractive").stdout(Stdio::null()))
    };
    let arguments = [&["install", "--yes", "--no-install-recommends"][..], packages].concat();
    apt(&["update"]).and_then(|()| apt(&arguments)).is_ok()
}

/// Says how to get a part of the toolchain that is not installed.
pub(crate) fn component(command: &str, component: &str) -> Result<()> {
    let found = Command::new("cargo").args([command, "--version"]).output().is_ok_and(|output| output.status.success());
    ensure!(found, "{component} is not installed; get it by: rustup component add {component}");
    Ok(())
}
