//! Tests of units: degrees in every format, and heights in another unit than x and y.

use std::{fmt::Write as _, path::Path};

use autosplats_cloud::{
    Axes, Crs, PointCloud, Unit,
    glam::{DVec3, dvec3},
};
use autosplats_formats::{ReadOptions, describe_bytes, read_bytes};

use crate::common::{
    field_file,
    las_files::{EXACT, Notes, file, load, written},
};

fn read(name: &str, bytes: &[u8], options: &ReadOptions) -> (PointCloud, String) {
    let notes = Notes::default();
    let cloud = read_bytes(Path::new(name), bytes, options, &notes).unwrap_or_else(|error| panic!("{name}: {error}"));
    (cloud, notes.notes.into_inner().unwrap().join("\n"))
}

/// Places of an object of 2 m in Zurich, in degrees and metres above the sea: a row of points a millimetre apart.
fn places() -> Vec<DVec3> {
    let step = 0.001 / 111_180.0;
    (0..2000).map(|i| dvec3(8.54, 47.37 + step * f64::from(i), 400.0 + 0.001 * f64::from(i))).collect()
}

/// Checks that the cloud is in degrees and keeps millimetres as metres on the ground.
fn check_metres(what: &str, mut cloud: PointCloud) {
    assert_eq!((cloud.crs().unit, cloud.crs().vertical_unit), (Some(Unit::Degree), Some(Unit::Metre)), "{what}");
    assert_eq!(cloud.axes(), Some(Axes::ZUp), "{what}: heights are upward");
    assert!(cloud.to_local_metres(), "{what}");
    for i in 1..cloud.len() {
        let way = cloud.world_position(i) - cloud.world_position(i - 1);
        let error = (way - dvec3(0.0, 0.001, 0.001)).abs().max_element();
        // A step of f32 at 400 m is 3e-5, at the object's size far less.
        assert!(error < 4e-5, "{what}: point {i} is {way} from the last");
    }
}

/// A PLY of doubles, in text or binary.
fn ply(names: [&str; 3], ascii: bool, points: &[DVec3]) -> Vec<u8> {
    let encoding = if ascii { "ascii" } else { "binary_little_endian" };
    let mut bytes = format!("ply\nformat {encoding} 1.0\nelement vertex {}\n", points.len());
    for name in names {
        let _ = writeln!(bytes, "property {} {name}", if ascii { "float" } else { "double" });
    }
    bytes += "end_header\n";
    let mut bytes = bytes.into_bytes();
    for point in points {
        if ascii {
            bytes.extend(format!("{} {} {}\n", point.x, point.y, point.z).bytes());
        } else {
            bytes.extend(point.to_array().iter().flat_map(|value| value.to_le_bytes()));
        }
    }
    bytes
}

/// A PCD of doubles.
fn pcd(names: [&str; 3], points: &[DVec3]) -> Vec<u8> {
    let mut bytes = format!(
        "VERSION 0.7\nFIELDS {}\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\nHEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n",
        names.join(" "),
        count = points.len()
    )
    .into_bytes();
    bytes.extend(points.iter().flat_map(|point| point.to_array()).flat_map(f64::to_le_bytes));
    bytes
}

fn text(header: &str, separator: &str, points: &[DVec3]) -> Vec<u8> {
    let rows = points.iter().map(|p| format!("{1}{0}{2}{0}{3}\n", separator, p.x, p.y, p.z));
    (header.to_owned() + &rows.collect::<String>()).into_bytes()
}

#[test]
fn degrees_keep_their_digits_in_every_format() {
    let points = places();
    let named = ["longitude", "latitude", "altitude"];
    let files = [
        ("a.csv", text("Longitude,Latitude,Altitude\n", ",", &points)),
        ("a.csv", text("lon;lat;h\n", ";", &points)),
        ("a.txt", text("# lng lat elevation\n", " ", &points)),
        ("a.xyz", text("", " ", &points)),
        ("a.ply", ply(named, false, &points)),
        ("a.ply", ply(["Lon", "Lat", "h"], true, &points)),
        ("a.ply", ply(["x", "y", "z"], false, &points)),
        ("a.ply", ply(["x", "y", "z"], true, &points)),
        ("a.pcd", pcd(named, &points)),
        ("a.pcd", pcd(["x", "y", "z"], &points)),
    ];
    for (name, bytes) in files {
        let head = String::from_utf8_lossy(&bytes[..bytes.len().min(120)]).into_owned();
        let known = ["lon", "lng"].iter().any(|word| head.to_lowercase().contains(word));
        for options in [&ReadOptions::default(), &EXACT] {
            let (cloud, notes) = read(name, &bytes, options);
            assert_eq!(notes.contains("look like degrees"), !known, "{head}: {notes}");
            check_metres(&head, cloud);
        }
    }
    let (cloud, _) = read("a.csv", &text("Longitude,Latitude,Altitude\n", ",", &points), &EXACT);
    for name in ["b.las", "b.laz"] {
        let (cloud, _) = load(&written(&cloud, name).0);
        check_metres(name, cloud);
    }
    for name in ["q_deg_2m.csv", "q_deg_2m.ply"] {
        let Some(bytes) = field_file(name) else { return };
        let (mut cloud, _) = read(name, &bytes, &ReadOptions::default());
        assert!(cloud.to_local_metres(), "{name}: degrees");
        let mut east: Vec<_> = (0..cloud.len()).map(|i| (cloud.world_position(i).x * 1e5).round() as i64).collect();
        east.sort_unstable();
        east.dedup();
        assert!(east.len() > 5000, "{name}: {} places from west to east", east.len());
        assert!((1.0..4.0).contains(&(1e-5 * (east[east.len() - 1] - east[0]) as f64)), "{name}: two metres");
    }
}

#[test]
fn what_is_no_degree_stays() {
    let metres: Vec<DVec3> = places().iter().map(|p| dvec3(p.x, p.y - 47.0 + 1000.0 * (p.z - 400.0), p.z)).collect();
    let wire: Vec<DVec3> = (0..100).map(|i| dvec3(1e-4 * f64::from(i % 3), 0.0, 0.1 * f64::from(i))).collect();
    for points in [&metres, &wire] {
        for (name, bytes) in [("a.xyz", text("", " ", points)), ("a.ply", ply(["x", "y", "z"], false, points))] {
            let (cloud, notes) = read(name, &bytes, &ReadOptions::default());
            assert_eq!((cloud.crs(), notes.contains("degrees")), (&Crs::default(), false), "{name}: {notes}");
        }
    }
    let named = ReadOptions { columns: Some(["x", "y", "z"].map(String::from).into()), ..ReadOptions::default() };
    let (cloud, _) = read("a.xyz", &text("", " ", &places()), &named);
    assert_eq!(cloud.crs().unit, None, "names of the caller are believed");
    let floats: Vec<u8> = places().iter().flat_map(|p| p.as_vec3().to_array()).flat_map(f32::to_le_bytes).collect();
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 2000\nproperty float x\nproperty float y\n\
                  property float z\nend_header\n";
    let (cloud, _) = read("a.ply", &[header.as_bytes(), &floats].concat(), &ReadOptions::default());
    assert_eq!(cloud.crs().unit, None, "floats have not the digits of degrees");
}

/// A LAS file with 1000 steps of 0.5 in each direction, and its coordinate system.
fn las(version: u8, wkt: Option<&str>, keys: &[[u16; 4]]) -> Vec<u8> {
    let mut vlrs = Vec::new();
    vlrs.extend(wkt.map(|text| ("LASF_Projection", 2112, text.as_bytes().to_vec())));
    if !keys.is_empty() {
        let keys = [&[[1, 1, 0, keys.len() as u16]], keys].concat();
        vlrs.push(("LASF_Projection", 34735, keys.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect()));
    }
    let point = |steps: i32| {
        let mut raw = vec![0; if version < 4 { 20 } else { 30 }];
        raw[..12].copy_from_slice([steps; 3].map(i32::to_le_bytes).as_flattened());
        raw[14] = 0x11;
        raw
    };
    let mut bytes = file(version, if version < 4 { 0 } else { 6 }, &vlrs, &[point(0), point(1000)]);
    for axis in 0..3 {
        bytes[179 + 16 * axis..][..8].copy_from_slice(&600_f64.to_le_bytes());
        bytes[187 + 16 * axis..][..8].copy_from_slice(&100_f64.to_le_bytes());
    }
    bytes
}

#[test]
fn heights_get_the_unit_of_x_and_y() {
    let unit = |name: &str, factor: f64| format!(r#"UNIT["{name}",{factor}]"#);
    let (metre, foot, survey) = (1.0, 0.3048, 1200.0 / 3937.0);
    let plane = |factor: f64| format!(r#"PROJCS["plane",GEOGCS["g"],{},AUTHORITY["EPSG","26917"]]"#, unit("u", factor));
    let heights = |factor: f64| format!(r#"VERT_CS["v",VERT_DATUM["d",2005],{}]"#, unit("u", factor));
    let compound = |a: f64, b: f64| format!(r#"COMPD_CS["c",{},{}]"#, plane(a), heights(b));
    let esri = |a: f64, b: f64| format!("{},{}", plane(a), heights(b).replace("VERT_CS", "VERTCS"));
    let (x_and_y, system) = (|code: u16| [3076, 0, 1, code], [3072, 0, 1, 26917]);
    let z = |code: u16| [4099, 0, 1, code];
    let files = [
        (las(4, Some(&compound(metre, survey)), &[]), survey, "US survey foot"),
        (las(4, Some(&compound(metre, foot)), &[]), foot, "heights in foot"),
        (las(4, Some(&esri(metre, foot)), &[]), foot, "heights in foot"),
        (las(4, Some(&compound(foot, metre)), &[]), 1.0 / foot, "heights in metre"),
        (las(4, Some(&compound(foot, survey)), &[]), survey / foot, "US survey foot"),
        (las(2, None, &[system, z(9003)]), survey, "US survey foot"),
        (las(2, None, &[system, [4096, 0, 1, 6360]]), survey, "US survey foot"),
        (las(2, None, &[x_and_y(9002), z(9001)]), 1.0 / foot, "heights in metre"),
        (las(2, Some(&plane(metre)), &[z(9002)]), foot, "heights in foot"),
        (las(4, Some(&compound(survey, survey)), &[]), 1.0, ""),
        (las(2, None, &[system]), 1.0, ""),
    ];
    for (bytes, scale, words) in files {
        for (name, options) in [("b.laz", ReadOptions::default()), ("b.las", EXACT)] {
            let (cloud, notes) = read("a.las", &bytes, &options);
            let size = cloud.world_position(1) - cloud.world_position(0);
            let exact = if options.exact { 1e-9 } else { 1e-4 };
            assert!((size - dvec3(500.0, 500.0, 500.0 * scale)).abs().max_element() < exact, "{words}: {size}");
            assert!((cloud.world_position(0).z - 100.0 * scale).abs() < exact, "{words}: from zero");
            assert_eq!(notes.contains("heights are scaled") && notes.contains(words), !words.is_empty(), "{notes}");
            assert_eq!(cloud.crs().vertical_unit, None, "{words}: one unit");
            assert!((cloud.resolution().unwrap() - dvec3(0.5, 0.5, 0.5 * scale)).length() < 1e-12, "{words}: steps");
            let about = describe_bytes(Path::new("a.las"), &bytes, &options).unwrap();
            let [low, high] = about.bounds.unwrap();
            assert!((low.z - 100.0 * scale).abs() < 1e-9 && (high.z - 600.0 * scale).abs() < 1e-9, "{words}: {low}");
            assert_eq!((about.crs, about.resolution), (cloud.crs().clone(), cloud.resolution()), "{words}");
            // A file written of the points is not scaled again.
            let (back, notes) = read("b.las", &written(&cloud, name).0, &EXACT);
            let off = |i| (back.world_position(i) - cloud.world_position(i)).abs().max_element();
            assert!((0..2).all(|i| off(i) < 1e-4) && !notes.contains("scaled"), "{words}: {notes}");
            assert_eq!((back.crs().unit, back.crs().epsg), (cloud.crs().unit, cloud.crs().epsg), "{words}");
        }
    }
    let Some(bytes) = field_file("l14b_metre_ftUS_height.las") else { return };
    let (cloud, notes) = read("l14b_metre_ftUS_height.las", &bytes, &ReadOptions::default());
    let heights = (0..cloud.len()).map(|i| cloud.world_position(i).z);
    let [low, high] = heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], z| [low.min(z), high.max(z)]);
    assert!((low + 6.0).abs() < 1e-3 && (high - 100.0).abs() < 1e-3, "{low} to {high} m: {notes}");
    assert!(notes.contains("heights in US survey foot"), "{notes}");
}

#[test]
fn heights_in_text_and_beside_degrees() {
    let rows = "1,2,10\n3,4,20\n";
    for (header, unit, height) in [
        ("x [m],y [m],z [ft]\n", Unit::Metre, 3.048),
        ("x [ft],y [ft],z [m]\n", Unit::Foot, 10.0 / 0.3048),
        ("x [m],y [m],z [m]\n", Unit::Metre, 10.0),
    ] {
        let (cloud, notes) = read("a.csv", (header.to_owned() + rows).as_bytes(), &EXACT);
        assert!((cloud.world_position(0).z - height).abs() < 1e-6, "{header}: {}", cloud.world_position(0));
        assert_eq!((cloud.crs().unit, cloud.crs().vertical_unit), (Some(unit), None), "{header}");
        assert_eq!(notes.contains("heights are scaled"), height != 10.0, "{header}: {notes}");
    }
    let (mut cloud, _) = read("a.csv", b"lon,lat,height [ft]\n8.5,47.3,1000\n8.5001,47.3,1100\n", &EXACT);
    assert_eq!(cloud.crs().vertical_unit, Some(Unit::Foot), "degrees stay, and so do the heights beside them");
    assert!(cloud.to_local_metres(), "degrees");
    let size = cloud.world_position(1) - cloud.world_position(0);
    assert!((size - dvec3(7.559, 0.0, 30.48)).abs().max_element() < 1e-2, "{size}");
}
