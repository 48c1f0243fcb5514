//! `cargo xtask pictures`: a fixed list of pictures, layers and normals with a hash of each, to prove that a change
//! moves no pixel.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::{create_dir_all, read, read_dir, read_to_string, write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail, ensure};
use sha2::{Digest as _, Sha256};

use crate::build_command;
use crate::lanes::in_lanes;

/// The file of hashes: a line per output, `HASH NAME`, or `exit CODE NAME` for a command that fails.
const HASHES: &str = "hashes.txt";
/// Odd, and smaller than a picture that anyone looks at: the list takes minutes, not an hour.
const SIZE: &str = "531x299";
/// Commands that run at a time. Each uses all cores for some of its stages only.
const PROCESSES: usize = 2;

/// Generated scenes, with a moment for those that move.
const SCENES: [&str; 6] = [
    "scene:figure:60K",
    "scene:two-scales:60K",
    "scene:statue:200K",
    "scene:herd:100K@0.4",
    "scene:cathedral:200K",
    "scene:cathedral:2M",
];

/// Folders of `data` that are one input each: their files follow each other.
const SEQUENCES: [&str; 2] = ["animation", "sequences"];

/// Inputs that are rendered with every setting: dense, noisy, of a depth camera, of a spinning lidar, coloured,
/// classified.
const VARIED: [&str; 6] = [
    "scene:statue:200K",
    "multiview/bunny_scans/bun000.ply",
    "scans/five_people.pcd",
    "sequences/kitti_drive_pcd/000000.pcd",
    "models/guanyin_color.ply",
    "scans/autzen_trim.laz",
];

/// Settings and colour modes, one at a time.
const SETTINGS: &[&str] = &[
    "-k 10",
    "-k 3 --ellipses",
    "-k 24",
    "--keep-outliers",
    "--bridge-gaps",
    "--gap-factor 2 --e0 2",
    "--ellipses",
    "--no-trim",
    "--no-grid-culling",
    "--no-depth-refinement",
    "--points-per-pixel 1",
    "--splat-scale 0.6",
    "--ortho fit",
    "--view top",
    "--view back --backs red",
    "--color plain --legend",
    "--color height --legend",
    "--color intensity",
    "--color classification --legend",
    "--color normal",
    "--color curvature",
    "--color radius",
    "--color k-radius --legend",
    "--color depth",
    "--no-lighting",
    "--exposure 2",
    "--occlusion 0",
    "--background transparent",
];

/// How many of [`VARIED`] a GPU renders: on a software device a picture takes seconds.
const VARIED_ON_GPU: usize = 2;

/// Engines that only a GPU has. The first radius is given, because the best one is found by time.
const GPU_ENGINES: [&str; 3] = [
    "-k 10 --engine splat-communication",
    "-k 10 --engine splat-communication-raster",
    "-k 10 --engine kd-tree --first-radius 0.05",
];

/// Points that move: frames of one run look back at each other.
const MOVING: [(&str, &str); 7] = [
    ("scene:herd:60K", "--frames 0..3 --frames-averaged 4"),
    ("scene:figure:60K", "--frames 0..2 --scan 3 --color k-radius"),
    ("animation/samba", "--frames 0..2 --sample 50K"),
    ("animation/stork_morph.glb", "--frames 0..2 --sample 50K"),
    ("sequences/kitti_drive_pcd", "--frames 0..2 --frames-averaged 3"),
    ("sequences/ouster_ros2_cdr.mcap", "--frames 0..1 --decay 1s"),
    ("sequences/rgbd_kinect", "--frames 0..1"),
];

/// What is asked for on the command line.
pub(crate) enum Task<'a> {
    /// Render the list into a folder, with the program named or one built for it.
    Render { out: &'a Path, program: Option<&'a Path> },
    /// Compare the hashes of two folders.
    Compare([&'a Path; 2]),
}

/// One run of the program: its outputs have names that begin with `name`.
struct Case {
    name: String,
    arguments: Vec<String>,
    /// How an output is asked for, before its path.
    output_flag: Option<&'static str>,
    extensions: &'static [&'static str],
}

pub(crate) fn run(root: &Path, task: &Task<'_>) -> Result<()> {
    match task {
        Task::Render { out, program } => {
            let data = std::env::var_os("AUTOSPLATS_DATA").map_or_else(|| root.join("../shared/data"), PathBuf::from);
            let data = data.canonicalize().with_context(|| format!("{}: the test data are needed", data.display()))?;
            let program = match program {
                Some(program) => program.canonicalize().with_context(|| program.display().to_string())?,
                None => build_command(root, "release")?,
            };
            render(&program, &data, out)
        }
        Task::Compare(folders) => compare(*folders),
    }
}

fn render(program: &Path, data: &Path, out: &Path) -> Result<()> {
    create_dir_all(out).with_context(|| out.display().to_string())?;
    // The program runs in the folder of the data, so that inputs have the same names on every machine.
    let out = &out.canonicalize()?;
    ensure!(read_dir(out)?.next().is_none(), "{} is not empty: old pictures would be hashed too", out.display());
    let cases = cases(data)?;
    let codes = in_lanes(PROCESSES, &cases, |case| run_case(program, data, out, case));
    let mut failed = BTreeMap::new();
    for (case, code) in cases.iter().zip(codes) {
        match code? {
            0 => {}
            code => drop(failed.insert(case.name.clone(), code)),
        }
    }

    let mut hashes = String::new();
    let mut files: Vec<_> = read_dir(out)?.collect::<Result<_, _>>()?;
    files.sort_by_key(std::fs::DirEntry::file_name);
    for file in &files {
        let digest = Sha256::digest(read(file.path())?);
        let hex = digest.iter().fold(String::new(), |text, byte| format!("{text}{byte:02x}"));
        let _ = writeln!(hashes, "{hex} {}", file.file_name().display());
    }
    for backend in ["cpu ", "gpu "] {
        let made = files.iter().any(|file| file.file_name().to_string_lossy().starts_with(backend));
        ensure!(made, "no {backend}picture was made; a GPU's need a driver, and software Vulkan will do");
    }
    for (name, code) in &failed {
        let _ = writeln!(hashes, "exit {code} {name}");
    }
    let path = out.join(HASHES);
    write(&path, hashes).with_context(|| path.display().to_string())?;
    println!("{} runs, {} outputs, {} runs without one: {}", cases.len(), files.len(), failed.len(), path.display());
    Ok(())
}

/// Runs the program, and returns its exit code; messages are not kept.
fn run_case(program: &Path, data: &Path, out: &Path, case: &Case) -> Result<i32> {
    let mut command = Command::new(program);
    command.current_dir(data).args(&case.arguments).env("NODEVICE_SELECT", "1");
    for extension in case.extensions {
        command.args(case.output_flag).arg(out.join(format!("{}.{extension}", case.name)));
    }
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let status = command.status().with_context(|| program.display().to_string())?;
    status.code().with_context(|| format!("{}: {status}", case.name))
}

/// The list, in a fixed order.
fn cases(data: &Path) -> Result<Vec<Case>> {
    let mut inputs: Vec<String> = SCENES.map(str::to_owned).to_vec();
    let mut files = Vec::new();
    collect(data, Path::new(""), &mut files)?;
    inputs.extend(files);
    for varied in VARIED.iter().chain(MOVING.iter().map(|(input, _)| input)) {
        let there = varied.starts_with("scene:") || data.join(varied).exists();
        ensure!(there, "{} is not below {}", varied, data.display());
    }
    let mut cases = Vec::new();
    for backend in ["cpu", "gpu"] {
        for input in &inputs {
            cases.push(picture(input, backend, "", &["png"]));
            cases.push(picture(input, backend, "--supersample 1", &["exr", "png"]));
        }
        for input in VARIED.iter().take(if backend == "gpu" { VARIED_ON_GPU } else { VARIED.len() }) {
            let engines = if backend == "gpu" { &GPU_ENGINES[..] } else { &[] };
            for settings in SETTINGS.iter().chain(engines) {
                cases.push(picture(input, backend, &format!("{settings} --supersample 1"), &["png"]));
            }
        }
        for (input, settings) in MOVING {
            cases.push(picture(input, backend, settings, &["png"]));
        }
    }
    for input in inputs.iter().filter(|input| !input.starts_with("scene:cathedral")) {
        let name = format!("normals {}", plain(input));
        let arguments = ["normals", input, "--quiet"].map(str::to_owned).to_vec();
        cases.push(Case { name, arguments, output_flag: None, extensions: &["ply"] });
    }
    Ok(cases)
}

fn picture(input: &str, backend: &str, settings: &str, extensions: &'static [&'static str]) -> Case {
    let name = format!("{backend} {} {}", plain(input), plain(settings)).trim_end().to_owned();
    let mut arguments = vec!["render".to_owned(), input.to_owned()];
    arguments.extend(settings.split_whitespace().map(str::to_owned));
    arguments.extend(["--backend", backend, "--size", SIZE, "--quiet"].map(str::to_owned));
    Case { name, arguments, output_flag: Some("-o"), extensions }
}

/// A text as a part of a file's name.
fn plain(text: &str) -> String {
    text.chars().map(|character| if "/:".contains(character) { '_' } else { character }).collect()
}

/// Every file below `data` that may hold points, and one of each sequence, by its path relative to `data`.
fn collect(data: &Path, folder: &Path, files: &mut Vec<String>) -> Result<()> {
    let mut entries: Vec<_> = read_dir(data.join(folder))?.collect::<Result<_, _>>()?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    let sequence = folder.components().count() > 1
        && SEQUENCES.iter().any(|name| folder.starts_with(name))
        && entries.iter().all(|entry| entry.path().is_file());
    let mut taken = 0;
    for entry in entries {
        let path = folder.join(entry.file_name());
        let extension = path.extension().map(|extension| extension.to_string_lossy().into_owned()).unwrap_or_default();
        if entry.path().is_dir() {
            collect(data, &path, files)?;
        } else if !["md", "conf", "txt"].contains(&extension.as_str())
            && !entry.file_name().to_string_lossy().starts_with("color_")
            && (!sequence || taken == 0)
        {
            let Some(path) = path.to_str() else { bail!("{} is no UTF-8", path.display()) };
            files.push(path.to_owned());
            taken += 1;
        }
    }
    Ok(())
}

fn compare(folders: [&Path; 2]) -> Result<()> {
    let [before, after] = folders.map(|folder| -> Result<BTreeSet<String>> {
        let path = folder.join(HASHES);
        let text = read_to_string(&path).with_context(|| path.display().to_string())?;
        Ok(text.lines().map(str::to_owned).collect())
    });
    let [before, after] = [before?, after?];
    ensure!(!before.is_empty(), "{} has no hashes", folders[0].display());
    let name = |line: &str| line.split_once(' ').map_or(line, |(_, name)| name).to_owned();
    let differing: BTreeSet<String> = before.symmetric_difference(&after).map(|line| name(line)).collect();
    for name in &differing {
        println!("differs: {name}");
    }
    ensure!(differing.is_empty(), "{} of {} outputs differ", differing.len(), before.len());
    let failed = before.iter().filter(|line| line.starts_with("exit ")).count();
    println!("all {} outputs are equal, and {failed} runs end in the same exit code", before.len() - failed);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_missing_or_new_output_is_found() {
        let folders = [(); 4].map(|()| tempfile::tempdir().expect("a folder"));
        let hashes =
            ["aa one.png\nbb two.png\n", "aa one.png\ncc two.png\n", "aa one.png\n", "aa one.png\nbb two.png\n"];
        for (folder, text) in folders.iter().zip(hashes) {
            write(folder.path().join(HASHES), text).expect("written");
        }
        let same = |a: usize, b: usize| compare([folders[a].path(), folders[b].path()]).is_ok();
        assert!(same(0, 3), "equal hashes");
        assert!(!same(0, 1), "a changed output");
        assert!(!same(0, 2), "a missing output");
        assert!(!same(2, 0), "a new output");
    }
}
