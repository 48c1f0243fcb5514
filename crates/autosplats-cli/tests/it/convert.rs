//! `convert` and `demo`.

use crate::common::{Folder, SPHERE_POINTS};

/// Number of points that a PLY file's header states.
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

#[cfg(unix)]
#[test]
fn a_link_stays_one() {
    let folder = Folder::with_sphere();
    folder.write("old.ply", "old");
    std::os::unix::fs::symlink("old.ply", folder.path("link.ply")).expect("a link can be made");
    folder.succeed(&["convert", "sphere.ply", "link.ply", "--force"]);
    assert!(folder.path("link.ply").is_symlink(), "the link is still one");
    assert_eq!(points(&folder.read("old.ply")), SPHERE_POINTS, "and what it points to is new");
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
fn points_are_taken_out_in_order() {
    let folder = Folder::with_sphere();
    let count = |options: &[&str]| {
        folder.succeed(&[&["convert", "sphere.ply", "out.ply", "--force"], options].concat());
        points(&folder.read("out.ply"))
    };
    let half = count(&["--bounds", "-2,-2,0,2,2,2"]);
    assert!((half as f64 - SPHERE_POINTS as f64 / 2.0).abs() < 100.0, "{half} in the upper half of the sphere");
    assert_eq!(count(&["--every", "4"]), SPHERE_POINTS / 4, "a quarter");
    let thin = count(&["--voxel", "0.25"]);
    assert!((200..500).contains(&thin), "{thin} cubes of a quarter radius touch the sphere: about 1.5 x 4 pi x 16");
    assert_eq!(count(&["--noise", "0.01", "--every", "2"]), SPHERE_POINTS / 2, "shaken, but all there");
    folder.fail(&["convert", "sphere.ply", "b.ply", "--bounds", "5,5,5,6,6,6"], 3, &["none of the 6000", "--bounds"]);
    folder.fail(&["convert", "sphere.ply", "b.ply", "--bounds", "1,1,1,0,0,0"], 2, &["lower"]);
    folder.fail(&["convert", "sphere.ply", "b.ply", "--voxel", "-1"], 2, &["above 0"]);
    folder.fail(&["convert", "sphere.ply", "b.ply", "--every", "0"], 2, &["above 0"]);
}

#[test]
fn a_mesh_is_sampled() {
    let folder = Folder::with_sphere();
    folder.write("square.obj", "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4\n");
    folder.succeed(&["convert", "square.obj", "out.ply", "--sample", "5K"]);
    assert_eq!(points(&folder.read("out.ply")), 5000, "as many as asked for");
    folder.fail(&["convert", "sphere.ply", "b.ply", "--sample", "5K"], 3, &["sphere.ply", "no surface"]);
    folder.fail(&["convert", "scene:statue", "b.ply", "--sample", "5K"], 2, &["scene:statue:1M"]);
    folder.fail(&["convert", "square.obj", "b.ply", "--sample", "0"], 2, &["number of points"]);
}

#[test]
fn only_known_formats_are_written() {
    let folder = Folder::with_sphere();
    folder.fail(&["convert", "sphere.ply", "out.doc"], 2, &["out.doc", ".ply"]);
    folder.fail(&["convert", "sphere.ply"], 2, &["sphere.ply", "the file to write is missing"]);
    folder.fail(&["convert", "missing.las", "out.ply"], 3, &["missing.las"]);
}

#[test]
fn any_inputs_become_an_octree() {
    let folder = Folder::with_sphere();
    let outcome =
        folder.succeed(&["convert", "sphere.ply", "scene:figure:30K", "-o", "all.copc.laz", "--memory", "200M"]);
    assert!(outcome.stderr.contains(&format!("{} points in", SPHERE_POINTS + 30_000)), "{}", outcome.stderr);
    let info = folder.succeed(&["info", "all.copc.laz", "--json"]).stdout;
    let info: serde_json::Value = serde_json::from_str(&info).expect("JSON");
    let text = info.to_string();
    assert!(text.contains("COPC") && text.contains(&(SPHERE_POINTS + 30_000).to_string()), "{text}");
    // In another order of the inputs it is the same file.
    folder.succeed(&["convert", "scene:figure:30K", "sphere.ply", "-o", "again.copc.laz"]);
    assert!(folder.read("all.copc.laz") == folder.read("again.copc.laz"), "the order of inputs does not matter");
    folder.succeed(&["render", "all.copc.laz", "-o", "a.png", "--size", "80x60", "--detail", "1"]);
}

#[test]
fn what_no_octree_can_be_made_of_is_refused() {
    let folder = Folder::with_sphere();
    folder.write("empty.xyz", "");
    folder.write("old.copc.laz", "precious");
    let before = folder.list();
    let cases: [(&[&str], u8, &[&str]); 6] = [
        (&["sphere.ply", "a.copc.laz", "--voxel", "0.1"], 2, &["--voxel", "octree"]),
        (&["sphere.ply", "a.copc.laz", "--temp", "nowhere"], 4, &["nowhere"]),
        (&["scene:figure:30K", "a.copc.laz", "--memory", "1M"], 6, &["MiB"]),
        (&["scene:figure:30K", "a.copc.laz", "--bounds", "900,900,900,901,901,901"], 3, &["--bounds"]),
        (&["empty.xyz", "a.copc.laz"], 3, &["empty.xyz"]),
        (&["sphere.ply", "old.copc.laz"], 4, &["--force"]),
    ];
    for (arguments, exit, words) in cases {
        folder.fail(&[&["convert"], arguments].concat(), exit.into(), words);
    }
    assert_eq!(folder.list(), before, "nothing is left behind");
    assert_eq!(folder.read("old.copc.laz"), b"precious");
}

/// Of each kind of output, and each kind of thinning, the same bytes as if memory held all points.
#[test]
fn more_points_than_memory_holds_are_converted_in_parts() {
    let folder = Folder::with_sphere();
    folder.succeed(&["convert", "scene:figure:100K", "scan.laz"]);
    let box_of_some = ["--bounds", "-1,-1,0.5,1,0.1,1.5"];
    for (output, options) in [
        ("a.ply", &[][..]),
        ("a.las", &["--every", "3"]),
        ("a.laz", &["--voxel", "0.02", "--noise", "0.001"]),
        ("a.xyz", &box_of_some),
        ("a.pcd", &["--noise", "0.01", "--seed", "7"]),
        ("a.e57", &["--every", "2"]),
    ] {
        let whole = ["convert", "scan.laz", output, "--force"];
        folder.succeed(&[&whole[..], options].concat());
        let expected = folder.read(output);
        let outcome = folder.succeed(&[&whole[..], options, &["--memory", "5M"]].concat());
        assert!(folder.read(output) == expected, "{output} {options:?}: {}", outcome.stderr);
        let fewer = ["--every", "--voxel", "--bounds"].iter().any(|option| options.contains(option));
        assert_eq!(outcome.stderr.contains(" of 100000 points"), fewer, "{}", outcome.stderr);
    }
    let nothing = ["convert", "scan.laz", "b.ply", "--memory", "5M", "--bounds", "9,9,9,10,10,10"];
    folder.fail(&nothing, 3, &["none of the 100000 points", "--bounds"]);
    folder.fail(&["convert", "scan.laz", "b.ply", "--memory", "5M", "--temp", "nowhere"], 4, &["nowhere"]);
    folder.write("pose.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n");
    let outcome = folder.succeed(&["convert", "scan.laz", "b.ply", "--memory", "5M", "--pose", "scan.laz=pose.txt"]);
    assert!(!outcome.stderr.contains("note: --memory"), "a pose that moves nothing: {}", outcome.stderr);
    folder.write("pose.txt", "1 0 0 1\n0 1 0 0\n0 0 1 0\n");
    let outcome =
        folder.succeed(&["convert", "scan.laz", "b.ply", "--force", "--memory", "5M", "--pose", "scan.laz=pose.txt"]);
    assert!(outcome.stderr.contains("note: --memory"), "with a pose all at once: {}", outcome.stderr);
}

#[test]
fn several_inputs_of_more_points_than_memory_holds_are_joined_in_parts() {
    let folder = Folder::with_sphere();
    folder.succeed(&["convert", "scene:figure:60K", "a.laz"]);
    folder.succeed(&["convert", "scene:statue:50K", "b.ply"]);
    folder.succeed(&["normals", "sphere.ply", "c.ply"]);
    for inputs in [&["a.laz", "b.ply", "c.ply"][..], &["b.ply", "scene:cathedral:40K", "a.laz"]] {
        let joined = |memory: &[&str], options: &[&str]| {
            let words = [&["convert"], inputs, &["-o", "out.ply", "--force"], options, memory].concat();
            (folder.succeed(&words).stderr, folder.read("out.ply"))
        };
        for options in [&[][..], &["--every", "7"], &["--voxel", "0.05"]] {
            let ((said, whole), (said_in_parts, parts)) = (joined(&[], options), joined(&["--memory", "5M"], options));
            assert!(parts == whole, "{inputs:?} {options:?}: {said_in_parts}");
            let notes = |said: &str| said.lines().filter(|line| line.contains("left out")).map(str::to_owned).collect();
            let (whole, parts): (Vec<String>, Vec<String>) = (notes(&said), notes(&said_in_parts));
            assert_eq!(parts, whole, "{inputs:?}");
        }
    }
    folder.write("empty.xyz", "");
    folder.fail(&["convert", "a.laz", "empty.xyz", "-o", "b.las", "--memory", "5M"], 3, &["empty.xyz"]);
}

/// Of a tile whose class is 0 everywhere nothing is lost, but a PLY without classes has none.
#[test]
fn tiles_with_fields_of_zeros_are_joined() {
    let folder = Folder::new();
    let tile = |name: &str, class: u8| {
        let rows: String = (0..400).map(|i| format!("{i} {} 1 {class} {}\n", i % 7, i % 3)).collect();
        folder.write("tile.csv", &format!("x y z Classification ReturnNumber\n{rows}"));
        folder.succeed(&["convert", "tile.csv", name]);
    };
    tile("ground.laz", 2);
    tile("new.laz", 0);
    folder.write("bare.xyz", "1 2 3\n4 5 6\n7 8 9\n");
    for inputs in [["ground.laz", "new.laz"], ["new.laz", "ground.laz"]] {
        for output in ["all.laz", "all.ply", "all.copc.laz"] {
            let words = [&["convert"], &inputs[..], &["-o", output, "--force"]].concat();
            let outcome = folder.succeed(&words);
            assert!(!outcome.stderr.contains("left out"), "{inputs:?}: {}", outcome.stderr);
            let info = folder.succeed(&["info", output, "--scan", "--json"]).stdout;
            let info: serde_json::Value = serde_json::from_str(&info).expect("JSON");
            let attributes = info["attributes"].as_array().expect("a list");
            let class = attributes.iter().find(|one| one["name"] == "Classification").expect("classes");
            assert_eq!((&class["min"], &class["max"]), (&0.0.into(), &2.0.into()), "{output}");
            if output != "all.copc.laz" {
                let whole = folder.read(output);
                let outcome = folder.succeed(&[&words[..], &["--memory", "50K"]].concat());
                assert!(folder.read(output) == whole, "in parts: {}", outcome.stderr);
                assert!(!outcome.stderr.contains("left out"), "{inputs:?}: {}", outcome.stderr);
            }
        }
    }
    for memory in [&[][..], &["--memory", "50K"]] {
        let words = ["convert", "ground.laz", "bare.xyz", "-o", "all.laz", "--force"];
        let outcome = folder.succeed(&[&words[..], memory].concat());
        let told = "ground.laz: not all inputs have ReturnNumber, Classification; left out";
        assert!(outcome.stderr.contains(told), "{}", outcome.stderr);
    }
}
