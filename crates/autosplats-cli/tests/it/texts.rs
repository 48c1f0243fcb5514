//! Values that begin with a hyphen, texts with byte order marks, and compressed files.

use std::io::Write as _;

use crate::common::{FRONT, Folder};

const RENDER: [&str; 4] = ["render", "sphere.ply", "-o", "out.png"];

#[test]
fn values_may_begin_with_a_hyphen() {
    let folder = Folder::with_sphere();
    folder.write("names.csv", "P1,1,2,3\nP2,4,5,6\nP3,7,8,9\n");
    let out = folder.succeed(&["convert", "names.csv", "out.xyz", "--columns", "-,x,y,z"]);
    assert!(!out.stderr.contains("columns taken for"), "{}", out.stderr);
    assert_eq!(String::from_utf8_lossy(&folder.read("out.xyz")), "x y z\n1 2 3\n4 5 6\n7 8 9\n", "as named");
    for (option, value, words) in [
        ("--color", "-speed", "no field -speed"),
        ("--fps", "-1", "above 0"),
        ("--decay", "-1s", "a time such as"),
        ("--sample", "-5", "a number of points"),
        ("--scan", "-2", "1..=4"),
        ("--threads", "-4", "from 1 to 1024"),
        ("--supersample", "-2", "1..=8"),
        ("--frames", "-3", "A..B"),
        ("--size", "-3x4", "1760x900"),
        ("--depth-camera", "-525,525,320,240", "depth-camera"),
        ("--background", "-red", "--background"),
        ("--pose", "-a.ply=pose.txt", "sphere.ply"),
        ("--eye", "-1,2", "three numbers"),
        ("--range", "-1..-2", "lower"),
    ] {
        let arguments = [&RENDER[..], &[option, value]].concat();
        folder.fail(&arguments, 2, &[words]);
        let message = folder.run(&arguments).stderr;
        assert!(!message.contains("unexpected argument"), "{message}");
    }
}

#[test]
fn poses_and_cameras_may_have_byte_order_marks() {
    let folder = Folder::with_sphere();
    let pose = "1 0 0 3  0 1 0 0  0 0 1 0";
    let wide: Vec<u8> = std::iter::once(0xfeff).chain(pose.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    std::fs::write(folder.path("wide.txt"), wide).expect("a file");
    folder.write("marked.txt", &format!("\u{feff}{pose}"));
    folder.write("plain.txt", pose);
    let moved = |name: &str| {
        let pose = format!("sphere.ply={name}.txt");
        folder.succeed(&["convert", "sphere.ply", &format!("{name}.xyz"), "--pose", &pose, "--quiet"]);
        folder.read(&format!("{name}.xyz"))
    };
    let plain = moved("plain");
    for name in ["marked", "wide"] {
        assert_eq!(moved(name), plain, "{name}");
    }
    let small = ["--size", "32x32", "--quiet"];
    folder.succeed(&[&RENDER[..], &small, &FRONT, &["--save-camera", "camera.json"]].concat());
    let camera = String::from_utf8(folder.read("camera.json")).expect("text");
    folder.write("marked.json", &format!("\u{feff}{camera}"));
    let picture = folder.read("out.png");
    folder.succeed(&[&["render", "sphere.ply", "-o", "again.png"][..], &small, &["--camera", "marked.json"]].concat());
    assert_eq!(folder.read("again.png"), picture, "the same camera");
}

#[test]
fn compressed_files_are_inputs_of_every_kind() {
    let folder = Folder::with_sphere();
    let packed = |bytes: &[u8]| {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(bytes).expect("in memory");
        encoder.finish().expect("in memory")
    };
    std::fs::create_dir(folder.path("sweeps")).expect("a folder");
    for name in ["sphere.ply.gz", "sweeps/a_1.ply.gz", "sweeps/a_2.PLY.GZ"] {
        std::fs::write(folder.path(name), packed(&folder.read("sphere.ply"))).expect("a file");
    }
    let facts = folder.succeed(&["info", "sphere.ply.gz"]).stdout;
    assert!(facts.contains("PLY, ascii") && facts.contains("gzip"), "{facts}");
    for [input, output] in [["sphere.ply", "plain.xyz"], ["sphere.ply.gz", "packed.xyz"], ["sweeps", "first.xyz"]] {
        folder.succeed(&["convert", input, output, "--quiet"]);
        assert_eq!(folder.read(output), folder.read("plain.xyz"), "{input}");
    }
}
