//! Exit codes 3 to 6 and 130: bad inputs, outputs and devices.

use crate::common::{FRONT, Folder, points_ply};

fn render(input: &str) -> [&str; 4] {
    ["render", input, "-o", "out.png"]
}

#[test]
fn clouds_that_show_nothing() {
    let folder = Folder::new();
    let cases: &[(&str, &[&str])] =
        &[("no_points", &[]), ("not_finite", &["nan 0 0", "0 inf 0", "0 0 -inf", "nan nan nan"])];
    for (name, points) in cases {
        let file = format!("{name}.ply");
        folder.write(&file, &points_ply(points));
        folder.fail(&render(&file), 3, &[]);
        folder.fail(&[&render(&file)[..], &FRONT].concat(), 3, &[]);
        folder.fail(&[&render(&file)[..], &["--ortho", "fit", "--view", "top"]].concat(), 3, &[]);
    }
}

#[test]
fn more_neighbours_than_points() {
    let folder = Folder::new();
    folder.write("four.ply", &points_ply(&["0 0 0", "1 0 0", "0 0 1", "1 0 1"]));
    let front = ["--size", "64x64", "--view", "front"];
    let dots = folder.succeed(&[&render("four.ply")[..], &front].concat());
    assert!(!dots.stderr.contains("neighbours"), "dots have none: {}", dots.stderr);
    let fewer = folder.succeed(&[&render("four.ply")[..], &front, &["-k", "10"]].concat());
    assert!(fewer.stderr.contains("4 points cannot have 10 neighbours"), "it is told: {}", fewer.stderr);
    let picture = folder.read("out.png");
    folder.succeed(&[&render("four.ply")[..], &front, &["-k", "3"]].concat());
    assert_eq!(folder.read("out.png"), picture, "as many neighbours as there are");
    for count in [63, 200] {
        folder.write("equal.ply", &points_ply(&vec!["1 2 3"; count]));
        folder.succeed(&render("equal.ply"));
    }
    folder.write("one.ply", &points_ply(&["0 0 0"]));
    folder.succeed(&render("one.ply"));
    folder.fail(&[&render("one.ply")[..], &["-k", "10"]].concat(), 3, &["one point"]);
}

#[test]
fn points_outside_the_picture() {
    let folder = Folder::with_sphere();
    let away = ["--eye", "0,-4,0", "--look-at", "0,-8,0"];
    folder.fail(&[&render("sphere.ply")[..], &away].concat(), 3, &[]);
    let aside = ["--eye", "100,-4,0", "--look-at", "100,0,0", "--ortho", "1"];
    folder.fail(&[&render("sphere.ply")[..], &aside].concat(), 3, &[]);
}

#[test]
fn files_that_are_no_clouds() {
    let folder = Folder::with_sphere();
    folder.fail(&render("missing.ply"), 3, &["missing.ply"]);
    std::fs::create_dir(folder.path("nothing")).expect("a folder");
    folder.fail(&render("nothing"), 3, &["nothing", "the folder has no files"]);
    folder.fail(&render("nothing/*.ply"), 3, &["nothing/*.ply", "no file matches"]);
    folder.write("unknown.doc", "no points\n");
    folder.fail(&render("unknown.doc"), 3, &["unknown.doc", "PLY"]);
    folder.write("empty.ply", "");
    folder.fail(&render("empty.ply"), 3, &["empty.ply"]);
    folder.write("words.xyz", "this is no number\n");
    folder.fail(&render("words.xyz"), 3, &["words.xyz"]);
    let whole = crate::common::sphere_ply();
    let header = whole.split_once("end_header").expect("a header").0;
    folder.write("header.ply", header);
    folder.fail(&render("header.ply"), 3, &["header.ply"]);
    folder.write("boast.ply", &whole.replace("vertex 6000", "vertex 999999999999"));
    let outcome = folder.run(&render("boast.ply"));
    assert!(outcome.code == Some(0) && outcome.stderr.contains("points are lost"), "{}", outcome.stderr);
    folder.write("liar.las", "LASF and nothing more");
    folder.fail(&render("liar.las"), 3, &["liar.las"]);
}

#[test]
fn poses_and_cameras_that_are_none() {
    let folder = Folder::with_sphere();
    folder.write("short.txt", "1 0 0\n");
    for (pose, word) in [("sphere.ply=short.txt", "4x4"), ("sphere.ply=missing.txt", "missing.txt")] {
        folder.fail(&[&render("sphere.ply")[..], &["--pose", pose]].concat(), 3, &[word]);
    }
    let camera = |eye: &str, projection: &str| {
        format!(r#"{{"eye": {eye}, "look_at": [0, 0, 0], "up": [0, 0, 1], "projection": {projection}}}"#)
    };
    let fov = r#"{"perspective_fov_deg": 40}"#;
    for (text, words) in [
        ("{\"eye\": [0, 0, 0]}".into(), &["cam.json", "line 1", "look_at", "--save-camera"][..]),
        (camera("[0, 0]", fov), &["line 1", "three numbers"]),
        (camera("[0, -4, 0]", r#""fisheye""#), &["line 1", "projection"]),
        (camera("[0, 0, 0]", fov), &["cam.json", "same point"]),
        ("{\n\"eye\": oops".into(), &["cam.json", "line 2", "JSON"]),
        (String::new(), &["JSON"]),
    ] {
        folder.write("cam.json", &text);
        let arguments = [&render("sphere.ply")[..], &["--camera", "cam.json"]].concat();
        folder.fail(&arguments, 2, words);
        let message = folder.run(&arguments).stderr;
        assert!(!["DVec3", "tuple", "variant", "expected"].iter().any(|word| message.contains(word)), "{message}");
    }
    folder.fail(&[&render("sphere.ply")[..], &["--camera", "none.json"]].concat(), 2, &["none.json"]);
}

#[test]
fn outputs_that_cannot_be_written() {
    let folder = Folder::with_sphere();
    folder.fail(&["render", "sphere.ply", "-o", "no/such/folder/out.png"], 4, &["no folder"]);
    std::fs::create_dir(folder.path("dir.png")).expect("a folder can be made");
    folder.fail(&["render", "sphere.ply", "-o", "dir.png"], 4, &["folder"]);
    folder.fail(&[&render("sphere.ply")[..], &["--save-camera", "no/cam.json"]].concat(), 4, &["no folder"]);
    folder.fail(&["convert", "sphere.ply", "no/out.ply"], 4, &["no folder"]);
    folder.fail(&["demo", "--out", "sphere.ply/demo"], 4, &["sphere.ply"]);
    #[cfg(target_os = "linux")]
    folder.fail(&["render", "sphere.ply", "-o", "/proc/out.png"], 4, &["/proc/out.png"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_gpu_that_is_not_there() {
    let folder = Folder::with_sphere();
    for arguments in [&render("sphere.ply")[..], &["bench"]] {
        let mut command = folder.command(&[arguments, &["--backend", "gpu"]].concat());
        // Vulkan's loader looks for drivers only here.
        let output =
            command.env("VK_DRIVER_FILES", "absent").env("VK_ICD_FILENAMES", "absent").output().expect("it starts");
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(5), "{error}");
        assert!(error.contains("CPU backend") && error.lines().count() == 1, "{error}");
    }
}

#[test]
fn a_device_that_is_not_there() {
    let folder = Folder::with_sphere();
    for device in ["99", "0000:ff:1f.7"] {
        folder.fail(&[&render("sphere.ply")[..], &["--device", device]].concat(), 5, &[device, "no device is called"]);
    }
    let both = ["--device", "0", "--backend", "cpu"];
    folder.fail(&[&render("sphere.ply")[..], &both].concat(), 2, &["--device", "cpu"]);
}

#[test]
fn an_engine_that_the_cpu_has_not() {
    let folder = Folder::with_sphere();
    let arguments = ["--engine", "splat-communication", "--backend", "cpu"];
    folder.fail(&[&render("sphere.ply")[..], &arguments].concat(), 5, &["GPU only", "screen-grid"]);
}

#[cfg(target_os = "linux")]
#[test]
fn more_than_fits_into_memory() {
    let folder = Folder::new();
    let mut arguments = vec!["scene:cathedral:1G"; 1000];
    arguments.insert(0, "render");
    arguments.extend(["-o", "out.png"]);
    folder.fail(&arguments, 6, &["memory"]);
}

/// Starts a command, presses Ctrl-C when `ready`, and expects a clean end.
#[cfg(unix)]
fn interrupt(arguments: &[&str], ready: impl Fn(&Folder) -> bool) {
    use std::process::{Command, Stdio};

    let folder = Folder::new();
    let mut child = folder.command(arguments).stderr(Stdio::piped()).spawn().expect("the command starts");
    while !ready(&folder) {
        let ended = child.try_wait().expect("the command can be asked");
        assert_eq!(ended, None, "{arguments:?} still runs");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill starts");
    assert!(sent.success(), "the signal was sent");
    let output = child.wait_with_output().expect("the command ends");
    assert_eq!(output.status.code(), Some(130), "{arguments:?} ended because of the signal");
    assert!(String::from_utf8_lossy(&output.stderr).contains("interrupted"), "it says so");
    assert_eq!(folder.list(), Vec::<String>::new(), "it leaves nothing behind");
}

#[cfg(unix)]
#[test]
fn interrupted_while_reading() {
    let start = std::time::Instant::now();
    interrupt(&["convert", "scene:cathedral:100M", "out.ply"], |_| start.elapsed().as_secs_f64() > 0.7);
}

#[cfg(unix)]
#[test]
fn interrupted_while_writing() {
    use std::fs::metadata;

    let has_begun = |folder: &Folder| {
        folder.list().iter().any(|name| metadata(folder.path(name)).is_ok_and(|metadata| metadata.len() > 100_000))
    };
    interrupt(&["render", "scene:figure:20K", "-o", "out.exr", "--size", "3000x3000"], has_begun);
}
