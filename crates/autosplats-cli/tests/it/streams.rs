//! `render` of live points.

use std::io::Write as _;
use std::process::{Child, ChildStdin, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common::{Folder, points_ply};
use serde_json::Value;

/// A sheet at a height, as a PLY file.
fn sheet(height: usize) -> String {
    let points: Vec<String> = (0..900).map(|point| format!("{} {} {height}", point % 30, point / 30)).collect();
    points_ply(&points.iter().map(String::as_str).collect::<Vec<_>>())
}

/// Starts `render` with pipes for input and output.
fn start(folder: &Folder, arguments: &[&str]) -> Child {
    let mut command: Command = folder.command(&[&["render"][..], arguments, &["--size", "60x40"]].concat());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts")
}

fn input(child: &mut Child) -> ChildStdin {
    child.stdin.take().expect("a pipe")
}

/// Waits until a file exists.
fn wait_for(folder: &Folder, name: &str) {
    let begun = Instant::now();
    while !folder.path(name).exists() {
        assert!(begun.elapsed() < Duration::from_secs(60), "{name} does not come: {:?}", folder.list());
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn end(child: Child) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = child.wait_with_output().expect("it ends");
    let words = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    (status.code(), words(stdout), words(stderr))
}

#[cfg(unix)]
fn press_ctrl_c(child: &Child) {
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill is there");
    assert!(sent.success(), "it was sent");
}

#[test]
fn each_update_has_a_picture_as_it_comes() {
    let folder = Folder::new();
    let mut child = start(&folder, &["-", "-o", "f_%d.png", "--json"]);
    let mut pipe = input(&mut child);
    for height in 0..3 {
        let file = sheet(height * 5);
        // The file comes in two parts, between which nothing may be shown.
        let (first, rest) = file.split_at(file.len() / 2);
        pipe.write_all(first.as_bytes()).expect("it reads");
        pipe.flush().expect("it reads");
        assert!(!folder.path(&format!("f_{height}.png")).exists(), "half a file is none");
        pipe.write_all(rest.as_bytes()).expect("it reads");
        wait_for(&folder, &format!("f_{height}.png"));
    }
    drop(pipe);
    let (code, stdout, stderr) = end(child);
    assert_eq!(code, Some(0), "it ends with its input: {stderr}");
    assert_eq!(folder.list(), ["f_0.png", "f_1.png", "f_2.png"], "and nothing else");
    assert!(stderr.contains("3 pictures;"), "nothing was dropped: {stderr}");
    let lines: Vec<Value> = stdout.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let told: Vec<_> = lines.iter().map(|line| (line["frame"].as_u64(), line["path"].as_str())).collect();
    assert_eq!(told, [(Some(0), Some("f_0.png")), (Some(1), Some("f_1.png")), (Some(2), Some("f_2.png"))]);
    assert!(folder.read("f_0.png") != folder.read("f_2.png"), "the sheet climbs before a camera that stands still");
}

#[test]
fn rendering_stops_at_the_last_frame() {
    let folder = Folder::new();
    let mut child = start(&folder, &["-", "--frames", "1..2", "-o", "f_%d.png", "--quiet"]);
    let mut pipe = input(&mut child);
    // The command stops reading once it has its pictures.
    while pipe.write_all(sheet(1).as_bytes()).is_ok() && child.try_wait().expect("it runs").is_none() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let (code, _, stderr) = end(child);
    assert_eq!((code, &*stderr), (Some(0), ""), "it has ended by itself");
    assert_eq!(folder.list(), ["f_1.png", "f_2.png"], "the first update was not asked for");
}

#[test]
fn a_pipe_waits_and_nothing_is_dropped() {
    let folder = Folder::new();
    let mut child = start(&folder, &["-", "-o", "f_%d.png"]);
    let mut pipe = input(&mut child);
    for height in 0..60 {
        pipe.write_all(sheet(height).as_bytes()).expect("it reads");
    }
    pipe.write_all(b"this is no file\n").expect("it reads");
    drop(pipe);
    let (code, _, stderr) = end(child);
    assert_eq!(code, Some(0), "{stderr}");
    assert_eq!(folder.list().len(), 60, "each has its picture");
    assert!(stderr.contains("60 pictures, 1 refused;"), "{stderr}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_it_and_leaves_whole_files() {
    let folder = Folder::new();
    let mut child = start(&folder, &["-", "-o", "f_%d.png"]);
    let mut pipe = input(&mut child);
    pipe.write_all(sheet(0).as_bytes()).expect("it reads");
    wait_for(&folder, "f_0.png");
    pipe.write_all(&sheet(1).as_bytes()[..500]).expect("it reads");
    press_ctrl_c(&child);
    let (code, _, stderr) = end(child);
    assert_eq!(code, Some(0), "what was asked for is done: {stderr}");
    assert_eq!(folder.list(), ["f_0.png"], "and no part of another");
    assert!(stderr.contains("1 picture;"), "{stderr}");

    let mut child = start(&folder, &["-", "-o", "g_%d.png"]);
    // The pipe stays open, since its end would also end the command.
    let _pipe = input(&mut child);
    std::thread::sleep(Duration::from_millis(500));
    press_ctrl_c(&child);
    let (code, _, stderr) = end(child);
    assert_eq!(code, Some(130), "nothing was made: {stderr}");
}

#[cfg(unix)]
#[test]
fn a_film_of_what_is_live_takes_as_long_as_it_took() {
    let folder = Folder::new();
    let path = folder.with_ffmpeg(crate::common::STORE_INPUT);
    let mut command = folder.command(&["render", "-", "-o", "f.mp4", "--size", "40x30", "--json"]);
    command.env("PATH", path).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("it starts");
    let mut pipe = input(&mut child);
    let begun = Instant::now();
    for (height, milliseconds) in [(0, 2000), (9, 600)] {
        pipe.write_all(sheet(height).as_bytes()).expect("it reads");
        std::thread::sleep(Duration::from_millis(milliseconds));
    }
    assert!(!folder.path("f.mp4").exists(), "it is not there before it is whole");
    press_ctrl_c(&child);
    let (code, stdout, stderr) = end(child);
    let took = begun.elapsed().as_secs_f64();
    assert_eq!(code, Some(0), "that ends a film as well: {stderr}");
    let lines: Vec<Value> = stdout.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let shown: Vec<u64> = lines.iter().filter_map(|line| line["pictures"].as_u64()).collect();
    let all: u64 = shown.iter().sum();
    assert_eq!(folder.read("f.mp4").len() as u64, all * 40 * 30 * 4, "as many as are told of");
    // 2.6 s are 78 pictures, minus the delay of the first picture on a busy machine.
    assert!(shown.len() == 2 && all >= 30 && all as f64 <= 30.0 * took + 2.0, "{shown:?} in {took} s");
}

#[cfg(unix)]
#[test]
fn a_film_of_a_pipe_has_as_many_frames_a_second_as_are_asked_for() {
    let folder = Folder::new();
    let path = folder.with_ffmpeg(crate::common::STORE_INPUT);
    let mut command = folder.command(&["render", "-", "-o", "f.mp4", "--fps", "20", "--size", "40x30", "--json"]);
    command.env("PATH", path).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("it starts");
    let mut pipe = input(&mut child);
    for height in 0..5 {
        pipe.write_all(sheet(height).as_bytes()).expect("it reads");
        std::thread::sleep(Duration::from_millis(150));
    }
    drop(pipe);
    let (code, stdout, stderr) = end(child);
    assert_eq!(code, Some(0), "{stderr}");
    assert_eq!(folder.read("f.mp4").len(), 5 * 40 * 30 * 4, "each once, whenever they came");
    let seconds = stdout.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON")["seconds"].clone());
    assert_eq!(seconds.collect::<Vec<_>>(), [0.0, 0.05, 0.1, 0.15, 0.2]);
}

#[test]
fn a_folder_that_is_watched_has_a_picture_of_each_new_file() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("scans")).expect("a folder");
    let child = start(&folder, &["scans", "--watch", "--frames", "..1", "-o", "f_%d.png"]);
    folder.write("scans/a.ply", &sheet(0));
    wait_for(&folder, "f_0.png");
    folder.write("scans/b.ply", &sheet(9));
    let (code, _, stderr) = end(child);
    assert_eq!(code, Some(0), "{stderr}");
    assert_eq!(folder.list(), ["f_0.png", "f_1.png", "scans"], "two pictures");
    let into = ["render", "scans", "--watch", "-o", "scans/f_%d.png"];
    folder.fail(&into, 2, &["scans/f_0.png", "watched", "another"]);
    folder.fail(&["render", "scans/*.ply", "--watch", "-o", "f_%d.png"], 2, &["--watch", "pattern"]);
    folder.fail(&["render", "scene:statue:1K", "--watch", "-o", "f_%d.png"], 2, &["--watch", "scene:statue:1K"]);
}

/// A frame of a depth camera that sees nothing yet.
fn blind() -> String {
    points_ply(&["nan nan nan"; 5])
}

#[test]
fn first_frames_without_points_are_waited_out() {
    let folder = Folder::new();
    for (kinds, words) in [
        (vec![blind(), sheet(0)], "1 picture, 1 without points came first;"),
        (vec![points_ply(&[]), blind(), sheet(0), blind(), sheet(1)], "3 pictures, 2 without points came first;"),
    ] {
        let mut child = start(&folder, &["-", "-o", "f_%d.png"]);
        let mut pipe = input(&mut child);
        kinds.iter().for_each(|file| pipe.write_all(file.as_bytes()).expect("it reads"));
        drop(pipe);
        let (code, _, stderr) = end(child);
        assert!(code == Some(0) && stderr.contains(words), "{stderr}");
    }
    let mut child = start(&folder, &["-", "-o", "still.png"]);
    input(&mut child).write_all((blind() + &sheet(0)).as_bytes()).expect("it reads");
    let (code, _, stderr) = end(child);
    assert_eq!(code, Some(0), "a still takes the first frame with points: {stderr}");
    let mut child = start(&folder, &["-", "-o", "none.png"]);
    input(&mut child).write_all(blind().as_bytes()).expect("it reads");
    let (code, _, stderr) = end(child);
    assert!(code == Some(3) && stderr.contains("error: -: "), "there are none: {stderr}");
}

#[test]
fn a_watched_file_without_points_is_waited_for() {
    let folder = Folder::new();
    folder.write("a.ply", &blind());
    let child = start(&folder, &["a.ply", "--watch", "--frames", "0", "-o", "f_%d.png"]);
    std::thread::sleep(Duration::from_millis(500));
    folder.write("a.ply", &sheet(0));
    let (code, _, stderr) = end(child);
    assert_eq!((code, folder.path("f_0.png").exists()), (Some(0), true), "{stderr}");
}

#[test]
fn streams_that_show_nothing_say_so() {
    let folder = Folder::new();
    folder.fail(&["render", "-", "-o", "f_%d.png"], 3, &["no points arrived"]);
    let mut child = start(&folder, &["-", "-o", "f_%d.png"]);
    input(&mut child).write_all(b"1 2 3\n4 5 6\n7 8 9\n").expect("it reads");
    let (code, _, stderr) = end(child);
    let last = stderr.lines().last().unwrap_or_default();
    assert!(code == Some(3) && last.contains("is neither PLY nor PCD"), "of another format: {stderr}");
    folder.fail(&["render", "-", "--resume", "-o", "f_%d.png"], 2, &["--resume", "live"]);
    std::fs::create_dir(folder.path("scans")).expect("a folder");
    folder.write("scans/a.ply", &sheet(0));
    folder.write("scans/b.ply", &sheet(1));
    folder.fail(&["render", "-", "scans", "-o", "f_%d.png"], 2, &["scans", "timeline"]);
}
