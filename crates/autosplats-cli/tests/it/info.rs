//! `info`: its reports as text and as JSON.

use crate::common::{Folder, SPHERE_POINTS, data, ply, points_ply};
use serde_json::Value;

/// A flat grid of 50 x 40 points, 0.25 units apart, at survey coordinates. A fifth is ground, the rest buildings.
fn grid_ply() -> String {
    let rows = (0..2000).map(|i| {
        let (x, y) = (500_000.0 + f64::from(i % 50) * 0.25, 5_400_000.0 + f64::from(i / 50) * 0.25);
        format!("{x} {y} 12.5 {} {}", if i % 5 == 0 { 2 } else { 6 }, i % 64)
    });
    ply(&["double x", "double y", "double z", "uchar Classification", "ushort Intensity"], rows)
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// The report of one input.
fn report(folder: &Folder, arguments: &[&str]) -> Value {
    json(&folder.succeed(&[&["info", "--json"], arguments].concat()).stdout)
}

fn attribute<'a>(report: &'a Value, name: &str) -> &'a Value {
    let attributes = report["attributes"].as_array().expect("attributes are a list");
    attributes.iter().find(|found| found["name"] == name).unwrap_or_else(|| panic!("{name} is not in {attributes:?}"))
}

#[test]
fn a_grid_is_what_it_was_made_as() {
    let folder = Folder::new();
    folder.write("grid.ply", &grid_ply());
    let report = report(&folder, &["grid.ply"]);
    assert_eq!(report["input"], "grid.ply", "as typed");
    assert_eq!(report["points"], 2000, "points");
    assert_eq!(report["bounds"]["min"], json("[500000.0, 5400000.0, 12.5]"), "every digit");
    assert_eq!(report["bounds"]["max"], json("[500012.25, 5400009.75, 12.5]"), "every digit");
    assert_eq!(report["bounds"]["size"], json("[12.25, 9.75, 0.0]"), "size");
    assert_eq!(report["spacing"]["median"], 0.25, "spacing");
    assert_eq!(report["spacing"]["samples"], 2000, "all points were asked");
    let density = report["density"]["median"].as_f64().expect("a number");
    // The twelfth neighbour on a grid is two steps away: 12 / (π 0.5²).
    assert!((density - 12.0 / (std::f64::consts::PI * 0.25)).abs() < 1e-9, "density {density}");
    assert_eq!([&report["duplicates"], &report["not_finite"]], [0, 0], "nothing is wrong with it");
    assert_eq!(report["axes"], json(r#"{"name": "z-up", "guessed": true}"#), "flat");

    let classes = attribute(&report, "Classification");
    assert_eq!(classes["stored"], "uint8", "as the file has it");
    let expected =
        r#"[{"value": 2.0, "count": 400, "name": "ground"}, {"value": 6.0, "count": 1600, "name": "building"}]"#;
    assert_eq!(classes["values"], json(expected), "classes and their names");
    let intensity = attribute(&report, "Intensity");
    assert_eq!([&intensity["min"], &intensity["max"]], [0.0, 63.0], "values");
    let edges = intensity["histogram"]["edges"].as_array().expect("edges");
    let counts = intensity["histogram"]["counts"].as_array().expect("counts");
    assert_eq!([edges.len(), counts.len()], [33, 32], "edges around 32 bins");
    assert_eq!(counts.iter().filter_map(Value::as_u64).sum::<u64>(), 2000, "each point is in one");
}

#[test]
fn text_says_the_same() {
    let folder = Folder::new();
    folder.write("grid.ply", &grid_ply());
    let text = folder.succeed(&["info", "grid.ply"]).stdout;
    for said in
        ["grid.ply", "2,000", "12.25", "0.25 to the nearest point", "none", "ground", "building", "80.00 %", "█"]
    {
        assert!(text.contains(said), "'{said}' is not in\n{text}");
    }
    assert!(text.contains("5400009.75"), "every digit of coordinates:\n{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 100), "no line is longer than 100 columns:\n{text}");
    assert!(!text.contains('\x1b'), "no colours where there is no terminal");
}

#[test]
fn nothing_that_is_no_number_gets_into_json() {
    let folder = Folder::new();
    let rows = ["nan 0 0 1", "inf 1 1 nan", "0 0 0.5 inf", "1 1 1 -inf", "1 1 1 2", "1 1 1 2"].map(str::to_owned);
    folder.write("odd.ply", &ply(&["float x", "float y", "float z", "float value"], rows.into_iter()));
    let report = report(&folder, &["odd.ply"]);
    assert_eq!([&report["points"], &report["not_finite"], &report["duplicates"]], [6, 2, 2], "counts");
    assert_eq!(report["bounds"]["max"], json("[1.0, 1.0, 1.0]"), "bounds of what has a place");
    assert_eq!(attribute(&report, "value")["not_finite"], 3, "of each attribute too");
    assert_eq!(attribute(&report, "value")["max"], 2.0, "the rest counts");
    let text = folder.succeed(&["info", "odd.ply"]).stdout;
    assert!(text.contains("2 (33.3 %) without a finite position"), "{text}");

    folder.write("none.ply", &points_ply(&["nan nan nan"; 3]));
    let report = json(&folder.succeed(&["info", "none.ply", "--json"]).stdout);
    assert_eq!([&report["bounds"], &report["spacing"]], [&Value::Null; 2], "no point has a place");
    assert_eq!(report["warnings"][0], "no position is finite", "it says so");
}

#[test]
fn one_bad_file_does_not_hide_the_others() {
    let folder = Folder::with_sphere();
    folder.write("bad.ply", "ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\nend_header\n1\n");
    let outcome = folder.run(&["info", "sphere.ply", "bad.ply", "missing.las", "scene:figure:2K"]);
    assert_eq!(outcome.code, Some(3), "{}", outcome.stderr);
    assert!(outcome.stdout.contains("6,000") && outcome.stdout.contains("2,000"), "good ones: {}", outcome.stdout);
    let errors: Vec<_> = outcome.stderr.lines().collect();
    assert_eq!(errors.len(), 2, "one line for each: {errors:?}");
    assert!(errors[0].starts_with("error: bad.ply: ") && errors[1].starts_with("error: missing.las: "), "{errors:?}");

    let outcome = folder.run(&["info", "--json", "sphere.ply", "bad.ply", "missing.las", "scene:figure:2K"]);
    assert_eq!(outcome.code, Some(3), "{}", outcome.stderr);
    let reports = json(&outcome.stdout);
    let names = [0, 1, 2, 3].map(|index| reports[index]["input"].as_str().unwrap_or_default());
    assert_eq!(names, ["sphere.ply", "bad.ply", "missing.las", "scene:figure:2K"], "in the order typed");
    assert_eq!([&reports[0]["error"], &reports[3]["error"]], [&Value::Null; 2], "good ones");
    assert!(reports[1]["error"].as_str().is_some_and(|error| error.starts_with("bad.ply: ")), "{}", reports[1]);
    assert_eq!([&reports[0]["points"], &reports[3]["points"]], [SPHERE_POINTS, 2000], "what they hold");
}

#[test]
fn errors_of_one_file_are_one_line() {
    let folder = Folder::new();
    folder.fail(&["info", "missing.ply"], 3, &["missing.ply"]);
    folder.fail(&["info", "."], 3, &["folder"]);
    folder.write("unknown.doc", "no points\n");
    folder.fail(&["info", "unknown.doc"], 3, &["unknown.doc", "PLY"]);
    folder.fail(&["info", "scene:statu"], 2, &["statue"]);
    folder.fail(&["info"], 2, &["INPUT"]);
    let outcome = folder.run(&["info", "unknown.doc", "--json"]);
    assert_eq!(outcome.code, Some(3), "the code says it");
    assert!(json(&outcome.stdout)["error"].is_string(), "and so does the object");
}

#[test]
fn what_the_header_says_of_a_broken_file_is_shown() {
    let folder = Folder::new();
    let whole = crate::common::sphere_ply();
    let (first, rest) = whole.split_at(whole.len() / 2);
    folder.write("broken.ply", &format!("{first}oops{rest}"));
    let outcome = folder.run(&["info", "broken.ply"]);
    assert_eq!(outcome.code, Some(3), "{}", outcome.stderr);
    assert!(outcome.stdout.contains("6,000"), "what the header promises: {}", outcome.stdout);
    assert!(outcome.stdout.contains("could not be read"), "and that it is not kept: {}", outcome.stdout);
    assert_eq!(outcome.stderr.lines().count(), 1, "{}", outcome.stderr);
}

#[test]
fn notes_and_contradictions_are_warnings() {
    let folder = Folder::new();
    let mut points: Vec<[f32; 3]> =
        (0..100_u16).map(|i| [5_400_000.5 + f32::from(i / 10), f32::from(i % 10), 1.0]).collect();
    points.extend([[0.0; 3]; 2]);
    let header = ply(&["float x", "float y", "float z"], (0..102).map(|_| String::new()))
        .replace("ascii", "binary_little_endian");
    let mut bytes = header.trim_end().to_owned().into_bytes();
    bytes.push(b'\n');
    bytes.extend(points.iter().flatten().flat_map(|value| value.to_le_bytes()));
    std::fs::write(folder.path("coarse.ply"), bytes).expect("a file can be written");
    let outcome = folder.succeed(&["info", "coarse.ply", "--json"]);
    assert_eq!(outcome.stderr, "", "notes are in the report, not on standard error");
    let report = json(&outcome.stdout);
    assert_eq!([&report["points"], &report["points_in_header"]], [100, 102], "two places without a return");
    let warnings = report["warnings"].to_string();
    assert!(warnings.contains("2 of 102 points") && warnings.contains("(0, 0, 0)"), "{warnings}");
    assert!(warnings.contains("x in steps of 0.5"), "float32 has no more digits there: {warnings}");
    let text = folder.succeed(&["info", "coarse.ply"]).stdout;
    assert_eq!(text.matches("  warning: ").count(), 2, "{text}");
}

#[test]
fn text_has_the_digits_that_it_has() {
    // The text has more digits than the declared type.
    let folder = Folder::new();
    let rows: Vec<String> =
        (0..100).map(|i| format!("{} {} 1", 5_400_000.0 + 0.125 * f64::from(i / 10), i % 10)).collect();
    folder.write("fine.ply", &ply(&["float x", "float y", "float z"], rows.clone().into_iter()));
    let header = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 100\nHEIGHT 1\nPOINTS 100\nDATA ascii\n";
    folder.write("fine.pcd", &format!("{header}{}\n", rows.join("\n")));
    for name in ["fine.ply", "fine.pcd"] {
        let report = report(&folder, &[name]);
        assert_eq!([&report["spacing"]["median"], &report["warnings"]], [&json("0.125"), &json("[]")], "{name}");
        assert_eq!(attribute(&report, "x")["stored"], "text", "{name}");
    }
}

#[test]
fn colors_are_reported_as_stored() {
    let folder = Folder::new();
    let fields = ["float x", "float y", "float z", "ushort red", "ushort green", "ushort blue"];
    let rows = (0..20).map(|i| format!("{i} 0 0 {} 0 65535", 257 * i));
    folder.write("wide.ply", &ply(&fields, rows));
    folder.succeed(&["convert", "wide.ply", "wide.las"]);
    for name in ["wide.ply", "wide.las"] {
        let report = report(&folder, &["--scan", name]);
        let blue = attribute(&report, if name == "wide.ply" { "blue" } else { "Blue" });
        assert_eq!([&blue["max"], &blue["stored"]], [&json("255.0"), &json(r#""uint16, shown as 8 bits""#)], "{name}");
    }
    let text = folder.succeed(&["info", "wide.las", "--scan"]).stdout;
    assert!(text.contains("0 at every point: Intensity") && !text.contains("no values of their own"), "{text}");
    let rgb = "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n1 2 3 255\n4 5 6 7\n";
    folder.write("packed.pcd", rgb);
    let text = folder.succeed(&["info", "packed.pcd"]).stdout;
    assert!(text.contains("no values of their own (part of others, or not read): rgb"), "{text}");
}

#[test]
fn strips_have_faces() {
    let folder = Folder::new();
    let points = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 2 0\n";
    let strips = "element tristrips 1\nproperty list int int vertex_indices\nend_header\n";
    let text =
        ply(&["float x", "float y", "float z"], points.lines().map(str::to_owned)).replace("end_header\n", strips);
    folder.write("strip.ply", &format!("{}\n9 0 1 2 3 -1 2 3 4 1\n", text.trim_end()));
    assert_eq!(report(&folder, &["strip.ply"])["faces"], 4, "two in each strip");
}

#[test]
fn threads_change_nothing() {
    let folder = Folder::new();
    let of = |threads: &str| folder.succeed(&["info", "--json", "scene:herd:60K", "--threads", threads]).stdout;
    assert_eq!(of("1"), of("3"), "sums and samples are the same");
}

#[test]
fn a_scene_has_its_points() {
    let folder = Folder::new();
    let report = report(&folder, &["scene:statue:20K"]);
    assert_eq!([&report["points"], &report["scanned"]], [&Value::from(20_000), &Value::from(true)], "all are read");
    assert_eq!(report["format"], "generated scene", "no file");
    assert_eq!(attribute(&report, "red")["not_finite"], 0, "colours are values too");
}

#[test]
fn the_schema_is_documented() {
    let folder = Folder::with_sphere();
    let help = folder.succeed(&["info", "--help"]).stdout;
    let report = report(&folder, &["sphere.ply"]);
    let fields = report.as_object().expect("an object").keys();
    let missing: Vec<_> = fields.filter(|field| !help.contains(&format!("\n  {field} "))).collect();
    assert!(missing.is_empty(), "{missing:?} are not in the help:\n{help}");
    let inner = attribute(&report, "x").as_object().expect("an object").keys();
    let missing: Vec<_> = inner.filter(|field| !help.contains(field.as_str())).collect();
    assert!(missing.is_empty(), "{missing:?} are not in the help:\n{help}");
}

#[test]
fn real_scans_are_what_others_say() {
    let Some(data) = data() else { return };
    let folder = Folder::new();
    // Points, bounds, duplicates and points without a finite position, as counted by other programs.
    let known = [
        ("models/bunny.ply", 35_947, [-0.0946899, 0.0329874, -0.0618736, 0.0610091, 0.187321, 0.0587997], 0, 0),
        ("scans/autzen_trim.laz", 110_000, [636_001.8, 848_935.2, 406.26, 637_179.2, 849_497.9, 520.51], 0, 0),
        (
            "scans/courtyard_1p46M.laz",
            1_460_879,
            [406_047.0, 7_405_439.0, 517.898, 406_185.0, 7_405_572.0, 568.623],
            63,
            0,
        ),
        ("scans/five_people.pcd", 307_200, [-1.931119, -3.874923, 1.759, 2.988514, 1.140606, 9.757001], 0, 68_125),
        (
            "scans/isprs_samp11_utm_f32.pcd",
            38_010,
            [512_700.9, 5_403_548.0, 295.25, 512_834.8, 5_403_850.0, 404.08],
            213,
            0,
        ),
        ("scans/lion_takanawa.copc.laz", 341_989, [-4.99, 1.04, -3.45, -0.79, 6.72, 1.12], 66_134, 0),
        ("scans/bunny.pts", 30_571, [-0.094689, 0.040011, -0.061873, 0.061009, 0.187321, 0.058799], 0, 0),
    ];
    let paths = known.map(|(name, ..)| data.join(name).display().to_string());
    let mut arguments = vec!["info", "--scan", "--json"];
    arguments.extend(paths.iter().map(String::as_str));
    let reports = json(&folder.succeed(&arguments).stdout);
    for (index, (name, points, ends, duplicates, not_finite)) in known.into_iter().enumerate() {
        let report = &reports[index];
        assert_eq!(report["points"], points, "{name}");
        assert_eq!(report["duplicates"], duplicates, "{name}: duplicates");
        assert_eq!(report["not_finite"], not_finite, "{name}: points without a place");
        for (axis, expected) in ends.into_iter().enumerate() {
            let found = report["bounds"][["min", "max"][axis / 3]][axis % 3].as_f64().expect("a number");
            // The reference values have seven digits.
            assert!((found - expected).abs() <= expected.abs() * 1e-6, "{name}: {found}, not {expected}");
        }
    }
    assert_eq!(attribute(&reports[1], "Classification")["distinct"], 2, "classes 1 and 2");
    let steps = reports[4]["warnings"].to_string();
    assert!(steps.contains("y in steps of 0.5"), "every y of that file is a multiple of 0.5: {steps}");
}

#[test]
fn hostile_files_are_named_each() {
    let Some(data) = data() else { return };
    let folder = Folder::new();
    let entries = std::fs::read_dir(data.join("malformed")).expect("the folder can be read");
    let paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path().display().to_string()).collect();
    let mut arguments = vec!["info", "--json", "--scan"];
    arguments.extend(paths.iter().map(String::as_str));
    let outcome = folder.run(&arguments);
    assert_eq!(outcome.code, Some(3), "{}", outcome.stderr);
    let reports = json(&outcome.stdout);
    let reports = reports.as_array().expect("a list");
    assert_eq!(reports.len(), paths.len(), "each has its object");
    let bad = reports.iter().filter(|report| report["error"].is_string()).count();
    assert_eq!(outcome.stderr.lines().count(), bad, "a line for each: {}", outcome.stderr);
    assert!(bad > 5 && bad < paths.len(), "{bad} of {} are bad", paths.len());
}

/// Whether two values are the same, but for the last digits of sums.
fn alike(a: &Value, b: &Value) -> bool {
    use Value::{Array, Number, Object};
    match (a, b) {
        (Number(a), Number(b)) => {
            let [a, b] = [a, b].map(|number| number.as_f64().expect("a number"));
            (a - b).abs() <= 1e-9 * a.abs()
        }
        (Array(a), Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| alike(a, b)),
        (Object(a), Object(b)) => {
            a.len() == b.len() && a.iter().all(|(name, a)| b.get(name).is_some_and(|b| alike(a, b)))
        }
        (a, b) => a == b,
    }
}

#[test]
fn more_points_than_memory_holds_are_examined_in_parts() {
    let folder = Folder::new();
    folder.succeed(&["convert", "scene:figure:100K", "scan.laz"]);
    let scan = |options: &[&str]| -> Value {
        let outcome = folder.succeed(&[&["info", "scan.laz", "--scan", "--json"], options].concat());
        serde_json::from_str(&outcome.stdout).expect("JSON")
    };
    let (whole, parts) = (scan(&[]), scan(&["--memory", "5M"]));
    for (name, value) in whole.as_object().expect("an object") {
        assert!(alike(value, &parts[name]), "{name}: {value} and {}", parts[name]);
    }
    assert_eq!(parts["duplicates"], whole["duplicates"]);
    assert_eq!(parts["spacing"]["samples"], 10_000, "all samples are sure of their neighbours");
    folder.fail(&["info", "scan.laz", "--temp", "nowhere"], 4, &["nowhere"]);
}
