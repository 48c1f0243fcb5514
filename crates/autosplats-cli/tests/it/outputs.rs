//! What outputs do to what is there: pipes, devices, links, other files, and the inputs.

use std::fs;
use std::process::{Command, Stdio};

use crate::common::{FRONT, Folder, Outcome};

/// A quick picture of the sphere, to which outputs are added.
fn render<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["render", "sphere.ply", "--size", "60x40", "--quiet"], &FRONT[..], more].concat()
}

#[cfg(unix)]
mod special {
    use std::os::unix::fs::{FileTypeExt as _, MetadataExt as _, PermissionsExt as _, symlink};

    use super::*;

    /// Makes a device or pipe. False where only the superuser may.
    fn make(folder: &Folder, tool: &str, arguments: &[&str]) -> bool {
        let made = Command::new(tool).args(arguments).current_dir(folder.path("")).stderr(Stdio::null()).status();
        made.expect("the tool is there").success()
    }

    #[test]
    fn devices_stay_devices() {
        let folder = Folder::with_sphere();
        if !make(&folder, "mknod", &["null.png", "c", "1", "3"]) {
            crate::common::left_out("outputs that are devices", "none can be made here");
            return;
        }
        assert!(make(&folder, "mknod", &["block.ply", "b", "7", "200"]), "as devices can be made");
        symlink("null.png", folder.path("link.png")).expect("a link");
        symlink("null.png", folder.path("null.ply")).expect("a link");
        folder.succeed(&render(&["-o", "null.png"]));
        folder.succeed(&render(&["-o", "link.png"]));
        folder.succeed(&render(&["-o", "p.png", "--save-camera", "null.png"]));
        for command in [&["convert"][..], &["convert", "--force"], &["normals"], &["normals", "--force"]] {
            folder.succeed(&[command, &["sphere.ply", "null.ply"]].concat());
        }
        for force in [&["convert"][..], &["convert", "--force"]] {
            folder.fail(&[force, &["sphere.ply", "block.ply"]].concat(), 4, &["block.ply"]);
        }
        let kind = |name: &str| folder.path(name).symlink_metadata().expect("it is there").file_type();
        assert!(kind("null.png").is_char_device() && kind("block.ply").is_block_device(), "they stay");
        assert!(kind("link.png").is_symlink() && kind("null.ply").is_symlink(), "and the links");
    }

    #[test]
    fn pipes_get_what_a_file_would_have() {
        let folder = Folder::with_sphere();
        folder.succeed(&["convert", "sphere.ply", "file.laz"]);
        assert!(make(&folder, "mkfifo", &["pipe.laz"]), "a pipe can be made");
        let reader = Command::new("cat").arg(folder.path("pipe.laz")).stdout(Stdio::piped()).spawn().expect("cat");
        let told = folder.succeed(&["convert", "sphere.ply", "pipe.laz"]).stderr;
        let read = reader.wait_with_output().expect("it ends").stdout;
        assert_eq!(read, folder.read("file.laz"), "no writer that moves in its file is a problem");
        assert!(told.contains(&format!("{} bytes", read.len())), "{told}");
        assert!(folder.path("pipe.laz").symlink_metadata().expect("it is there").file_type().is_fifo(), "it stays");
    }

    #[test]
    fn private_files_stay_private() {
        let folder = Folder::with_sphere();
        for name in ["a.png", "a.exr", "a.json", "a.ply", "n.ply"] {
            folder.write(name, "");
            fs::set_permissions(folder.path(name), fs::Permissions::from_mode(0o600)).expect("it is ours");
        }
        folder.succeed(&render(&["-o", "a.png", "--save-camera", "a.json"]));
        folder.succeed(&render(&["-o", "a.exr"]));
        folder.succeed(&["convert", "--force", "sphere.ply", "a.ply"]);
        folder.succeed(&["normals", "--force", "sphere.ply", "n.ply"]);
        for name in ["a.png", "a.exr", "a.json", "a.ply", "n.ply"] {
            let file = fs::metadata(folder.path(name)).expect("a file");
            assert!(file.len() > 0 && file.mode() & 0o777 == 0o600, "{name}: {:o}", file.mode());
        }
        fs::set_permissions(folder.path("a.ply"), fs::Permissions::from_mode(0o444)).expect("it is ours");
        folder.fail(&["convert", "--force", "sphere.ply", "a.ply"], 4, &["a.ply", "read-only"]);
    }

    #[test]
    fn links_without_a_target_are_no_free_names() {
        let folder = Folder::with_sphere();
        symlink("target.ply", folder.path("link.ply")).expect("a link");
        symlink("loop.ply", folder.path("loop.ply")).expect("a link");
        symlink("missing/a.ply", folder.path("away.ply")).expect("a link");
        folder.fail(&["convert", "sphere.ply", "link.ply"], 4, &["link.ply: already exists"]);
        folder.succeed(&["convert", "--force", "sphere.ply", "link.ply"]);
        assert!(folder.path("target.ply").is_file(), "what it points to is written");
        folder.fail(&["convert", "--force", "sphere.ply", "loop.ply"], 4, &["loop.ply"]);
        folder.fail(&["convert", "--force", "sphere.ply", "away.ply"], 4, &["away.ply"]);
        for name in ["link.ply", "loop.ply", "away.ply"] {
            assert!(folder.path(name).symlink_metadata().expect("it is there").is_symlink(), "{name} stays a link");
        }
    }

    #[test]
    fn two_names_of_one_file_are_one_output() {
        let folder = Folder::with_sphere();
        fs::create_dir(folder.path("sub")).expect("a folder");
        symlink("a.png", folder.path("link.png")).expect("a link");
        folder.fail(&render(&["-o", "b.png", "-o", "sub/../b.png"]), 2, &["two outputs are this file"]);
        folder.write("a.png", "");
        folder.fail(&render(&["-o", "a.png", "-o", "link.png"]), 2, &["link.png: two outputs are this file"]);
        folder.fail(
            &["render", "sphere.ply", "--frames", "0..0", "-o", "f_%d.png", "--save-camera", "sub/../f_0.png"],
            2,
            &["two outputs are this file"],
        );
    }

    #[test]
    fn names_that_are_no_text_are_named() {
        use std::ffi::OsStr;
        use std::os::unix::ffi::OsStrExt as _;
        let folder = Folder::with_sphere();
        let run = |words: &[&[u8]]| {
            let words = words.iter().map(|word| OsStr::from_bytes(word));
            let output = folder.command(&[]).args(words).output().expect("it starts");
            (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
        };
        let (code, said) = run(&[b"convert", b"sphere.ply", b"b\xff.ply"]);
        assert!(code == Some(2) && said.starts_with("error: b\u{fffd}.ply: this name is not UTF-8"), "{said}");
        let picture: [&[u8]; 5] = [b"render", b"sphere.ply", b"--size", b"60x40", b"-o"];
        let with = |more: &[&'static [u8]]| run(&[&picture[..], more].concat());
        let (code, said) = with(&[b"f\xff_%d.png", b"--frames", b"0..0"]);
        assert!(code == Some(2) && said.contains("UTF-8"), "{said}");
        let (code, said) = with(&[b"g\xff.png", b"--json"]);
        assert!(code == Some(2) && said.contains("--json"), "{said}");
        assert_eq!(folder.list(), ["sphere.ply"], "nothing was written");
        let (code, said) = with(&[b"h\xff.png"]);
        assert_eq!(code, Some(0), "one picture may have such a name: {said}");
        assert!(folder.path("").join(OsStr::from_bytes(b"h\xff.png")).is_file(), "exactly that name");
    }
}

#[test]
fn only_a_saved_camera_is_replaced_by_one() {
    let folder = Folder::with_sphere();
    folder.write("notes.txt", "mine");
    folder.write("data.json", "{\"eye\": [0, 0, 0]}");
    for name in ["notes.txt", "data.json"] {
        let before = folder.read(name);
        folder.fail(&render(&["-o", "a.png", "--save-camera", name]), 4, &[name, "is no saved camera"]);
        assert_eq!(folder.read(name), before, "{name} stays");
    }
    folder.fail(&render(&["-o", "a.png", "--save-camera", "sphere.ply"]), 2, &["would overwrite an input"]);
    folder.succeed(&render(&["-o", "a.png", "--save-camera", "camera.json"]));
    let first = folder.read("camera.json");
    folder.succeed(&["render", "sphere.ply", "--size", "60x40", "-o", "a.png", "--save-camera", "camera.json"]);
    assert!(folder.read("camera.json") != first, "a camera is replaced by another");
}

#[test]
fn what_an_input_refers_to_is_not_replaced() {
    let folder = Folder::new();
    let floats: Vec<u8> = (0..300).flat_map(|i| ((i % 7) as f32 + (i / 7) as f32 * 0.1).to_le_bytes()).collect();
    fs::write(folder.path("points.ply"), &floats).expect("written");
    folder.write("skin.png", "a texture");
    folder.write(
        "model.gltf",
        r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"mode": 0, "attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 100, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 1200}], "images": [{"uri": "skin.png"}],
        "buffers": [{"uri": "points.ply", "byteLength": 1200}]}"#,
    );
    folder.succeed(&["convert", "model.gltf", "out.ply"]);
    folder.fail(&["convert", "--force", "model.gltf", "points.ply"], 2, &["would overwrite an input"]);
    folder.fail(&["render", "model.gltf", "-o", "skin.png"], 2, &["would overwrite an input"]);
    folder.fail(
        &["render", "model.gltf", "-o", "a.png", "--save-camera", "points.ply"],
        2,
        &["would overwrite an input"],
    );
    assert_eq!(folder.read("points.ply"), floats, "the points stay");
}

#[test]
fn names_of_no_file_are_refused_before_the_work() {
    let folder = Folder::with_sphere();
    let long = format!("{}.png", "a".repeat(252));
    // So many pixels would take longer than the test may.
    for (name, why) in [("a.png/", "this is a folder"), (&*long, "too long")] {
        let begun = std::time::Instant::now();
        folder.fail(&["render", "scene:cathedral:20M", "-o", name, "--size", "8000x8000"], 4, &[why]);
        assert!(begun.elapsed().as_secs() < 10, "{name}");
    }
    folder.fail(&["convert", "sphere.ply", "a.ply/"], 4, &["this is a folder"]);
}

#[test]
fn the_day_of_a_file_may_be_told() {
    let folder = Folder::with_sphere();
    let day_and_year = |name: &str| {
        let header = folder.read(name);
        [u16::from_le_bytes([header[90], header[91]]), u16::from_le_bytes([header[92], header[93]])]
    };
    for (name, seconds, expected) in
        [("a.las", "0", [1, 1970]), ("b.laz", "951782400", [60, 2000]), ("c.copc.laz", "1767225599", [365, 2025])]
    {
        let run = folder.command(&["convert", "sphere.ply", name]).env("SOURCE_DATE_EPOCH", seconds).output();
        assert!(run.expect("it starts").status.success(), "{name}");
        assert_eq!(day_and_year(name), expected, "{name}");
    }
}

#[test]
fn names_cannot_act_on_the_terminal() {
    let folder = Folder::with_sphere();
    let odd = "a\u{1b}[31m\u{202e}b";
    folder.write("pose.txt", "\u{1b}[2J 0 0\n");
    let long = "x".repeat(100_000);
    for arguments in [
        vec!["info", odd],
        vec!["convert", "sphere.ply", "no\u{1b}[0m/a.ply"],
        vec!["render", "sphere.ply", "-o", "a.png", "--color", odd],
        vec!["render", "sphere.ply", "-o", "a.png", "--pose", "sphere.ply=pose.txt"],
        vec!["render", "sphere.ply", "-o", "a.png", "--color", &long],
    ] {
        let Outcome { code, stderr, .. } = folder.run(&arguments);
        assert!(code == Some(2) || code == Some(3) || code == Some(4), "{arguments:?}: {code:?}");
        let acts = |c: char| c != '\n' && c.is_control() || c == '\u{202e}';
        assert!(!stderr.contains(acts), "{stderr:?}");
        assert!(stderr.lines().count() == 1 && stderr.len() < 5000, "one line: {}", stderr.len());
    }
}
