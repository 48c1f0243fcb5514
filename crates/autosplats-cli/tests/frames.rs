//! What `render` makes of points that move.

mod common;

use common::{Folder, Outcome};
use serde_json::Value;

/// A folder of `sweep`, four frames of a sheet that climbs, and whatever else is put there.
fn folder() -> Folder {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("sweep")).expect("a folder");
    for frame in 0..4 {
        let points = (0..900).map(|point| format!("{} {} {}", point % 30, point / 30, frame * 4));
        let rows: Vec<String> = points.collect();
        folder.write(&format!("sweep/scan_{frame}.xyz"), &rows.join("\n"));
    }
    folder
}

fn render(folder: &Folder, options: &[&str]) -> Outcome {
    folder.succeed(&[&["render", "sweep", "--size", "120x90", "--quiet"][..], options].concat())
}

fn pictures(folder: &Folder) -> Vec<String> {
    folder.list().into_iter().filter(|name| name.contains(".png")).collect()
}

#[test]
fn each_frame_has_a_picture() {
    let folder = folder();
    render(&folder, &["-o", "f_%02d.png"]);
    assert_eq!(pictures(&folder), ["f_00.png", "f_01.png", "f_02.png", "f_03.png"], "and nothing else");
    let files: Vec<_> = pictures(&folder).iter().map(|name| folder.read(name)).collect();
    assert!(files.windows(2).all(|pair| pair[0] != pair[1]), "the sheet climbs before a camera that stands still");
    render(&folder, &["-o", "again_%02d.png"]);
    assert_eq!(files[3], folder.read("again_03.png"), "the same frames are the same pictures");
}

#[test]
fn frames_are_chosen_and_numbered_as_they_are() {
    let folder = folder();
    render(&folder, &["--frames", "1..2", "-o", "f.png"]);
    assert_eq!(pictures(&folder), ["f_00001.png", "f_00002.png"], "both ends are included");
    folder.fail(&["render", "sweep", "--frames", "2..4", "-o", "f.png"], 2, &["sweep", "4 frames", "0 to 3"]);
    folder.fail(&["render", "sweep", "--frames", "3..2", "-o", "f.png"], 2, &["--frames"]);
}

#[test]
fn what_is_there_is_not_made_again() {
    let folder = folder();
    folder.write("f_1.png", "kept");
    render(&folder, &["--resume", "-o", "f_%d.png"]);
    assert_eq!(pictures(&folder).len(), 4, "the others are made");
    assert_eq!(folder.read("f_1.png"), b"kept", "this one was there");
    folder.fail(&["render", "sweep", "--resume", "-o", "f.mp4"], 2, &["--resume", "f_%05d.png"]);
}

#[test]
fn json_tells_each_frame() {
    let folder = folder();
    let out = render(&folder, &["--json", "--fps", "4", "-o", "f_%d.png"]).stdout;
    let lines: Vec<Value> = out.lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect();
    let numbers: Vec<_> = lines.iter().map(|line| line["frame"].as_u64()).collect();
    assert_eq!(numbers, [Some(0), Some(1), Some(2), Some(3)]);
    assert_eq!(lines[3]["seconds"], 0.75, "four a second");
    assert_eq!(lines[2]["counts"]["points"], 900);
    assert_eq!(lines[1]["path"], "f_1.png");
}

#[test]
fn a_folder_alone_is_its_first_frame() {
    let folder = folder();
    render(&folder, &["-o", "first.png"]);
    folder.succeed(&["render", "sweep/scan_0.xyz", "--size", "120x90", "--quiet", "-o", "file.png"]);
    assert_eq!(folder.read("first.png"), folder.read("file.png"), "the same as the file");
}

#[test]
fn a_frame_that_cannot_be_read_is_told_and_passed_over() {
    let folder = folder();
    folder.write("sweep/scan_2.xyz", "this is no cloud\n");
    let out = folder.succeed(&["render", "sweep", "--size", "120x90", "-o", "f_%d.png"]);
    assert_eq!(pictures(&folder).len(), 4, "the frame before is shown for it");
    assert_eq!(out.stderr.matches("scan_2.xyz").count(), 1, "told once: {}", out.stderr);
    assert_eq!(folder.read("f_1.png"), folder.read("f_2.png"), "as it was");
}

#[test]
fn scanners_see_a_part_each() {
    let folder = Folder::new();
    let scan = |count: &str| {
        let line =
            ["render", "scene:figure:20K", "--scan", count, "--frames", "0", "--size", "80x60", "--quiet", "--json"];
        let out = folder.succeed(&[&line[..], &["-o", "f.png"]].concat()).stdout;
        let report: Value = serde_json::from_str(&out).expect("JSON");
        report["counts"]["points"].as_u64().expect("a number of points")
    };
    let [one, four] = ["1", "4"].map(scan);
    assert!(one > 1000 && four > 2 * one, "{one} points by one, {four} by four");
    folder.fail(&["render", "scene:figure", "--scan", "5", "-o", "f.png"], 2, &["--scan"]);
}

#[test]
fn a_film_needs_ffmpeg_and_says_so() {
    let folder = folder();
    let mut command = folder.command(&["render", "sweep", "-o", "f.mp4"]);
    let out = command.env("PATH", "").output().expect("it runs");
    assert_eq!(out.status.code(), Some(2), "before anything is rendered");
    let words = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(words.contains("ffmpeg") && words.contains("f_%05d.png"), "what to do: {words}");
    assert!(!folder.path("f.mp4").exists(), "and nothing is left");
}
