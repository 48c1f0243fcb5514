//! `convert` and `demo`.

mod common;

use common::{Folder, SPHERE_POINTS};

/// The number of points that a PLY file claims.
fn points(file: &[u8]) -> usize {
    let text = String::from_utf8_lossy(file);
    let line = text.lines().find_map(|line| line.strip_prefix("element vertex "));
    line.expect("a PLY file counts its points").parse().expect("the count is a number")
}

#[test]
fn a_converted_cloud_renders_the_same() {
    let folder = Folder::with_sphere();
    folder.succeed(&["convert", "sphere.ply", "copy.ply"]);
    let copy = folder.read("copy.ply");
    assert!(copy.starts_with(b"ply\nformat binary_little_endian 1.0\n"), "it is a binary PLY file");
    assert_eq!(points(&copy), SPHERE_POINTS, "all points are in it");
    for (input, output) in [("sphere.ply", "a.png"), ("copy.ply", "b.png")] {
        folder.succeed(&["render", input, "-o", output, "--size", "160x120", "--color", "intensity"]);
    }
    assert_eq!(folder.read("a.png"), folder.read("b.png"), "nothing was lost");
}

#[test]
fn an_existing_file_is_kept_unless_forced() {
    let folder = Folder::with_sphere();
    folder.write("out.ply", "precious");
    folder.fail(&["convert", "sphere.ply", "out.ply"], 4, &["--force"]);
    assert_eq!(folder.read("out.ply"), b"precious", "it was not touched");
    folder.succeed(&["convert", "sphere.ply", "out.ply", "--force"]);
    assert_eq!(points(&folder.read("out.ply")), SPHERE_POINTS, "now it was");
}

#[test]
fn several_inputs_become_one_file() {
    let folder = Folder::with_sphere();
    folder.write("aside.txt", "1 0 0 3  0 1 0 0  0 0 1 0");
    let arguments = ["convert", "sphere.ply", "scene:figure:5K", "all.ply", "--pose", "sphere.ply=aside.txt"];
    let outcome = folder.succeed(&[&arguments[..], &["--quiet"]].concat());
    assert_eq!([outcome.stdout, outcome.stderr], ["", ""], "quietly");
    assert_eq!(points(&folder.read("all.ply")), SPHERE_POINTS + 5000, "all points are in it");
}

#[test]
fn only_ply_is_written() {
    let folder = Folder::with_sphere();
    folder.fail(&["convert", "sphere.ply", "out.las"], 2, &[".ply"]);
    folder.fail(&["convert", "sphere.ply"], 2, &["INPUT"]);
    folder.fail(&["convert", "missing.las", "out.ply"], 3, &["missing.las"]);
}
