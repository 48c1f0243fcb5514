//! Faults on purpose: signals at random moments, races for one name, full disks, closed and full pipes, little memory.
//!
//! Whatever happens, an output is whole or absent, the exit code tells the kind of failure, standard error has one line
//! at most, nothing hangs, and no temporary file is left.

#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

#[path = "it/common/mod.rs"]
mod common;
#[path = "faults/disks.rs"]
mod disks;

use std::fs;
use std::os::unix::process::ExitStatusExt as _;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use autosplats_cloud::Random;

use crate::common::{FRONT, Folder, rounds};

/// Longest time from a signal or a fault to the end of the command, on a busy machine.
const ENDS_WITHIN: Duration = Duration::from_secs(5);

/// How a command has ended.
#[derive(Debug)]
struct Ended {
    code: Option<i32>,
    signal: Option<i32>,
    stderr: String,
}

fn ended(child: Child) -> Ended {
    let Output { status, stderr, .. } = child.wait_with_output().expect("it ends");
    let stderr = String::from_utf8(stderr).expect("standard error is UTF-8");
    Ended { code: status.code(), signal: status.signal(), stderr }
}

/// Fails if the command does not end in time.
fn ends_in_time(child: &mut Child, what: &str) {
    let begun = Instant::now();
    while child.try_wait().expect("it can be waited for").is_none() {
        if begun.elapsed() > ENDS_WITHIN {
            let _ = child.kill();
            panic!("{what}: it has not ended after {ENDS_WITHIN:?}");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn start(folder: &Folder, arguments: &[&str]) -> Child {
    spawn(folder.command(arguments))
}

fn spawn(mut command: Command) -> Child {
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it starts")
}

/// Runs the command in a shell that has done `before`, such as setting a limit.
fn start_after(folder: &Folder, before: &str, arguments: &[&str]) -> Child {
    let own = folder.command(arguments);
    let mut shell = Command::new("sh");
    shell.current_dir(folder.path("")).stdin(Stdio::null()).env_remove("RUST_BACKTRACE");
    shell.args(["-c", &format!("{before}; exec \"$0\" \"$@\"")]).arg(own.get_program()).args(own.get_args());
    spawn(shell)
}

fn send(signal: &str, child: &Child) {
    // The command may have ended.
    let _ = Command::new("kill").args([&format!("-{signal}"), &child.id().to_string()]).stderr(Stdio::null()).status();
}

/// Names of temporary files.
fn leftovers(folder: &Folder) -> Vec<String> {
    let names = folder.list().into_iter();
    names.filter(|name| name.starts_with(".autosplats") || name.ends_with(".tmp")).collect()
}

/// Waits until a file exists.
fn wait_for(path: &Path) {
    let begun = Instant::now();
    while !path.exists() {
        assert!(begun.elapsed() < Duration::from_secs(30), "{} does not come", path.display());
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Commands that write files, each with its outputs.
fn jobs() -> Vec<(Vec<&'static str>, Vec<&'static str>)> {
    let picture = |outputs: &[&'static str]| {
        [&["render", "points.ply", "--size", "400x300", "--supersample", "1"], &FRONT[..], outputs].concat()
    };
    vec![
        (vec!["convert", "points.ply", "a.laz", "--force"], vec!["a.laz"]),
        (vec!["convert", "points.ply", "a.copc.laz", "--force"], vec!["a.copc.laz"]),
        (vec!["convert", "points.ply", "a.e57", "--force"], vec!["a.e57"]),
        (vec!["normals", "points.ply", "n.ply", "--force"], vec!["n.ply"]),
        (picture(&["-o", "p.png", "-o", "p.exr", "--save-camera", "p.json"]), vec!["p.png", "p.exr", "p.json"]),
        (
            vec!["render", "scene:figure:20K", "--frames", "0..5", "-o", "f_%d.png", "--size", "200x200"],
            vec!["f_0.png", "f_1.png", "f_2.png", "f_3.png", "f_4.png", "f_5.png"],
        ),
    ]
}

/// A folder with points for the jobs.
fn with_points() -> Folder {
    let folder = Folder::new();
    folder.succeed(&["convert", "scene:statue:60K", "points.ply", "--quiet"]);
    folder
}

fn content(folder: &Folder, names: &[&str]) -> Vec<Vec<u8>> {
    names.iter().map(|name| folder.read(name)).collect()
}

#[test]
fn signals_at_random_moments_leave_whole_files_or_none() {
    // Each signal, and the code that a request to end has.
    let signals = [("INT", Some(130)), ("TERM", Some(143)), ("HUP", Some(129)), ("QUIT", None), ("USR1", None)];
    let mut random = Random::new(20_261_128, 0);
    let mut hit = 0;
    for (arguments, outputs) in (0..rounds()).flat_map(|_| jobs()) {
        let folder = with_points();
        // The day is part of some files.
        let command = || {
            let mut command = folder.command(&arguments);
            command.env("SOURCE_DATE_EPOCH", "1");
            command
        };
        let begun = Instant::now();
        assert_eq!(ended(spawn(command())).code, Some(0), "{arguments:?}");
        let took = begun.elapsed();
        let whole = content(&folder, &outputs);
        for (signal, code) in signals.iter().chain([&("KILL", None)]) {
            outputs.iter().for_each(|name| fs::remove_file(folder.path(name)).unwrap_or_default());
            let mut child = spawn(command());
            std::thread::sleep(took.mul_f64(random.unit()));
            send(signal, &child);
            ends_in_time(&mut child, &format!("{arguments:?} after {signal}"));
            let end = ended(child);
            hit += u64::from(end.code != Some(0));
            let what = format!("{arguments:?} after {signal}: {end:?}");
            match (code, end.code) {
                // It had ended.
                (_, Some(0)) => {}
                // In its first moments it has the system's defaults.
                (Some(code), found) => assert!(found == Some(*code) || end.signal.is_some(), "{what}"),
                (None, found) => assert!(found.is_none(), "{what}"),
            }
            let errors = end.stderr.lines().filter(|line| line.starts_with("error")).count();
            let expected = usize::from(end.code.is_some_and(|code| code != 0));
            assert!(errors == expected && !end.stderr.contains("panicked"), "{what}");
            for (name, whole) in outputs.iter().zip(&whole) {
                assert!(!folder.path(name).exists() || folder.read(name) == *whole, "{name} is not whole: {what}");
            }
            if *signal != "KILL" {
                assert_eq!(leftovers(&folder), [""; 0], "{what}");
            }
        }
        // What was killed has left something at most until now.
        assert_eq!(ended(spawn(command())).code, Some(0), "{arguments:?}");
        assert_eq!(leftovers(&folder), [""; 0], "{arguments:?}");
        assert_eq!(content(&folder, &outputs), whole, "{arguments:?}: the same again");
    }
    assert!(hit > 12 * rounds(), "only {hit} runs were ended by their signal");
}

#[test]
fn what_a_killed_run_has_left_goes_with_the_next() {
    let folder = with_points();
    let mut found = false;
    for _ in 0..20 {
        let mut child = start(&folder, &["convert", "scene:cathedral:2M", "killed.laz"]);
        let begun = Instant::now();
        while leftovers(&folder).is_empty() && begun.elapsed() < Duration::from_secs(20) {
            std::thread::sleep(Duration::from_millis(1));
        }
        send("KILL", &child);
        ends_in_time(&mut child, "KILL");
        found |= !leftovers(&folder).is_empty();
        if found {
            break;
        }
    }
    assert!(found, "a killed run leaves its temporary file");
    folder.succeed(&["convert", "points.ply", "next.ply"]);
    assert_eq!(folder.list(), ["next.ply", "points.ply"], "the next run removes it");
}

#[test]
fn of_runs_that_race_for_a_name_one_wins() {
    let folder = with_points();
    for round in 0..6 * rounds() {
        let name = format!("u{round}.ply");
        let children: Vec<Child> =
            (0..6).map(|_| start(&folder, &["convert", "points.ply", &name, "--quiet"])).collect();
        let ends: Vec<Ended> = children.into_iter().map(ended).collect();
        let won = ends.iter().filter(|end| end.code == Some(0)).count();
        assert_eq!(won, 1, "{ends:?}");
        for end in ends.iter().filter(|end| end.code != Some(0)) {
            assert!(end.code == Some(4) && end.stderr.contains("already exists; --force"), "{end:?}");
        }
    }
    assert_eq!(leftovers(&folder), [""; 0]);
}

#[test]
fn files_that_come_while_a_command_works_stay() {
    let folder = with_points();
    for (command, name) in [("convert", "late.laz"), ("normals", "late.ply")].repeat(rounds() as usize) {
        let _ = fs::remove_file(folder.path(name));
        let child = start(&folder, &[command, "scene:cathedral:1M", name]);
        // Points are read or generated, and the name was free.
        while leftovers(&folder).is_empty() {
            std::thread::sleep(Duration::from_millis(1));
        }
        folder.write(name, "mine");
        let end = ended(child);
        assert!(end.code == Some(4) && end.stderr.contains("already exists"), "{command}: {end:?}");
        assert_eq!(folder.read(name), b"mine", "{command}");
    }
    assert_eq!(leftovers(&folder), [""; 0]);
}

#[test]
fn a_file_too_large_for_its_limit_is_an_error() {
    let folder = with_points();
    for (arguments, outputs) in jobs() {
        outputs.iter().for_each(|name| folder.write(name, "old"));
        if outputs.contains(&"p.json") {
            folder.write("p.json", "");
        }
        // In units of 512 or 1024 bytes.
        let end = ended(start_after(&folder, "ulimit -f 8", &arguments));
        assert_eq!((end.code, end.signal), (Some(4), None), "{arguments:?}: {end:?}");
        let errors = end.stderr.lines().filter(|line| line.starts_with("error: ")).count();
        assert_eq!(errors, 1, "{arguments:?}: {end:?}");
        assert_eq!(leftovers(&folder), [""; 0], "{arguments:?}");
        let first = folder.read(outputs[0]);
        assert!(first == b"old", "{arguments:?}: what was there stays");
    }
}

#[test]
fn messages_that_nobody_reads_cost_nothing() {
    for (arguments, outputs) in jobs() {
        let folder = with_points();
        let mut command = folder.command(&arguments);
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        command.stdout(Stdio::null()).stderr(writer);
        assert_eq!(command.status().expect("it starts").code(), Some(0), "{arguments:?}");
        assert!(outputs.iter().all(|name| folder.path(name).exists()), "{arguments:?}");
    }
    let folder = Folder::new();
    for (arguments, code) in [(&["info", "none.ply"][..], 3), (&["nothing"], 2), (&["render"], 2), (&[], 2)] {
        for closed in ["exec 2>&-", "exec 2>&- >&- <&-"] {
            assert_eq!(ended(start_after(&folder, closed, arguments)).code, Some(code), "{arguments:?}");
        }
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let status = folder.command(arguments).stderr(writer).stdout(Stdio::null()).status();
        assert_eq!(status.expect("it starts").code(), Some(code), "{arguments:?}");
    }
}

#[test]
fn a_full_pipe_of_messages_keeps_nobody_from_ending() {
    let folder = Folder::new();
    let names: Vec<String> = (0..2500).map(|i| format!("a-name-that-makes-the-line-longer-{i}.ply")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    for signals in [&["INT"][..], &["TERM", "TERM"]] {
        let mut command = folder.command(&[&["info"][..], &names].concat());
        let (reader, writer) = std::io::pipe().expect("a pipe");
        let mut child = command.stdout(Stdio::null()).stderr(writer).spawn().expect("it starts");
        drop(command);
        std::thread::sleep(Duration::from_millis(700));
        assert!(child.try_wait().expect("it can be waited for").is_none(), "it waits for its reader");
        for signal in signals {
            send(signal, &child);
            std::thread::sleep(Duration::from_millis(50));
        }
        ends_in_time(&mut child, "a full pipe");
        let code = child.wait().expect("it has ended").code();
        assert_eq!(code, Some(if signals[0] == "INT" { 130 } else { 143 }), "{signals:?}");
        drop(reader);
    }
}

/// Whether a process lives that wrote its number into a file.
fn lives(number: &str) -> bool {
    Command::new("kill").args(["-0", number]).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
}

#[test]
fn a_film_ends_with_the_command_and_ffmpeg_with_it() {
    let scripts = [
        ("reads nothing", "echo $$ > number; for last; do :; done; echo part > \"$last\"; exec sleep 100"),
        ("starts others", "echo $$ > number; sleep 100 & wait"),
        ("reads all", "echo $$ > number; for last; do :; done; cat > \"$last\"; sleep 100"),
    ];
    let mut random = Random::new(20_261_129, 0);
    for (what, script) in scripts.repeat(rounds() as usize) {
        for (signal, code) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
            let folder = Folder::new();
            let path = folder.with_ffmpeg(script);
            let mut command = folder.command(&["render", "scene:figure:2K", "-o", "f.mp4", "--size", "400x300"]);
            command.args(["--frames", "0..40"]).env("PATH", path);
            let mut child = spawn(command);
            wait_for(&folder.path("number"));
            std::thread::sleep(Duration::from_secs_f64(random.unit()));
            send(signal, &child);
            ends_in_time(&mut child, what);
            let end = ended(child);
            assert_eq!(end.code, Some(code), "{what}, {signal}: {end:?}");
            assert_eq!(end.stderr.lines().count(), 1, "{what}, {signal}: {end:?}");
            assert_eq!(folder.list(), ["bin", "number"], "{what}, {signal}: nothing is left");
            let number = String::from_utf8(folder.read("number")).expect("a number");
            let begun = Instant::now();
            while lives(number.trim()) {
                assert!(begun.elapsed() < ENDS_WITHIN, "{what}, {signal}: ffmpeg lives on");
                std::thread::sleep(Duration::from_millis(5));
            }
        }
    }
}

#[test]
fn signals_that_were_ignored_stay_ignored() {
    let folder = with_points();
    for (signal, trap) in [("HUP", "trap '' HUP"), ("INT", "trap '' INT QUIT"), ("TERM", "trap '' TERM")] {
        let arguments = ["convert", "scene:statue:400K", "a.laz", "--force"];
        let mut child = start_after(&folder, trap, &arguments);
        while leftovers(&folder).is_empty() && child.try_wait().expect("it runs").is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        send(signal, &child);
        let end = ended(child);
        assert_eq!(end.code, Some(0), "{signal}: {end:?}");
        assert!(folder.path("a.laz").exists(), "{signal}");
    }
}

#[test]
fn too_little_memory_is_an_error_of_one_line() {
    let folder = with_points();
    let starts = |kilobytes: &u32| {
        let end = ended(start_after(&folder, &format!("ulimit -v {kilobytes}"), &["info", "scene:figure:1K"]));
        end.code == Some(0)
    };
    // The program itself, whose size depends on how it is built.
    let least = (1..).map(|step| step * 8_000).find(starts).expect("it starts at some limit");
    let mut failed = 0;
    let mut random = Random::new(20_261_130, 0);
    for (arguments, outputs) in (0..rounds()).flat_map(|_| jobs()) {
        for most in [1, 4_000, 10_000, 30_000, 200_000] {
            let kilobytes = least + random.modulo(most) as u32;
            outputs.iter().for_each(|name| fs::remove_file(folder.path(name)).unwrap_or_default());
            // One thread, since each has memory for its stack.
            let limited = [&arguments[..], &["--threads", "1"]].concat();
            let end = ended(start_after(&folder, &format!("ulimit -v {kilobytes}"), &limited));
            let what = format!("{limited:?} in {kilobytes} KB: {end:?}");
            assert_eq!(leftovers(&folder), [""; 0], "{what}");
            if end.code == Some(0) {
                continue;
            }
            failed += 1;
            assert_eq!((end.code, end.signal), (Some(6), None), "{what}");
            let errors = end.stderr.lines().filter(|line| !line.starts_with("note: ")).count();
            assert_eq!(errors, 1, "{what}");
        }
    }
    assert!(failed > 5, "only {failed} runs had too little");
}
