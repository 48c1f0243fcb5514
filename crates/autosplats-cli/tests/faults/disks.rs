//! Disks that are full, or fill while a command works, and inputs that change meanwhile.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};
#[cfg(target_os = "linux")]
use std::{fs::File, io::Write as _, path::Path, process::Child};

use crate::common::{Folder, left_out};
#[cfg(target_os = "linux")]
use crate::send;
use crate::{Ended, ended, jobs, start, with_points};

/// A small file system, unmounted when dropped.
struct Disk(PathBuf);

impl Disk {
    /// `None` where none can be mounted.
    fn mount(folder: &Folder, name: &str, size: &str) -> Option<Self> {
        let place = folder.path(name);
        fs::create_dir(&place).expect("a folder");
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", &format!("size={size}"), "none"]).arg(&place).stderr(Stdio::null());
        let mounted = mount.status().is_ok_and(|status| status.success());
        if !mounted {
            left_out("a small disk", "no file system can be mounted here");
        }
        mounted.then_some(Self(place))
    }

    /// Another file takes all that is free.
    #[cfg(target_os = "linux")]
    fn fill(&self) {
        let mut file = File::create(self.0.join("filler")).expect("a file");
        while file.write_all(&[1; 1 << 16]).is_ok() {}
        while file.write_all(&[1; 512]).is_ok() {}
    }

    fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.0).expect("a folder");
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect()
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

/// Waits until the command has a file open in a folder, whose name may be gone, and stops it there. False if it has
/// ended.
#[cfg(target_os = "linux")]
fn stops_with_a_file(child: &mut Child, folder: &Path) -> bool {
    let open = PathBuf::from(format!("/proc/{}/fd", child.id()));
    while child.try_wait().expect("it can be waited for").is_none() {
        let entries = fs::read_dir(&open).into_iter().flatten().flatten();
        if entries.filter_map(|entry| fs::read_link(entry.path()).ok()).any(|path| path.starts_with(folder)) {
            send("STOP", child);
            return true;
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    false
}

/// Fails unless the command has ended with this code and one line, which has these words.
fn assert_failed(end: &Ended, code: i32, words: &[&str], what: &[&str]) {
    let errors: Vec<&str> = end.stderr.lines().filter(|line| line.starts_with("error: ")).collect();
    assert!(end.code == Some(code) && errors.len() == 1, "{what:?}: {end:?}");
    assert!(words.iter().all(|word| errors[0].contains(word)), "{what:?}: {words:?} are not in {}", errors[0]);
}

#[test]
fn a_full_disk_is_an_error() {
    let folder = with_points();
    let Some(disk) = Disk::mount(&folder, "disk", "64k") else { return };
    for (arguments, outputs) in jobs() {
        let on_disk = |word: &&str| outputs.contains(word) || word.starts_with("f_");
        let placed: Vec<String> =
            arguments.iter().map(|word| if on_disk(word) { format!("disk/{word}") } else { (*word).into() }).collect();
        let placed: Vec<&str> = placed.iter().map(String::as_str).collect();
        folder.succeed(&arguments);
        outputs.iter().for_each(|name| fs::write(disk.0.join(name), "").expect("there is room for that"));
        let end = ended(start(&folder, &placed));
        assert_failed(&end, 4, &[], &placed);
        for name in &outputs {
            let found = fs::read(disk.0.join(name)).expect("it is there");
            assert!(found.is_empty() || found == folder.read(name), "{placed:?}: {name} is neither old nor whole");
        }
        let names = disk.names();
        assert!(names.iter().all(|name| !name.starts_with('.')), "{placed:?}: {names:?}");
        for name in names {
            fs::remove_file(disk.0.join(name)).expect("it is ours");
        }
    }
}

/// Work in parts and octrees: the command, without its output and folder for temporary files.
const WORK: [[&str; 4]; 3] = [
    ["convert", "scan.laz", "--memory", "120M"],
    ["convert", "scan.laz", "--memory", "5M"],
    ["normals", "scan.laz", "--memory", "10M"],
];

#[test]
fn an_output_that_fills_its_disk_is_told() {
    let folder = Folder::new();
    folder.succeed(&["convert", "scene:figure:200K", "scan.laz"]);
    let Some(disk) = Disk::mount(&folder, "disk", "256k") else { return };
    let before = folder.list();
    let [tree, parts, normals] = WORK;
    for (command, output) in [
        (tree, "disk/a.copc.laz"),
        (parts, "disk/a.ply"),
        (parts, "disk/a.e57"),
        (parts, "disk/a.laz"),
        (normals, "disk/a.laz"),
        (normals, "disk/a.copc.laz"),
    ] {
        // The temporary files are on another disk, which has room.
        let arguments = [&command[..], &[output, "--temp", "."]].concat();
        let words = [output, "cannot be written: No space left", "; free some, or write to another disk"];
        assert_failed(&ended(start(&folder, &arguments)), 4, &words, &arguments);
        assert_eq!(disk.names(), [""; 0], "{arguments:?}");
        assert_eq!(folder.list(), before, "{arguments:?}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn temporary_files_that_fill_their_disk_are_told() {
    let folder = Folder::new();
    folder.succeed(&["convert", "scene:figure:200K", "scan.laz"]);
    let Some(disk) = Disk::mount(&folder, "disk", "40m") else { return };
    let before = folder.list();
    let remedy = "name another folder for temporary files";
    for (command, output) in WORK.into_iter().zip(["a.copc.laz", "a.ply", "a.laz"]) {
        let arguments = [&command[..], &[output, "--temp", "disk"]].concat();
        let mut child = start(&folder, &arguments);
        assert!(stops_with_a_file(&mut child, &disk.0), "{arguments:?}: {:?}", ended(child));
        disk.fill();
        send("CONT", &child);
        let words = ["disk: temporary files cannot be kept there: No space left", remedy];
        assert_failed(&ended(child), 4, &words, &arguments);
        assert_eq!(disk.names(), ["filler"], "{arguments:?}");
        assert_eq!(folder.list(), before, "{arguments:?}");

        // What is known beforehand to be too little.
        fs::write(disk.0.join("filler"), vec![1; 37 << 20]).expect("there is room");
        assert_failed(&ended(start(&folder, &arguments)), 4, &["disk: ", "only 3 MiB are free", remedy], &arguments);
        assert_eq!(folder.list(), before, "{arguments:?}");

        // With room, temporary files on another disk than the output change nothing.
        fs::remove_file(disk.0.join("filler")).expect("it is ours");
        folder.succeed(&arguments);
        let elsewhere = folder.read(output);
        folder.succeed(&[&command[..], &[output, "--force"]].concat());
        assert!(folder.read(output) == elsewhere, "{arguments:?}: the same bytes");
        assert_eq!(disk.names(), [""; 0], "{arguments:?}: nothing stays there");
        fs::remove_file(folder.path(output)).expect("it is ours");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn an_input_that_changes_while_an_octree_is_made_is_told() {
    let folder = Folder::new();
    folder.succeed(&["convert", "scene:figure:700K", "scan.laz"]);
    folder.succeed(&["convert", "scan.laz", "scan.ply"]);
    let compressed = Command::new("gzip").args(["-1", "-k"]).arg(folder.path("scan.ply")).status();
    assert!(compressed.expect("gzip is there").success());
    fs::create_dir(folder.path("temp")).expect("a folder");
    let temp = folder.path("temp").canonicalize().expect("a folder");
    let grow = |path: &Path| {
        let mut file = File::options().append(true).open(path).expect("a file");
        file.write_all(b" ").expect("a byte");
    };
    let cut = |path: &Path| File::options().write(true).open(path).expect("a file").set_len(4000).expect("a size");
    let replace = |path: &Path| {
        fs::write(path.with_extension("new"), b"LASF").expect("a file");
        fs::rename(path.with_extension("new"), path).expect("a file");
    };
    for name in ["scan.laz", "scan.ply", "scan.ply.gz"] {
        let whole = folder.read(name);
        folder.succeed(&["convert", name, "whole.copc.laz", "--force"]);
        for (number, change) in [&grow as &dyn Fn(&Path), &cut, &replace].into_iter().enumerate() {
            let arguments = ["convert", name, "a.copc.laz", "--temp", "temp", "--threads", "1"];
            let before = folder.list();
            let mut child = start(&folder, &arguments);
            // The temporary file is made once it is known what the input holds, before its points are read.
            assert!(stops_with_a_file(&mut child, &temp), "{name}: {:?}", ended(child));
            change(&folder.path(name));
            send("CONT", &child);
            let end = ended(child);
            // A file that is open stays as it was, though another has its name.
            if number == 2 && end.code == Some(0) {
                assert!(folder.read("a.copc.laz") == folder.read("whole.copc.laz"), "{name}: the old file");
                fs::remove_file(folder.path("a.copc.laz")).expect("it is ours");
            } else {
                assert_failed(&end, 3, &[name, "changed while it was read; start again"], &arguments);
            }
            assert_eq!(folder.list(), before, "{name}");
            fs::write(folder.path(name), &whole).expect("it is as before");
        }
    }
}
