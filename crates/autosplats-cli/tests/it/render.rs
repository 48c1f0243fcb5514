//! Output of `render`: pictures, layers, cameras and reports.

use crate::common::{FRONT, Folder, SPHERE_POINTS, ply, sphere_point};
use exr::prelude::{AnyChannels, FlatSamples, read_first_flat_layer_from_file};
use image::{ColorType, DynamicImage, GenericImageView as _};
use serde_json::Value;

const SIZE: [u32; 2] = [160, 120];

fn render(folder: &Folder, options: &[&str]) -> crate::common::Outcome {
    let size = format!("{}x{}", SIZE[0], SIZE[1]);
    folder.succeed(&[&["render", "sphere.ply", "--size", &size][..], options].concat())
}

fn png(folder: &Folder, name: &str) -> DynamicImage {
    let image = image::open(folder.path(name)).expect("the picture can be read");
    assert_eq!([image.width(), image.height()], SIZE, "{name} has the size asked for");
    image
}

/// Values of a channel, row by row.
fn channel<'a>(channels: &'a AnyChannels<FlatSamples>, name: &str) -> &'a FlatSamples {
    let found = channels.list.iter().find(|channel| channel.name.to_string() == name);
    &found.unwrap_or_else(|| panic!("there is a channel {name}")).sample_data
}

fn float(channels: &AnyChannels<FlatSamples>, name: &str, [x, y]: [u32; 2]) -> f32 {
    match channel(channels, name) {
        FlatSamples::F32(values) => values[(y * SIZE[0] + x) as usize],
        _ => panic!("channel {name} holds 32-bit floats"),
    }
}

fn index(channels: &AnyChannels<FlatSamples>, [x, y]: [u32; 2]) -> u32 {
    match channel(channels, "index") {
        FlatSamples::U32(values) => values[(y * SIZE[0] + x) as usize],
        _ => panic!("channel index holds whole numbers"),
    }
}

#[test]
fn pictures_have_the_surface_in_the_middle_and_the_background_around() {
    let folder = Folder::with_sphere();
    render(&folder, &[&FRONT[..], &["-o", "plain.png", "--background", "#0000ff", "--quiet"]].concat());
    let image = png(&folder, "plain.png");
    assert_eq!(image.color(), ColorType::Rgb8, "there is no alpha to keep");
    assert_eq!(image.get_pixel(0, 0).0, [0, 0, 255, 255], "a corner shows the background");
    let [red, green, blue, _] = image.get_pixel(80, 60).0;
    assert!(red > green && green > blue, "the middle shows the points' brown, not {red} {green} {blue}");

    render(&folder, &[&FRONT[..], &["-o", "clear.png", "--background", "transparent"]].concat());
    let image = png(&folder, "clear.png");
    assert_eq!(image.color(), ColorType::Rgba8, "alpha was asked for");
    assert_eq!([image.get_pixel(0, 0).0[3], image.get_pixel(80, 60).0[3]], [0, 255], "and tells surface from nothing");

    render(&folder, &[&FRONT[..], &["-o", "sky.png", "--background", "#ff0000,#0000ff"]].concat());
    let image = png(&folder, "sky.png");
    let [top, bottom] = [image.get_pixel(0, 0).0, image.get_pixel(0, 119).0];
    assert!(top[0] > 250 && bottom[2] > 250, "red above, blue below, not {top:?} {bottom:?}");
}

#[test]
fn supersampled_pictures_are_the_same_but_smoother() {
    let folder = Folder::with_sphere();
    let soft = |supersample: &str| {
        let options = ["-o", "clear.png", "--background", "transparent", "--supersample", supersample];
        render(&folder, &[&FRONT[..], &options].concat());
        let image = png(&folder, "clear.png").into_rgba8();
        assert_eq!([image.get_pixel(0, 0).0[3], image.get_pixel(80, 60).0[3]], [0, 255], "surface and nothing");
        image.pixels().filter(|pixel| (1..255).contains(&pixel.0[3])).count()
    };
    let [plain, fine] = ["1", "3"].map(soft);
    assert!(plain > 0 && fine > plain, "pixels covered in part: {plain}, supersampled {fine}");
}

#[test]
fn stills_are_supersampled_unless_they_have_layers() {
    let folder = Folder::with_sphere();
    let written = |options: &[&str]| {
        render(&folder, &[&["-o", "a.png"], options].concat());
        folder.read("a.png")
    };
    let [one, two] = ["1", "2"].map(|factor| written(&["--supersample", factor]));
    assert!(one != two, "the factor can be seen");
    assert!(written(&[]) == two, "stills");
    assert!(written(&["-o", "a.exr"]) == one, "with layers");
    let frame = render(&folder, &["-o", "f.png", "--frames", "0", "--json"]).stdout;
    assert!(folder.read("f.png") == one, "a frame: {frame}");
}

#[test]
fn layers_hold_the_geometry() {
    let folder = Folder::with_sphere();
    render(&folder, &[&FRONT[..], &["-o", "layers.exr", "-o", "picture.png"]].concat());
    png(&folder, "picture.png");
    let layer = read_first_flat_layer_from_file(folder.path("layers.exr")).expect("the layers can be read").layer_data;
    let channels = layer.channel_data;
    let names: Vec<_> = channels.list.iter().map(|channel| channel.name.to_string()).collect();
    let all = ["A", "B", "G", "N.X", "N.Y", "N.Z", "R", "Z", "curvature", "index", "kradius", "radius"];
    assert_eq!(names, all, "these layers, in the format's own order");
    assert_eq!([layer.size.0, layer.size.1], SIZE.map(|side| side as usize), "every pixel is there");

    let middle = [80, 60];
    let at = |name| float(&channels, name, middle);
    assert_eq!(at("A"), 1.0, "the sphere is in the middle");
    assert!((at("Z") - 3.0).abs() < 0.01, "3 away from the eye, not {}", at("Z"));
    let normal = ["N.X", "N.Y", "N.Z"].map(at);
    assert!(normal[1] < -0.99, "the sphere faces the eye, not {normal:?}");
    let length = normal.iter().map(|component| component * component).sum::<f32>().sqrt();
    assert!((length - 1.0).abs() < 1e-3, "a normal has unit length, not {length}");
    // r = 2·sqrt(r_k²/k) holds for each splat [Paper, §6], so also for their weighted mean.
    let ratio = at("radius") / at("kradius");
    assert!((ratio - 2.0 / 10f32.sqrt()).abs() < 0.01, "radius over k-radius is {ratio}");
    assert!((0.0..0.1).contains(&at("curvature")), "a sphere is nearly flat, not {}", at("curvature"));
    let point = sphere_point(index(&channels, middle) as usize);
    assert!(point[1] < -0.99, "the point there is the sphere's foremost, not {point:?}");

    let corner = [0, 0];
    let at = |name| float(&channels, name, corner);
    assert_eq!([at("A"), at("R"), at("G"), at("B")], [0.0; 4], "nothing is in the corner");
    assert_eq!(at("Z"), f32::INFINITY, "and that is infinitely far");
    assert_eq!(index(&channels, corner), u32::MAX, "and no point");
    let mut covered = 0;
    for pixel in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y])) {
        let (alpha, z) = (float(&channels, "A", pixel), float(&channels, "Z", pixel));
        assert_eq!(alpha == 1.0, z.is_finite(), "alpha and depth agree at {pixel:?}");
        assert_eq!(
            alpha == 1.0,
            (index(&channels, pixel) as usize) < SPHERE_POINTS,
            "alpha and index agree at {pixel:?}"
        );
        covered += u32::from(alpha == 1.0);
    }
    // The sphere's outline has the radius 60 / tan 20° / sqrt(4² - 1) = 42.6 pixels.
    assert!((5300..6200).contains(&covered), "the sphere covers about 5690 pixels, not {covered}");
}

#[test]
fn every_color_mode_makes_its_own_picture() {
    let folder = Folder::with_sphere();
    let mut seen = Vec::new();
    for mode in ["rgb", "plain", "height", "intensity", "normal", "curvature", "radius", "k-radius", "depth"] {
        render(&folder, &[&FRONT[..], &["-o", "mode.png", "--color", mode, "--legend"]].concat());
        let picture = folder.read("mode.png");
        assert!(!seen.contains(&picture), "{mode} looks like another mode");
        seen.push(picture);
    }
    render(&folder, &[&FRONT[..], &["-o", "field.png", "--color", "field:Intensity", "--legend"]].concat());
    assert_eq!(folder.read("field.png"), seen[3], "a field by its name");
}

#[test]
fn every_look_changes_the_picture() {
    let folder = Folder::with_sphere();
    let base = [&FRONT[..], &["-o", "a.png", "--color", "height"]].concat();
    render(&folder, &base);
    let plain = folder.read("a.png");
    let looks: [&[&str]; 7] = [
        &["--range", "-5..5"],
        &["--color-map", "inferno"],
        &["--no-lighting"],
        &["--background", "#ffffff"],
        &["--splat-scale", "2"],
        &["-k", "30"],
        &["--ellipses"],
    ];
    for look in looks {
        render(&folder, &[&base[..], look].concat());
        assert!(folder.read("a.png") != plain, "{look:?} changes nothing");
    }
    // A sphere has no creases.
    let pictures = ["1", "3"].map(|strength| {
        folder.succeed(&["render", "scene:figure:5K", "--size", "160x100", "-o", "a.png", "--occlusion", strength]);
        folder.read("a.png")
    });
    assert!(pictures[0] != pictures[1], "occlusion changes nothing");
}

#[test]
fn dark_colours_are_shown_brighter_unless_it_is_forbidden() {
    let folder = Folder::new();
    let rows = (0..2000).map(|index| {
        let [x, y, z] = sphere_point(index);
        format!("{x} {y} {z} 60 50 40")
    });
    let properties = ["float x", "float y", "float z", "uchar red", "uchar green", "uchar blue"];
    folder.write("dark.ply", &ply(&properties, rows));
    let brightness = |options: &[&str]| {
        let outcome = folder.succeed(&[&["render", "dark.ply", "--size", "160x120", "-o", "a.png"], options].concat());
        let picture = image::open(folder.path("a.png")).expect("the picture can be read").to_rgb8();
        (picture.get_pixel(80, 60).0[0], outcome.stderr.contains("--exposure 1"))
    };
    let (usual, told) = brightness(&[]);
    let (left, told_then) = brightness(&["--exposure", "1"]);
    assert!(usual > 130 && told, "{usual}, told: {told}");
    assert!((40..70).contains(&left) && !told_then, "{left}, told: {told_then}");
    assert!(!brightness(&["--color", "height"]).1, "heights have no brightness");
}

#[test]
fn frames_are_as_bright_as_the_first() {
    let folder = Folder::new();
    let properties = ["float x", "float y", "float z", "uchar red", "uchar green", "uchar blue"];
    for (name, color) in [("f_0.ply", "80 80 80"), ("f_1.ply", "120 120 120")] {
        let rows = (0..2000).map(|index| {
            let [x, y, z] = sphere_point(index);
            format!("{x} {y} {z} {color}")
        });
        folder.write(name, &ply(&properties, rows));
    }
    let brightness = |name: &str| {
        let picture = image::open(folder.path(name)).expect("the picture can be read").to_rgb8();
        picture.get_pixel(80, 60).0[0]
    };
    let outcome = folder.succeed(&["render", "f_*.ply", "--size", "160x120", "-o", "p_%d.png"]);
    let [first, second] = ["p_0.png", "p_1.png"].map(brightness);
    assert!(outcome.stderr.contains("--exposure 1"), "it is told: {}", outcome.stderr);
    // Both are dark enough that each alone would be raised to the same brightness.
    assert!(first > 130 && second > first + 30, "{first}, then {second}");
}

#[test]
fn views_and_projections() {
    let folder = Folder::with_sphere();
    let mut seen = Vec::new();
    for view in ["iso", "front", "back", "left", "right", "top", "bottom"] {
        for ortho in [&[][..], &["--ortho", "fit"], &["--ortho", "3"]] {
            let options = ["-o", "v.png", "--view", view, "--color", "normal"];
            render(&folder, &[&options[..], ortho].concat());
            let picture = folder.read("v.png");
            assert!(!seen.contains(&picture), "{view} {ortho:?} looks like another view");
            seen.push(picture);
        }
    }
}

#[test]
fn a_saved_camera_takes_the_same_picture() {
    let folder = Folder::with_sphere();
    let cameras: [&[&str]; 4] = [
        &["--view", "iso"],
        &["--ortho", "2.5", "--view", "top"],
        &["--eye", "3,-4,2"],
        &["--eye", "1,2,3", "--look-at", "-0.1,0,0", "--up", "0,1,0", "--fov", "33.3"],
    ];
    for camera in cameras {
        render(&folder, &[camera, &["-o", "a.png", "--save-camera", "cam.json"]].concat());
        render(&folder, &["-o", "b.png", "--camera", "cam.json", "--save-camera", "again.json"]);
        assert_eq!(folder.read("a.png"), folder.read("b.png"), "{camera:?}: the picture is the same");
        assert_eq!(folder.read("cam.json"), folder.read("again.json"), "{camera:?}: the camera is the same");
    }
}

#[test]
fn axes_turn_the_view() {
    let folder = Folder::with_sphere();
    for (axes, up) in [("z-up", 2), ("y-up", 1)] {
        render(&folder, &["-o", "a.png", "--view", "front", "--axes", axes, "--save-camera", "cam.json"]);
        let camera: Value = serde_json::from_slice(&folder.read("cam.json")).expect("a camera is JSON");
        assert_eq!(camera["up"][up], 1.0, "{axes}: up in {camera}");
    }
}

#[test]
fn the_report_is_complete() {
    let folder = Folder::with_sphere();
    let arguments = ["-o", "a.png", "-o", "b.exr", "--save-camera", "cam.json", "--json", "--threads", "2"];
    let outcome = render(&folder, &[&FRONT[..], &arguments].concat());
    assert_eq!(outcome.stdout.lines().count(), 1, "one object on one line");
    let report: Value = serde_json::from_str(&outcome.stdout).expect("the report is JSON");

    let counts = &report["counts"];
    let count = |name: &str| counts[name].as_u64().unwrap_or_else(|| panic!("{name} is counted in {counts}"));
    assert_eq!(count("points"), SPHERE_POINTS as u64, "every point is counted");
    assert_eq!(count("dropped"), 0, "no point lies outside");
    assert_eq!(count("visible"), count("active") + count("passive"), "a visible point is active or passive");
    assert_eq!(count("outliers"), 0, "a sphere has none");
    assert!(count("clamped") <= 6, "but for a few at its rim, whose neighbours are hidden: {counts}");
    for stage in ["read", "project", "search", "fit", "splat", "shade", "write", "frame"] {
        assert!(report["timings_ms"][stage].as_f64().is_some_and(|time| time >= 0.0), "{stage} is timed");
    }
    assert_eq!(report["device"]["threads"], 2, "as many threads as asked for");
    assert!(["cpu", "gpu"].iter().any(|name| report["device"]["backend"] == *name), "the backend is named");
    assert_eq!(report["size"], serde_json::json!(SIZE), "the size is told");
    assert_eq!(report["camera"]["eye"], serde_json::json!([0.0, -4.0, 0.0]), "the camera is told");
    let outputs = report["outputs"].as_array().expect("the outputs are listed");
    for (output, name) in outputs.iter().zip(["a.png", "b.exr", "cam.json"]) {
        assert_eq!(output["path"], name, "in the order asked for");
        assert_eq!(output["bytes"], folder.read(name).len(), "{name} has this size");
    }
    assert_eq!(outputs.len(), 3, "nothing else was written");
}

#[test]
fn quiet_says_nothing() {
    let folder = Folder::with_sphere();
    let outcome = render(&folder, &["-o", "a.png", "--quiet"]);
    assert_eq!([outcome.stdout, outcome.stderr], ["", ""], "no news is good news");
    let outcome = render(&folder, &["-o", "a.png"]);
    assert_eq!(outcome.stdout, "", "the summary is for people");
    assert!(outcome.stderr.contains("a.png") && outcome.stderr.contains("6000 points"), "it says what was done");
}

#[test]
fn runs_and_threads_do_not_change_a_byte() {
    let folder = Folder::with_sphere();
    let options = ["-o", "a.png", "-o", "a.exr", "--ellipses", "--occlusion", "1"];
    let mut results = Vec::new();
    for threads in ["1", "2", "2", "3"] {
        render(&folder, &[&options[..], &["--threads", threads]].concat());
        results.push((folder.read("a.png"), folder.read("a.exr")));
    }
    assert!(results.windows(2).all(|pair| pair[0] == pair[1]), "the same command writes the same bytes");
}

#[test]
fn an_existing_picture_is_replaced_and_a_link_stays_one() {
    let folder = Folder::with_sphere();
    folder.write("a.png", "old");
    render(&folder, &["-o", "a.png"]);
    png(&folder, "a.png");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("a.png", folder.path("link.png")).expect("a link can be made");
        render(&folder, &["-o", "link.png", "--color", "normal"]);
        assert!(folder.path("link.png").is_symlink(), "the link is still one");
        assert_eq!(folder.read("link.png"), folder.read("a.png"), "and what it points to is new");
    }
    assert!(!folder.list().iter().any(|name| name.contains("tmp")), "no temporary file is left");
}

#[test]
fn several_inputs_are_shown_together_where_poses_put_them() {
    let folder = Folder::with_sphere();
    folder.write("aside.txt", "1 0 0 3\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
    std::fs::copy(folder.path("sphere.ply"), folder.path("second.ply")).expect("a file can be copied");
    let arguments = ["second.ply", "--pose", "second.ply=aside.txt", "-o", "two.exr", "--eye", "1.5,-9,0"];
    let outcome = render(&folder, &[&arguments[..], &["--look-at", "1.5,0,0", "--up", "0,0,1", "--json"]].concat());
    let report: Value = serde_json::from_str(&outcome.stdout).expect("the report is JSON");
    assert_eq!(report["counts"]["points"], 2 * SPHERE_POINTS, "both are there");
    let layer = read_first_flat_layer_from_file(folder.path("two.exr")).expect("the layers can be read").layer_data;
    // 60 / tan 20° / 9 pixels for a unit: the spheres are 27.5 to either side of the middle.
    for (x, covered) in [(80 - 27, 1.0), (80, 0.0), (80 + 27, 1.0)] {
        assert_eq!(float(&layer.channel_data, "A", [x, 60]), covered, "column {x}");
    }
}

#[test]
fn both_backends_make_the_same_files() {
    let folder = Folder::with_sphere();
    render(&folder, &["-o", "cpu.png", "-o", "cpu.exr", "--backend", "cpu"]);
    let arguments = ["render", "sphere.ply", "-o", "gpu.png", "-o", "gpu.exr", "--backend", "gpu", "--json"];
    let output = folder.command(&arguments).output().expect("the command starts");
    if output.status.code() == Some(5) {
        assert!(std::env::var_os("CI").is_none(), "there is no graphics device");
        eprintln!("nothing checked: there is no graphics device");
        return;
    }
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{error}");
    let report: Value = serde_json::from_slice(&output.stdout).expect("the report is JSON");
    assert_eq!(report["device"]["backend"], "gpu", "the backend is named");
    assert!(report["device"]["adapter"]["driver"].is_string(), "and the driver: {report}");
    let passes = report["passes"].as_array().expect("times are listed");
    assert!(
        passes.len() > 5 && passes.iter().all(|pass| pass["ms"].is_number()),
        "runs of passes are timed: {passes:?}"
    );
}

#[test]
fn a_bench_tells_every_stage() {
    let folder = Folder::new();
    let bench = ["bench", "--scene", "figure:5K", "--size", "160x120", "--frames", "3", "--backend", "cpu"];
    let text = folder.succeed(&bench).stdout;
    for said in ["figure:5K", "project", "search", "fit", "splat", "shade", "frame", "3 frames"] {
        assert!(text.contains(said), "'{said}' is not in\n{text}");
    }
    let json = folder.succeed(&[&bench[..], &["--json"]].concat()).stdout;
    let report: Value = serde_json::from_str(&json).expect("it is JSON");
    let run = &report["runs"][0];
    for times in [&run["timings_ms"]["frame"], &run["first_picture_ms"]] {
        assert!(times.as_f64().is_some_and(|ms| ms > 0.0), "{report}");
    }
    folder.fail(&["bench", "--scene", "cave"], 2, &["cathedral"]);
    folder.fail(&["bench", "--frames", "0"], 2, &["1 to 100000"]);
}

#[test]
fn jpegs_and_named_backgrounds() {
    let folder = Folder::with_sphere();
    let white = ["--background", "white", "--quiet"];
    render(&folder, &[&FRONT[..], &white, &["-o", "a.jpg", "-o", "b.JPEG", "-o", "c.png"]].concat());
    assert_eq!(folder.read("a.jpg"), folder.read("b.JPEG"), "of either extension");
    let [jpeg, png] = ["a.jpg", "c.png"].map(|name| image::open(folder.path(name)).expect("a picture").into_rgb8());
    assert_eq!(png.get_pixel(0, 0).0, [255; 3], "white");
    let off = jpeg.pixels().zip(png.pixels()).map(|(a, b)| a.0[0].abs_diff(b.0[0])).max();
    assert!(off < Some(32), "the same picture but for {off:?}");
    assert!(folder.read("a.jpg").len() < folder.read("c.png").len(), "and smaller");
}

#[test]
fn cameras_of_open3d_see_what_they_state() {
    let folder = Folder::with_sphere();
    // The camera in front of the sphere: 4 units away along y, a field of view of 40 degrees.
    let focal = 30.0 / 20.0_f64.to_radians().tan();
    let extrinsic = "[1,0,0,0, 0,0,1,0, 0,-1,0,0, 0,0,4,1]";
    let camera = |extra: &str, cx: f64| {
        format!(
            r#"{{{extra}"intrinsic": {{"width": 80, "height": 60, "intrinsic_matrix": [{focal},0,0,0,{focal},0,{cx},29.5,1]}}}}"#
        )
    };
    let posed = |cx| camera(&format!(r#""class_name": "PinholeCameraParameters", "extrinsic": {extrinsic}, "#), cx);
    folder.write("open3d.json", &posed(39.5));
    folder.write("aside.json", &posed(50.0));
    folder.write("unposed.json", &camera("", 39.5));
    let (size, quiet) = (["--size", "80x60"], "--quiet");
    folder.succeed(&[&["render", "sphere.ply", "-o", "a.png", quiet], &FRONT[..], &size].concat());
    folder.succeed(&[&["render", "sphere.ply", "-o", "b.png", "--camera", "open3d.json", quiet], &size[..]].concat());
    let [a, b] = ["a.png", "b.png"].map(|name| image::open(folder.path(name)).expect("a picture").into_rgb8());
    let off = a.pixels().zip(b.pixels()).filter(|(a, b)| a.0[0].abs_diff(b.0[0]) > 8).count();
    assert!(off < 20, "{off} pixels differ");
    let out = folder.succeed(&[&["render", "sphere.ply", "-o", "b.png", "--camera", "aside.json"], &size[..]].concat());
    assert!(out.stderr.contains("aside.json: its axis is put in the middle"), "{}", out.stderr);
    folder.fail(&["render", "sphere.ply", "-o", "c.png", "--camera", "unposed.json"], 2, &["without a pose", "--eye"]);
}

#[test]
fn dense_pictures_take_the_memory_that_is_asked_for() {
    let folder = Folder::new();
    let peak = |size: &str| {
        let outcome = folder.succeed(
            &[
                &["render", "scene:cathedral:800K", "-o", "a.png", "--supersample", "1", "--size", size][..],
                &["--backend", "cpu", "--json"],
            ]
            .concat(),
        );
        let report: Value = serde_json::from_str(&outcome.stdout).expect("JSON");
        report["memory"]["peak"].as_u64()
    };
    // Only some systems tell.
    let (Some(points), Some(all)) = (peak("8x8"), peak("960x540")) else { return };
    let (taken, told) = (all - points, 960 * 540 * autosplats::BYTES_PER_PIXEL);
    assert!(taken < told && taken + (64 << 20) > told, "{taken} bytes, not up to {told}");
}
