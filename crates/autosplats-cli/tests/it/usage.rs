//! Exit code 2: unknown or unsuitable arguments. The message names a remedy.

use crate::common::{FRONT, Folder};

const RENDER: [&str; 4] = ["render", "sphere.ply", "-o", "out.png"];

#[test]
fn options_that_do_not_fit() {
    let folder = Folder::with_sphere();
    let cases: &[(&[&str], &[&str])] = &[
        (&["--size", "0x0"], &["0x0", "16384"]),
        (&["--size", "100000x100000"], &["16384"]),
        (&["--size", "17"], &["1760x900"]),
        (&["-k", "0"], &["-k 0", "1 to"]),
        (&["-k", "65"], &["-k 65"]),
        (&["-k", "ten"], &["ten"]),
        (&["--e0", "9"], &["--e0 9", "0 to 8"]),
        (&["--gap-factor", "1"], &["above 1"]),
        (&["--splat-scale", "0"], &["0.01"]),
        (&["--occlusion", "11"], &["0 to 10"]),
        (&["--occlusion", "nan"], &["0 to 10"]),
        (&["--exposure", "0"], &["exposure 0", "0.01 to 100"]),
        (&["--exposure", "nan"], &["0.01 to 100"]),
        (&["--supersample", "0"], &["1..=8"]),
        (&["--supersample", "2", "-o", "layers.exr"], &["--supersample", ".exr"]),
        (&["--range", "2..1"], &["lower"]),
        (&["--background", "redd"], &["#rrggbb", "white"]),
        (&["--color-map", "jet"], &["viridis"]),
        (&["--view", "sideways"], &["iso", "top"]),
        (&["--eye", "1,2"], &["three numbers"]),
        (&["--up", "0,0,1"], &["--eye"]),
        (&["--eye", "1,2,3", "--look-at", "1,2,3"], &["same point"]),
        (&["--eye", "0,0,5", "--look-at", "0,0,0", "--up", "0,0,1"], &["line of sight"]),
        (&["--view", "top", "--eye", "1,2,3"], &["--view", "--eye"]),
        (&["--fov", "180"], &["170"]),
        (&["--fov", "40", "--ortho", "2"], &["--ortho"]),
        (&["--ortho", "-1"], &["above 0"]),
        (&["--engine", "magic"], &["screen-grid", "kd-tree"]),
        (&["--first-radius", "0"], &["above 0", "best"]),
        (&["--first-radius", "nan"], &["above 0"]),
        (&["--first-radius", "worst"], &["'best'"]),
        (&["--threads", "0"], &["--threads", "from 1 to 1024", "one per core"]),
        (&["--threads", "many"], &["from 1 to 1024"]),
        (&["--pose", "other.ply=pose.txt"], &["sphere.ply"]),
        (&["--collor", "rgb"], &["--color"]),
        (&["--color", "hieght"], &["did you mean 'height'"]),
        (&["--color", "banana"], &["no field banana", "rgb", "Intensity"]),
        (&["--color", "Red"], &["--color rgb"]),
        (&["--color", "classification"], &["no field Classification"]),
        (&["-o", "out.png"], &["two outputs"]),
        (&["-o", "out.gif"], &[".png, .jpg or .exr"]),
        (&["-o", "out"], &[".png, .jpg or .exr"]),
        (&["-o", "out.jpg", "--background", "transparent"], &["out.jpg", ".png"]),
    ];
    for (options, words) in cases {
        folder.fail(&[&RENDER[..], options].concat(), 2, words);
    }
}

#[test]
fn columns_that_nothing_has() {
    let folder = Folder::with_sphere();
    folder.fail(&["render", "scene:figure:1K", "-o", "out.png", "--columns", "x,y,z"], 2, &["--columns", "no input"]);
    let told = folder.succeed(&[&RENDER[..], &["--size", "32x32", "--columns", "x,y,z"]].concat()).stderr;
    assert!(told.contains("sphere.ply") && told.contains("--columns is for text"), "{told}");
}

#[test]
fn messages_name_the_inputs() {
    let folder = Folder::with_sphere();
    folder.write("one.ply", &crate::common::points_ply(&["1 2 3"]));
    folder.fail(&["render", "one.ply", "-k", "10", "-o", "out.png"], 3, &["one.ply: one point"]);
    let away = ["--eye", "0,0,9", "--look-at", "0,0,99"];
    let both = ["render", "sphere.ply", "one.ply", "-o", "out.png", "--quiet"];
    folder.fail(&[&both[..], &away].concat(), 3, &["sphere.ply, one.ply: nothing to show"]);
}

#[test]
fn legends_of_colours_without_a_value() {
    let folder = Folder::with_sphere();
    let told =
        |more: &[&str]| folder.succeed(&[&["render", "sphere.ply", "--size", "32x32", "-o", "out.png"], more].concat());
    assert!(told(&["--legend"]).stderr.contains("--legend and --range"), "plain points have no scale");
    assert!(!told(&["--legend", "--color", "height"]).stderr.contains("--legend and --range"), "heights have one");
}

#[test]
fn inputs_that_lie_far_apart() {
    let folder = Folder::with_sphere();
    for (name, x) in [("far.ply", 100_000), ("beside.ply", 100_005), ("near.ply", 9)] {
        let points = [0, 1, 2, 3].map(|i| format!("{} {} 0", x + i, i & 1));
        folder.write(name, &crate::common::points_ply(&points.each_ref().map(String::as_str)));
    }
    let notes = |inputs: &[&str]| {
        let told = folder.succeed(&[&["render"], inputs, &["--size", "32x32", "-o", "out.png"]].concat()).stderr;
        told.lines().filter(|line| line.contains("a picture hardly shows both")).map(str::to_owned).collect::<Vec<_>>()
    };
    let told = notes(&["sphere.ply", "far.ply"]);
    assert!(told.len() == 1 && told[0].contains("far.ply") && told[0].contains("--pose"), "{told:?}");
    let told = notes(&["sphere.ply", "far.ply", "beside.ply"]);
    assert!(told.len() == 1 && told[0].contains("sphere.ply"), "the one that is alone: {told:?}");
    assert_eq!(notes(&["sphere.ply", "near.ply"]), [""; 0]);
}

#[test]
fn colors_that_the_points_do_not_have() {
    let folder = Folder::new();
    folder.write("bare.ply", &crate::common::points_ply(&["0 0 0", "1 0 0", "0 1 0", "1 1 0"]));
    folder.fail(&["render", "bare.ply", "-o", "out.png", "--color", "rgb"], 2, &["no colours"]);
    folder.fail(&["render", "bare.ply", "-o", "out.png", "--color", "intensity"], 2, &["no field Intensity"]);
}

#[test]
fn commands_that_do_not_exist() {
    let folder = Folder::with_sphere();
    folder.fail(&["sphere.ply", "--wach"], 2, &["--wach", "--watch"]);
    folder.fail(&["rendr", "sphere.ply"], 2, &["did you mean 'render'"]);
    folder.fail(&["render", "sphere.ply"], 2, &["--out"]);
    folder.fail(&["render", "-o", "out.png"], 2, &["INPUT"]);
}

#[test]
#[cfg(not(feature = "viewer"))]
fn builds_without_a_viewer_say_so() {
    let folder = Folder::with_sphere();
    folder.fail(&["sphere.ply"], 2, &["no viewer", "autosplats render sphere.ply"]);
}

/// Tests run without a screen, and the message names the remedy.
#[test]
#[cfg(all(feature = "viewer", target_os = "linux"))]
fn windows_need_a_screen() {
    let folder = Folder::with_sphere();
    folder.fail(&["none.ply"], 3, &["none.ply", "No such file"]);
    for words in [&["sphere.ply"][..], &["view"], &["scene:herd"], &["sphere.ply", "--watch"]] {
        folder.fail(words, 5, &["no window can be opened", "DISPLAY", "autosplats render"]);
    }
    folder.write("session.json", "{\"inputs\": 3}");
    folder.fail(&["--state", "session.json"], 3, &["session.json", "not a session file"]);
}

#[test]
fn scenes_that_do_not_exist() {
    let folder = Folder::new();
    folder.fail(&["render", "scene:statu", "-o", "out.png"], 2, &["statu", "did you mean 'statue'"]);
    folder.fail(&["render", "scene:zebra", "-o", "out.png"], 2, &["zebra", "cathedral", "herd"]);
    folder.fail(&["render", "scene:herd:many", "-o", "out.png"], 2, &["many"]);
    folder.fail(&["render", "scene:herd:0", "-o", "out.png"], 2, &["herd:0"]);
    folder.fail(&["render", "statue", "-o", "out.png"], 3, &["scene:statue"]);
}

#[test]
fn inputs_are_never_overwritten() {
    let folder = Folder::new();
    folder.write("cloud.png", &crate::common::sphere_ply());
    folder.fail(&["render", "cloud.png", "-o", "./cloud.png"], 2, &["overwrite an input"]);
    folder.write("cloud.ply", &crate::common::sphere_ply());
    folder.fail(&["convert", "cloud.ply", "cloud.ply", "--force"], 2, &["overwrite an input"]);
    folder.succeed(&["render", "cloud.ply", "-o", "a.png", "--size", "32x32", "--save-camera", "cam.json"]);
    let clash = ["render", "cloud.ply", "-o", "a.png", "--camera", "cam.json", "--save-camera", "cam.json"];
    folder.fail(&clash, 2, &["overwrite an input"]);
}

#[test]
fn help_is_data() {
    let folder = Folder::new();
    for arguments in [&["--help"][..], &["render", "--help"], &["convert", "--help"], &["demo", "--help"]] {
        let outcome = folder.succeed(arguments);
        assert!(outcome.stdout.contains("Usage"), "{arguments:?} explains on standard output");
        assert_eq!(outcome.stderr, "", "{arguments:?} is no error");
    }
    assert!(folder.succeed(&["--help"]).stdout.contains("130"), "the exit codes are explained");
    let outcome = folder.run(&[]);
    assert_eq!(outcome.code, Some(2), "nothing to do is bad usage");
    assert!(outcome.stderr.contains("Usage"), "and the help is what helps");
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let folder = Folder::with_sphere();
    let arguments = [&RENDER[..], &FRONT, &["--size", "32x32", "--json", "--quiet"]].concat();
    let mut child = folder
        .command(&arguments)
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the command starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("the command ends");
    assert_eq!(output.status.code(), Some(0), "the picture was written all the same");
    assert_eq!(String::from_utf8_lossy(&output.stderr), "", "and nobody needs to know");
}

#[test]
fn engines_that_need_a_gpu() {
    let folder = Folder::with_sphere();
    for radius in ["best", "0.2"] {
        let options = ["--engine", "kd-tree", "--first-radius", radius, "--backend", "cpu"];
        folder.fail(&[&RENDER[..], &options].concat(), 5, &["kd-tree", "GPU", "screen-grid"]);
    }
}
