//! Octrees in every command, from files and from a server.

use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use autosplats_serve::Server;
use serde_json::Value;

use crate::common::{Folder, data, ply};

const LION: &str = "lion_takanawa.copc.laz";

fn scans() -> Option<PathBuf> {
    Some(data()?.join("scans"))
}

/// The report of `render --json` with these arguments, which write a picture.
fn report(folder: &Folder, arguments: &[&str]) -> Value {
    let usual = ["render", "--json", "--size", "240x180", "--supersample", "1", "--backend", "cpu"];
    serde_json::from_str(&folder.succeed(&[&usual[..], arguments].concat()).stdout).expect("JSON")
}

/// Root of the mean square difference of two pictures, of 255.
fn difference(folder: &Folder, a: &str, b: &str) -> f64 {
    let [a, b] = [a, b].map(|name| image::open(folder.path(name)).expect("a picture").to_rgb8());
    assert_eq!(a.dimensions(), b.dimensions(), "one size");
    let squares = a.as_raw().iter().zip(b.as_raw()).map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2));
    (squares.sum::<f64>() / a.as_raw().len() as f64).sqrt()
}

#[test]
fn a_picture_needs_a_part_of_the_points_and_looks_like_all() {
    let Some(scans) = scans() else { return };
    let (folder, lion) = (Folder::new(), scans.join(LION).display().to_string());
    let whole = report(&folder, &[&lion, "-o", "whole.png", "--save-camera", "cam.json"]);
    assert!(whole.get("tree").is_none(), "few points are read whole: {whole}");
    let camera = ["--camera", "cam.json"];
    let mut points = Vec::new();
    for (detail, most) in [("4", 16.0), ("1", 5.0), ("0.2", 4.0)] {
        let name = format!("{detail}.png");
        let report = report(&folder, &[&[&lion, "-o", &name, "--detail", detail], &camera[..]].concat());
        let tree = &report["tree"];
        assert_eq!(tree["stored_points"], 341_989);
        assert!(tree["spacing_px"].as_f64().is_some_and(|px| px <= detail.parse::<f64>().expect("a number")), "{tree}");
        assert_eq!(report["counts"]["points"], tree["points"], "all that is loaded is drawn");
        points.push(tree["points"].as_u64().expect("a number"));
        let off = difference(&folder, "whole.png", &name);
        assert!(off < most, "{detail} pixels: off by {off}");
    }
    assert!(points.is_sorted() && points[0] < points[2], "a finer picture has more points: {points:?}");
    assert_eq!(points[2], 341_989, "the finest needs all");
}

#[test]
fn pictures_are_the_same_however_points_come() {
    let Some(scans) = scans() else { return };
    let folder = Folder::new();
    let server = Server::start(scans.clone(), Duration::from_millis(5)).expect("a server");
    let (near, far) = (scans.join(LION).display().to_string(), server.address(LION));
    let detail = ["--detail", "1"];
    let local = report(&folder, &[&[&near, "-o", "near.png", "--threads", "1"], &detail[..]].concat());
    let remote = report(&folder, &[&[&far, "-o", "far.png", "--threads", "4"], &detail[..]].concat());
    assert_eq!(folder.read("near.png"), folder.read("far.png"), "a file and an address");
    assert_eq!(local["tree"]["points"], remote["tree"]["points"]);
    let (requests, bytes) = (remote["tree"]["requests"].as_u64(), remote["tree"]["bytes"].as_u64());
    let counts = server.counts();
    assert_eq!(requests, Some(counts.requests), "requests are counted");
    assert!(requests.is_some_and(|requests| requests <= 12), "few are needed: {requests:?}");
    let size = fs::metadata(scans.join(LION)).expect("a file").len();
    assert!(bytes.is_some_and(|bytes| bytes <= size + (128 << 10)), "nothing is read twice: {bytes:?} of {size}");
}

#[test]
fn limits_make_pictures_coarser_and_say_so() {
    let Some(scans) = scans() else { return };
    let (folder, lion) = (Folder::new(), scans.join(LION).display().to_string());
    let limited = ["render", &lion, "-o", "a.png", "--size", "400x300", "--detail", "0.5", "--points-budget", "100K"];
    let outcome = folder.succeed(&limited);
    assert!(outcome.stderr.contains("pixels apart; a larger --points-budget"), "{}", outcome.stderr);
    let few = report(&folder, &[&lion, "-o", "few.png", "--points-budget", "100K"]);
    assert!(few["tree"]["points"].as_u64().is_some_and(|points| points <= 100_000), "a budget alone: {few}");
    folder.fail(&["render", &lion, "-o", "b.png", "--detail", "1", "--memory", "1M"], 2, &["--memory", "at least"]);
    // Little memory is no reason to fail while a picture without supersampling fits.
    let tight = ["render", &lion, "-o", "c.png", "--size", "800x600", "--detail", "1", "--memory", "300M"];
    folder.succeed(&tight);
    folder.fail(&[&tight[..], &["--supersample", "2"]].concat(), 2, &["--memory", "at least"]);
    for wrong in ["-1", "nan", "x"] {
        folder.fail(&["render", &lion, "-o", "b.png", "--detail", wrong], 2, &["--detail", "pixels"]);
    }
    folder.fail(&["render", &lion, "-o", "b.png", "--detail", "1", "--color", "Beauty"], 2, &["Beauty", "Intensity"]);
    assert_eq!(folder.list(), ["a.png", "c.png", "few.png"], "nothing else is written");
}

#[test]
fn colours_of_values_come_from_nodes() {
    let Some(scans) = scans() else { return };
    let (folder, star) = (Folder::new(), scans.join("lone_star.copc.laz").display().to_string());
    report(&folder, &[&star, "-o", "whole.png", "--color", "intensity", "--save-camera", "cam.json"]);
    report(&folder, &[&star, "-o", "part.png", "--color", "intensity", "--camera", "cam.json", "--detail", "0.1"]);
    let off = difference(&folder, "whole.png", "part.png");
    assert!(off < 1.5, "off by {off}");
}

#[test]
fn parts_are_converted_without_the_rest() {
    let Some(scans) = scans() else { return };
    let folder = Folder::new();
    let server = Server::start(scans.clone(), Duration::ZERO).expect("a server");
    let (near, far) = (scans.join(LION).display().to_string(), server.address(LION));
    let info: Value = serde_json::from_str(&folder.succeed(&["info", "--json", &near]).stdout).expect("JSON");
    let corner = |name: &str| -> Vec<f64> { serde_json::from_value(info["bounds"][name].clone()).expect("numbers") };
    let (low, high) = (corner("min"), corner("max"));
    let middle: Vec<f64> = low.iter().zip(&high).map(|(a, b)| 0.5 * (a + b)).collect();
    let bounds = [&low[..], &middle[..]].concat().iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    for (name, from) in [("whole.ply", &*near), ("near.ply", &near), ("far.ply", &far)] {
        let whole = if name == "whole.ply" {
            folder.succeed(&["convert", &near, "all.las"]);
            "all.las"
        } else {
            from
        };
        folder.succeed(&["convert", whole, name, "--bounds", &bounds]);
    }
    let count = |name: &str| {
        let report: Value =
            serde_json::from_str(&folder.succeed(&["info", "--json", "--scan", name]).stdout).expect("JSON");
        (report["points"].as_u64().expect("a number"), report["bounds"].clone())
    };
    let whole = count("whole.ply");
    assert!(whole.0 > 1000, "{whole:?}");
    assert_eq!(count("near.ply"), whole, "a part of the tree");
    assert_eq!(folder.read("far.ply"), folder.read("near.ply"), "from a server as well");
    folder.succeed(&["convert", &near, "coarse.ply", "--spacing", "1e9"]);
    let root = count("coarse.ply").0;
    assert!(root > 10_000 && root < 60_000, "the root alone: {root}");
    folder.fail(&["convert", "whole.ply", "b.ply", "--spacing", "1"], 3, &["whole.ply", "no octree", "--voxel"]);
    let beside = "1e7,1e7,1e7,2e7,2e7,2e7";
    folder.fail(&["convert", &near, "b.ply", "--bounds", beside], 3, &["none of the 341989 points", "--bounds"]);
    folder.succeed(&["normals", &far, "n.ply", "--bounds", &bounds]);
    assert_eq!(count("n.ply").0, whole.0, "normals of the same part");
}

#[test]
fn addresses_are_described_and_read() {
    let Some(scans) = scans() else { return };
    let folder = Folder::new();
    let server = Server::start(scans.clone(), Duration::ZERO).expect("a server");
    let near = scans.join(LION).display().to_string();
    let describe = |name: &str| {
        let mut report: Value = serde_json::from_str(&folder.succeed(&["info", "--json", name]).stdout).expect("JSON");
        for own in ["input", "file_bytes"] {
            report.as_object_mut().expect("an object").remove(own);
        }
        report
    };
    let before = server.counts().bytes;
    assert_eq!(describe(&server.address(LION)), describe(&near));
    assert!(server.counts().bytes - before < 200_000, "the points are not read");
    folder.fail(&["info", &server.address("no.copc.laz")], 3, &["no.copc.laz", "404"]);
    folder.fail(&["render", &server.address("no.copc.laz"), "-o", "a.png"], 3, &["no.copc.laz", "404"]);
    folder.fail(&["render", "https://", "-o", "a.png"], 3, &["https://"]);
    // What is no octree is read whole.
    folder.write("a.xyz", "0 0 0\n1 0 0\n0 1 0\n");
    let own = Server::start(folder.path(""), Duration::ZERO).expect("a server");
    folder.succeed(&["convert", &own.address("a.xyz"), "b.ply"]);
    assert!(folder.list().contains(&"b.ply".to_owned()));
}

#[test]
fn a_camera_flies_through_views() {
    let Some(scans) = scans() else { return };
    let (folder, lion) = (Folder::new(), scans.join(LION).display().to_string());
    let size = ["--size", "120x90", "--backend", "cpu"];
    for (view, name) in [("front", "a.json"), ("right", "b.json")] {
        let still = ["render", &lion, "-o", "still.png", "--view", view, "--save-camera", name, "--supersample", "1"];
        folder.succeed(&[&still[..], &size].concat());
    }
    fs::remove_file(folder.path("still.png")).expect("a picture");
    let path = ["--camera-path", "a.json,b.json", "--duration", "1s", "--fps", "4", "--json"];
    for detail in ["0", "2"] {
        let name = format!("{detail}_%d.png");
        let fly = ["render", &lion, "-o", &name, "--detail", detail];
        let lines = folder.succeed(&[&fly[..], &path, &size].concat()).stdout;
        let reports: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
        assert_eq!(reports.len(), 5, "both ends are shown");
        assert_eq!(
            reports.iter().filter(|report| report.get("tree").is_some()).count(),
            if detail == "2" { 5 } else { 0 }
        );
    }
    for frame in 0..5 {
        let off = difference(&folder, &format!("0_{frame}.png"), &format!("2_{frame}.png"));
        assert!(off < 20.0, "frame {frame} is off by {off}");
    }
    assert_ne!(folder.read("0_0.png"), folder.read("0_4.png"));
    // A frame is the same alone.
    folder.succeed(&[&["render", &lion, "-o", "one.png", "--detail", "2", "--frames", "3"], &path[..], &size].concat());
    assert_eq!(folder.read("one.png"), folder.read("2_3.png"));
    let refused = |arguments: &[&str], words: &[&str]| folder.fail(&[&["render", &lion], arguments].concat(), 2, words);
    refused(&["-o", "x.png", "--camera-path", "a.json,b.json"], &["--camera-path", "film"]);
    refused(&["-o", "x_%d.png", "--camera-path", "a.json"], &["--camera-path", "two"]);
    refused(&["-o", "x_%d.png", "--camera-path", "a.json,no.json"], &["no.json"]);
}

/// Writes EPT of one node, `node.laz` of the folder, whose points are in the box from 0 to 1000.
fn write_ept(folder: &Folder, points: usize) {
    for part in ["ept/ept-data", "ept/ept-hierarchy"] {
        fs::create_dir_all(folder.path(part)).expect("a folder");
    }
    fs::rename(folder.path("node.laz"), folder.path("ept/ept-data/0-0-0-0.laz")).expect("a file");
    let coordinate = |name| serde_json::json!({"name": name, "size": 4, "type": "signed", "scale": 0.001, "offset": 0});
    let class = serde_json::json!({"name": "Classification", "size": 1, "type": "unsigned"});
    let bounds = [0, 0, 0, 1000, 1000, 1000];
    let described = serde_json::json!({
        "bounds": bounds, "boundsConforming": bounds, "dataType": "laszip", "hierarchyType": "json", "points": points,
        "schema": [coordinate("X"), coordinate("Y"), coordinate("Z"), class], "span": 128, "version": "1.0.0",
    });
    folder.write("ept/ept.json", &described.to_string());
    folder.write("ept/ept-hierarchy/0-0-0-0.json", &serde_json::json!({"0-0-0-0": points}).to_string());
}

/// Writes an octree of Potree of one node, whose points, in the box from 0 to 1000, have a class each.
fn write_potree(folder: &Folder, points: &[([f64; 3], u8)]) {
    let attribute = |name, kind, size, count| serde_json::json!({"name": name, "type": kind, "size": size, "numElements": count, "elementSize": size / count});
    let described = serde_json::json!({
        "version": "2.0", "points": points.len(), "encoding": "DEFAULT", "projection": "", "spacing": 8,
        "hierarchy": {"firstChunkSize": 22, "stepSize": 4, "depth": 0}, "offset": [0, 0, 0],
        "scale": [0.001, 0.001, 0.001], "boundingBox": {"min": [0, 0, 0], "max": [1000, 1000, 1000]},
        "attributes": [attribute("position", "int32", 12, 3), attribute("classification", "uint8", 1, 1)],
    });
    let record = |(at, class): &([f64; 3], u8)| {
        let stored = at.map(|along| ((along * 1000.0).round() as i32).to_le_bytes());
        [stored.as_flattened(), &[*class]].concat()
    };
    let nodes: Vec<u8> = points.iter().flat_map(record).collect();
    let count = (points.len() as u32).to_le_bytes();
    let node = [&[1, 0][..], &count, &[0; 8], &(nodes.len() as u64).to_le_bytes()].concat();
    fs::create_dir_all(folder.path("potree")).expect("a folder");
    folder.write("potree/metadata.json", &described.to_string());
    fs::write(folder.path("potree/hierarchy.bin"), node).expect("written");
    fs::write(folder.path("potree/octree.bin"), nodes).expect("written");
}

#[test]
fn points_that_are_left_out_of_octrees_are_told() {
    let folder = Folder::new();
    let wall = (0..400).map(|i| ([f64::from(i % 20), 0.1 * f64::from(i % 7), f64::from(1 + i / 20)], 2));
    let noise = (0..40).map(|i| ([0.1 * f64::from(i % 5), 0.0, 900.0 + 0.1 * f64::from(i / 5)], 7));
    let points: Vec<([f64; 3], u8)> = wall.chain(noise).collect();
    let columns = ["float x", "float y", "float z", "uchar classification"];
    let row = |([x, y, z], class): &([f64; 3], u8)| format!("{x} {y} {z} {class}");
    folder.write("wall.ply", &ply(&columns, points.iter().map(row)));
    folder.succeed(&["convert", "wall.ply", "node.laz"]);
    write_ept(&folder, points.len());
    write_potree(&folder, &points);
    let server = Server::start(folder.path(""), Duration::ZERO).expect("a server");
    let addresses = ["ept/ept.json", "potree/metadata.json"].map(|name| server.address(name));
    for name in ["ept", "ept/ept.json", "potree", "potree/metadata.json", &addresses[0], &addresses[1]] {
        let picture = |more: &[&str]| {
            let usual = ["render", name, "-o", "a.png", "--size", "64x48", "--supersample", "1", "--detail", "1"];
            folder.succeed(&[&usual[..], more].concat()).stderr
        };
        let usual = picture(&[]);
        assert!(usual.contains("left out 40 of 440 points") && usual.contains("400 points"), "{name}: {usual}");
        let all = picture(&["--keep", "all"]);
        assert!(all.contains("440 points") && !all.contains("left out"), "{name}: {all}");
        let noise = picture(&["--keep", "7"]);
        assert!(noise.contains("--keep 7 left out 400 of 440 points"), "{name}: {noise}");
        folder.fail(
            &["render", name, "-o", "b.png", "--detail", "1", "--keep", "9"],
            3,
            &["--keep 9", "none of its 440"],
        );
        let number = |name: &str| {
            let info = folder.succeed(&["info", "--json", name]).stdout;
            serde_json::from_str::<Value>(&info).expect("JSON")["points"].as_u64()
        };
        for (command, output) in [("convert", "again.copc.laz"), ("convert", "again.las"), ("normals", "again.ply")] {
            folder.succeed(&[command, name, output, "--memory", "500M", "--force"]);
            assert_eq!(number(output), Some(440), "{name}: {command} {output}");
        }
        assert_eq!(number(name), Some(440), "{name}");
    }
    let ignored = folder.succeed(&["render", "wall.ply", "-o", "a.png", "--size", "64x48", "--detail", "1"]).stderr;
    assert!(ignored.contains("--detail and --points-budget are ignored"), "{ignored}");
}
