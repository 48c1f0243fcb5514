//! `--keep` in every command.

use crate::common::{Folder, data, ply};

/// A wall of ground and building, and a speck of noise far above it: the file's points and how many are noise.
fn wall(classes: &str) -> String {
    let wall = (0..400)
        .map(|i| format!("{} {} {} {}", i % 20, 0.1 * f64::from(i % 7), 1 + i / 20, if i < 200 { 2 } else { 6 }));
    let noise = (0..40).map(|i| format!("{} 0 {} 7", 0.1 * f64::from(i % 5), 900.0 + 0.1 * f64::from(i / 5)));
    ply(&["float x", "float y", "float z", &format!("uchar {classes}")], wall.chain(noise))
}

/// Number of points and height of the cloud, by `info`.
fn measured(folder: &Folder, arguments: &[&str]) -> (u64, f64) {
    let outcome = folder.succeed(&[&["info", "--json", "--scan"], arguments].concat());
    let report: serde_json::Value = serde_json::from_str(&outcome.stdout).expect("JSON");
    (report["points"].as_u64().expect("a number"), report["bounds"]["size"][2].as_f64().expect("a height"))
}

/// Distance of the eye from the centre of a picture.
fn distance(folder: &Folder, arguments: &[&str]) -> f64 {
    folder.succeed(&[&["render", "-o", "a.png", "--size", "64x48", "--save-camera", "a.json"], arguments].concat());
    let camera: serde_json::Value = serde_json::from_slice(&folder.read("a.json")).expect("JSON");
    let vector = |name: &str| -> Vec<f64> { serde_json::from_value(camera[name].clone()).expect("three numbers") };
    let (eye, aim) = (vector("eye"), vector("look_at"));
    eye.iter().zip(&aim).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

#[test]
fn pictures_leave_noise_out_and_files_keep_it() {
    let folder = Folder::new();
    folder.write("wall.ply", &wall("classification"));
    for name in ["wall.las", "wall.laz", "wall.pcd", "wall.e57", "wall.csv"] {
        folder.succeed(&["convert", "wall.ply", name]);
    }
    for name in ["wall.ply", "wall.las", "wall.laz", "wall.pcd", "wall.e57", "wall.csv"] {
        assert_eq!(measured(&folder, &[name]).0, 440, "{name}: a file keeps its points");
        let outcome = folder.succeed(&["render", name, "-o", "a.png", "--size", "64x48"]);
        let said = format!("{name}: left out 40 of 440 points: 40 low noise (class 7); --keep all keeps them");
        assert_eq!(outcome.stderr.matches(&said).count(), 1, "{name}: {}", outcome.stderr);
        assert!(outcome.stderr.contains("400 points"), "{name}: {}", outcome.stderr);
        let (near, far) = (distance(&folder, &[name]), distance(&folder, &[name, "--keep", "all"]));
        assert!(far > 10.0 * near, "{name}: noise is not framed unless it is drawn: {near} {far}");
        let all = folder.succeed(&["render", name, "-o", "a.png", "--size", "64x48", "--keep", "all"]);
        assert!(all.stderr.contains("440 points") && !all.stderr.contains("left out"), "{name}: {}", all.stderr);
    }
    // A label 7 may be anything.
    folder.write("labels.ply", &wall("label"));
    let outcome = folder.succeed(&["render", "labels.ply", "-o", "a.png", "--size", "64x48"]);
    assert!(!outcome.stderr.contains("left out"), "{}", outcome.stderr);
}

#[test]
fn every_command_takes_some_points_alone() {
    let folder = Folder::new();
    folder.write("wall.ply", &wall("classification"));
    for (keep, points) in
        [("ground", 200), ("ground,building", 400), ("2..6", 400), ("-noise", 400), ("-7", 400), ("-2,-building", 40)]
    {
        assert_eq!(measured(&folder, &["wall.ply", "--keep", keep]).0, points, "info, {keep}");
        folder.succeed(&["convert", "wall.ply", "out.las", "--force", "--keep", keep]);
        let (converted, height) = measured(&folder, &["out.las"]);
        assert_eq!(converted, points, "convert, {keep}");
        assert!(height < 20.0, "its header has the bounds of what is in it: {height}");
        folder.succeed(&["normals", "wall.ply", "out.ply", "--force", "--keep", keep]);
        assert_eq!(measured(&folder, &["out.ply"]).0, points, "normals, {keep}");
        let outcome = folder.succeed(&["render", "wall.ply", "-o", "a.png", "--size", "64x48", "--keep", keep]);
        assert!(outcome.stderr.contains(&format!("{points} points")), "render, {keep}: {}", outcome.stderr);
    }
    let same = ["a", "b"].map(|name| {
        let threads = if name == "a" { "1" } else { "4" };
        let out = format!("{name}.ply");
        folder.succeed(&["convert", "wall.ply", &out, "--keep", "ground", "--threads", threads]);
        folder.read(&out)
    });
    assert_eq!(same[0], same[1], "the same bytes with any number of threads");
}

#[test]
fn several_inputs_and_frames() {
    let folder = Folder::new();
    folder.write("a_1.ply", &wall("classification"));
    folder.write("a_2.ply", &wall("classification").replace(" 2\n", " 6\n"));
    let outcome = folder.succeed(&["convert", "a_1.ply", "a_2.ply", "out.ply", "--keep", "ground"]);
    assert!(outcome.stderr.contains("a_2.ply: --keep ground leaves none of its 440 points"), "{}", outcome.stderr);
    assert_eq!(measured(&folder, &["out.ply"]).0, 200, "of the first");
    folder.fail(
        &["convert", "a_2.ply", "none.ply", "--keep", "ground"],
        3,
        &["a_2.ply", "leaves none of its 440 points"],
    );
    folder.succeed(&["render", "a_*.ply", "-o", "f_%d.png", "--size", "64x48", "--keep", "ground"]);
    assert!(folder.list().contains(&"f_1.png".into()), "a frame without ground is a picture of nothing");
    let outcome = folder.succeed(&["render", "a_*.ply", "-o", "g_%d.png", "--size", "64x48"]);
    assert!(outcome.stderr.contains("left out 40 of 440 points"), "{}", outcome.stderr);
}

#[test]
fn words_that_mean_nothing_are_refused() {
    let folder = Folder::with_sphere();
    folder.write("wall.ply", &wall("label"));
    folder.fail(&["render", "wall.ply", "-o", "a.png", "--keep", "grond"], 2, &["--keep", "grond", "ground"]);
    folder.fail(&["convert", "wall.ply", "a.las", "--keep", "road"], 3, &["leaves none", "2 ground", "6 building"]);
    folder.fail(&["convert", "sphere.ply", "a.las", "--keep", "ground"], 3, &["Classification", "Intensity"]);
    folder.fail(&["render", "scene:statue:1K", "-o", "a.png", "--keep", "ground"], 2, &["scenes have no classes"]);
    folder.succeed(&["render", "scene:statue:1K", "-o", "a.png", "--size", "64x48", "--keep", "all"]);
    folder.succeed(&["render", "sphere.ply", "-o", "a.png", "--size", "64x48"]);
}

#[test]
fn classes_and_flags_are_listed() {
    let folder = Folder::new();
    let rows = (0..30).map(|i| format!("{i} 0 0 {} {}", if i < 10 { 2 } else { 7 }, u8::from(i % 3 == 0)));
    folder.write("a.ply", &ply(&["float x", "float y", "float z", "uchar Classification", "uchar Withheld"], rows));
    folder.succeed(&["convert", "a.ply", "a.las"]);
    for name in ["a.ply", "a.las"] {
        let text = folder.succeed(&["info", name, "--scan"]).stdout;
        for (word, count) in [("ground", "10"), ("low point (noise)", "20"), ("Withheld", "10")] {
            let listed =
                |line: &str| line.contains(word) && line.contains(&format!(" {count} ")) && line.ends_with('%');
            assert!(text.lines().any(listed), "{name}: {word}\n{text}");
        }
    }
}

#[test]
fn the_field_file() {
    let Some(data) = data() else { return };
    let folder = Folder::new();
    let path = data.join("../field/l17b_class7_noise.las");
    let path = path.to_str().expect("a name in UTF-8");
    let outcome = folder.succeed(&["render", path, "-o", "a.png", "--size", "64x48"]);
    assert!(outcome.stderr.contains("left out 1500 of 6000 points"), "{}", outcome.stderr);
    let (near, far) = (distance(&folder, &[path]), distance(&folder, &[path, "--keep", "all"]));
    assert!(far > 3.0 * near, "the view is fitted to the others: {near} {far}");
    folder.succeed(&["convert", path, "a.ply"]);
    assert_eq!(measured(&folder, &["a.ply"]).0, 6000, "a file keeps its points");
    folder.succeed(&["convert", path, "b.ply", "--keep", "usual"]);
    assert_eq!(measured(&folder, &["b.ply"]).0, 4500, "unless asked");
}

#[test]
fn pipes_tell_once_what_they_leave_out() {
    let folder = Folder::new();
    let frames = wall("classification").repeat(3);
    let mut command = folder.command(&["render", "-", "-o", "p_%d.png", "--size", "64x48"]);
    command.stdin(std::process::Stdio::piped()).stderr(std::process::Stdio::piped());
    let mut child = command.spawn().expect("the command starts");
    std::io::Write::write_all(&mut child.stdin.take().expect("a pipe"), frames.as_bytes()).expect("written");
    let outcome = child.wait_with_output().expect("it ends");
    let told = String::from_utf8_lossy(&outcome.stderr);
    assert!(outcome.status.success() && told.matches("left out 40 of 440 points").count() == 1, "{told}");
}
