//! Generated files of every kind, read in parts.

use autosplats_cloud::{
    FieldValues, PointCloud, Random, Scan,
    glam::{DMat4, DQuat, DVec3},
};
use autosplats_formats::{ReadOptions, write};

use super::{COUNT, check_bytes, check_bytes_with, filters};
use crate::common::{colors, pcd_bytes, positions};

/// A PLY of such properties and rows, in each encoding.
fn plys(properties: &[(&str, &str)], rows: &[Vec<f64>]) -> [(String, Vec<u8>); 3] {
    ["ascii", "binary_little_endian", "binary_big_endian"].map(|encoding| {
        let mut bytes = format!("ply\nformat {encoding} 1.0\nelement vertex {}\n", rows.len()).into_bytes();
        for (name, kind) in properties {
            bytes.extend(format!("property {kind} {name}\n").bytes());
        }
        bytes.extend(b"end_header\n");
        for row in rows {
            for (value, (_, kind)) in row.iter().zip(properties) {
                macro_rules! put {
                    ($type:ty) => {{
                        let value = *value as $type;
                        match encoding {
                            "ascii" => bytes.extend(format!("{value} ").bytes()),
                            "binary_little_endian" => bytes.extend(value.to_le_bytes()),
                            _ => bytes.extend(value.to_be_bytes()),
                        }
                    }};
                }
                match *kind {
                    "uchar" => put!(u8),
                    "ushort" => put!(u16),
                    "uint" => put!(u32),
                    "float" => put!(f32),
                    _ => put!(f64),
                }
            }
            if encoding == "ascii" {
                bytes.push(b'\n');
            }
        }
        (format!("{encoding}.ply"), bytes)
    })
}

/// Rows of x, y and z as doubles about a place, and other values by `more`.
fn rows(place: DVec3, more: impl Fn(usize) -> Vec<f64>) -> Vec<Vec<f64>> {
    let positions = positions(COUNT).into_iter().enumerate();
    positions
        .map(|(i, position)| {
            let world = place + DVec3::from(position.map(f64::from)) / 3.0;
            world.to_array().into_iter().chain(more(i)).collect()
        })
        .collect()
}

const XYZ: [(&str, &str); 3] = [("x", "double"), ("y", "double"), ("z", "double")];

fn check_plys(properties: &[(&str, &str)], rows: &[Vec<f64>]) {
    for (name, bytes) in plys(&[&XYZ[..], properties].concat(), rows) {
        assert!(check_bytes(&name, &bytes), "{name}");
        // A file that is cut off in the middle of a record.
        assert!(check_bytes(&name, &bytes[..bytes.len() * 2 / 3 + 1]), "{name}, cut off");
    }
}

#[test]
fn ply_of_every_kind() {
    let far = DVec3::new(512_000.25, 5_400_000.5, 310.125);
    check_plys(&[], &rows(far, |_| Vec::new()));
    check_plys(
        &[("Classification", "uchar"), ("withheld", "uchar")],
        &rows(far, |i| vec![[2.0, 7.0, 5.0][i % 3], f64::from(u8::from(i % 50 == 0))]),
    );
    let rgb = |kind| [("red", kind), ("green", kind), ("blue", kind)];
    let tint = |scale: f64| move |i: usize| vec![(i % 250) as f64 * scale, (i / 9) as f64 * scale, scale];
    check_plys(&rgb("uchar"), &rows(DVec3::ZERO, tint(1.0)));
    check_plys(&rgb("ushort"), &rows(DVec3::ZERO, tint(257.0)));
    // The values that tell the scale, or that 8 bits do not keep, are in one part only.
    check_plys(&rgb("ushort"), &rows(DVec3::ZERO, |i| if i < 1500 { vec![1.0, 2.0, 0.0] } else { tint(251.0)(i) }));
    check_plys(&rgb("ushort"), &rows(DVec3::ZERO, |i| if i == 1500 { vec![300.0, 2.0, 0.0] } else { tint(1.0)(i) }));
    check_plys(&rgb("float"), &rows(DVec3::ZERO, tint(1.0 / 255.0)));
    check_plys(&rgb("float"), &rows(DVec3::ZERO, |i| if i == 1500 { vec![0.3, 1.5, 0.1] } else { tint(1.0)(i) }));
    check_plys(&rgb("ushort"), &rows(DVec3::ZERO, |_| vec![0.0; 3]));
    for alpha in [[255, 255], [255, 9], [7, 7]] {
        let packed = |i: usize| vec![f64::from(u32::from_be_bytes([alpha[usize::from(i == 1321)], i as u8, 2, 3]))];
        check_plys(&[("rgba", "uint")], &rows(DVec3::ZERO, packed));
        check_plys(&[("rgb", "uint"), ("Alpha", "float")], &rows(DVec3::ZERO, |i| [packed(i), vec![0.5]].concat()));
    }
    let splats = [("f_dc_0", "float"), ("f_dc_1", "float"), ("f_dc_2", "float"), ("opacity", "float")];
    check_plys(&splats, &rows(DVec3::ZERO, |i| vec![i as f64 / 1e4, -0.5, 9.0, f64::NAN]));
    // Names that come again.
    let twice = [("intensity", "float"), ("scalar_Intensity", "ushort"), ("Red", "uchar"), ("alpha", "uchar")];
    check_plys(&[&rgb("ushort")[..], &twice].concat(), &rows(far, |i| [tint(200.0)(i), vec![i as f64; 4]].concat()));
    // Degrees, by their shape and by their names.
    let globe = |i: usize| vec![8.5 + i as f64 * 1e-9, 47.25 + (i % 70) as f64 * 1e-8, 400.0 + (i % 9) as f64 * 11.0];
    let degrees: Vec<Vec<f64>> = (0..COUNT).map(globe).collect();
    check_plys(&[], &degrees);
    for (name, bytes) in plys(&[("longitude", "double"), ("latitude", "double"), ("z", "float")], &degrees) {
        assert!(check_bytes(&name, &bytes), "{name} with names of degrees");
    }
}

#[test]
fn missing_returns_and_values_that_are_no_numbers() {
    for place in [DVec3::ZERO, DVec3::new(512_000.0, 0.0, 0.0)] {
        for zeros in [0, 1, 2, 700, COUNT] {
            let mut rows = rows(place, |i| vec![i as f64]);
            rows.iter_mut().rev().take(zeros).for_each(|row| row[..3].fill(0.0));
            rows[7][0] = f64::NAN;
            rows[1500][2] = f64::INFINITY;
            rows[1501][..3].fill(f64::NAN);
            check_plys(&[("Intensity", "float")], &rows);
        }
    }
    // Smaller than any number in `f32`, so that rounding makes it zero.
    let tiny = rows(DVec3::ZERO, |_| Vec::new()).into_iter().map(|row| row.iter().map(|v| v * 1e-60).collect());
    check_plys(&[], &tiny.collect::<Vec<_>>());
    check_plys(&[], &[]);
}

/// A PCD of doubles with other lines of the header, in both encodings.
fn pcds(lines: &str, rows: &[Vec<f64>], names: &str) -> [(String, Vec<u8>); 2] {
    ["ascii", "binary"].map(|encoding| {
        let columns = names.split(' ').count();
        let each = |word: &str| vec![word; columns].join(" ");
        let (sizes, types, counts) = (each("8"), each("F"), each("1"));
        let header = format!(
            "FIELDS {names}\nSIZE {sizes}\nTYPE {types}\nCOUNT {counts}\n{lines}\nPOINTS {}\nDATA {encoding}\n",
            rows.len()
        );
        let mut bytes = header.into_bytes();
        for value in rows.iter().flat_map(|row| row.iter().zip(1..)) {
            match encoding {
                "ascii" => bytes.extend(format!("{}{}", value.0, if value.1 == columns { "\n" } else { " " }).bytes()),
                _ => bytes.extend(value.0.to_le_bytes()),
            }
        }
        (format!("{encoding}.pcd"), bytes)
    })
}

#[test]
fn pcd_of_every_kind() {
    for encoding in ["ascii", "binary", "binary_compressed"] {
        let in_parts = check_bytes("a.pcd", &pcd_bytes(encoding, COUNT));
        assert_eq!(in_parts, encoding != "binary_compressed", "{encoding}");
    }
    // An image of a wall, seen from the origin: rays at even angles.
    let (width, height) = (100, COUNT / 100);
    let ray = |i: usize| [(i % width) as f64 * 0.01 - 0.5, (i / width) as f64 * 0.01 - 0.2, 1.0];
    let wall: Vec<Vec<f64>> = (0..COUNT).map(|i| ray(i).map(|v| v * (2.0 + (i / 333) as f64)).to_vec()).collect();
    let mut with_gaps = wall.clone();
    with_gaps.iter_mut().step_by(7).for_each(|row| row.fill(0.0));
    with_gaps.iter_mut().skip(3).step_by(11).for_each(|row| row.fill(f64::NAN));
    let image = format!("WIDTH {width}\nHEIGHT {height}");
    let row = format!("WIDTH {COUNT}\nHEIGHT 1");
    for size in [&image, &row] {
        for viewpoint in ["0 0 0 1 0 0 0", "1 2 3 1 0 0 0", "9000 2 3 1 0 0 0", "0 0 0 0 0 0 0"] {
            for points in [&wall, &with_gaps, &rows(DVec3::new(5e5, 5e6, 0.0), |_| Vec::new())] {
                let lines = format!("{size}\nVIEWPOINT {viewpoint}");
                for (name, bytes) in pcds(&lines, points, "x y z") {
                    assert!(check_bytes(&name, &bytes), "{name}: {lines}");
                    assert!(check_bytes(&name, &bytes[..bytes.len() - 2100]), "{name}, cut off: {lines}");
                }
            }
        }
    }
    let colored = rows(DVec3::new(0.0, 0.0, 100.0), |i| vec![0.0, (i % 256) as f64, 9.0]);
    for (name, bytes) in pcds(&row, &colored, "x y z r g b") {
        assert!(check_bytes(&name, &bytes), "{name} with colours");
    }
}

/// Text rows of positions about a place, with more on each line.
fn lines(place: DVec3, digits: usize, more: impl Fn(usize) -> String) -> Vec<String> {
    let line = |(i, position): (usize, [f32; 3])| {
        let [x, y, z] = (place + DVec3::from(position.map(f64::from))).to_array();
        format!("{x:.digits$} {y:.digits$} {z:.digits$}{}", more(i))
    };
    positions(COUNT).into_iter().enumerate().map(line).collect()
}

fn check_text(name: &str, lines: &[String]) {
    assert!(check_bytes(name, (lines.join("\n") + "\n").as_bytes()), "{name}: {}", lines[0]);
}

#[test]
fn text_of_every_kind() {
    let far = DVec3::new(512_000.0, 5_400_000.0, 310.0);
    for (place, digits) in [(DVec3::ZERO, 3), (DVec3::ZERO, 12), (far, 3), (far, 9)] {
        check_text("a.xyz", &lines(place, digits, |_| String::new()));
    }
    let colors = colors(COUNT);
    let tint = |scale: f64| {
        let colors = &colors;
        move |i: usize| colors[i].map(|v| format!(" {}", f64::from(v) * scale)).concat()
    };
    check_text("bytes.xyz", &lines(far, 2, tint(1.0)));
    check_text("wide.xyz", &lines(far, 2, tint(257.0)));
    check_text("odd.xyz", &lines(far, 2, tint(255.5)));
    check_text("unit.xyz", &lines(far, 2, tint(1.0 / 255.0)));
    check_text("black.xyz", &lines(far, 2, |i| format!(" {} 0 1", i % 2)));
    // One row makes floats of all, or tells that they are no unit floats.
    for odd in ["0.5 1 1", "300 2 1", "2 1 1", "-1 0 0", "nan 1 1", "70000 1 1"] {
        check_text("mostly.xyz", &lines(far, 2, |i| if i == 1500 { format!(" {odd}") } else { " 1 0 1".into() }));
        check_text("nearly.xyz", &lines(far, 2, |i| if i == 1500 { format!(" {odd}") } else { tint(1.0)(i) }));
    }
    // Missing coordinates and values, comments, counts and words.
    let mut csv = vec!["x,y,z,Classification,Withheld,GpsTime".to_owned()];
    csv.extend(lines(far, 3, |i| format!(" {} {} {:.6}", [2, 7, 3][i % 3], i % 2, 3e8 + i as f64 / 7.0)));
    let mut csv: Vec<String> = csv.iter().map(|line| line.replace(' ', ",")).collect();
    check_text("all.csv", &csv);
    check_bytes_with("all.csv", csv.join("\n").as_bytes(), &filters());
    csv[1300] = ",,,2,0,1".into();
    csv[1400] = "512000.5,,7,2,0,1".into();
    csv[1450] = "512000.5,5400000,7,,0,".into();
    csv.insert(900, "# a comment".into());
    csv.insert(1700, "".into());
    csv.push("end of the survey".into());
    csv.push("signed: nobody".into());
    check_text("gaps.csv", &csv);
    csv.extend(lines(far, 3, |_| String::new()).into_iter().take(2));
    check_text("words.csv", &csv);
    let mut pts = vec![format!("{}", COUNT / 2)];
    pts.extend(lines(DVec3::ZERO, 4, |i| format!(" {} 9 8 7", i as i32 - 2048)));
    pts.insert(COUNT / 2 + 1, format!("{}", COUNT / 2));
    check_text("two.pts", &pts);
    pts[COUNT / 2 + 1] = format!("{COUNT}");
    check_text("short.pts", &pts);
    pts[0] = format!("{}", 2 * COUNT);
    check_text("cut_off.pts", &pts);
    check_text("broken.xyz", &[lines(far, 3, |_| String::new()), vec!["1 2".into(), "1 2 3".into()]].concat());
    let bytes = lines(far, 3, |_| String::new()).join("\r\n");
    assert!(check_bytes("mark.xyz", format!("\u{feff}{bytes}").as_bytes()), "with a mark, and no end of the last line");
    let long = format!("#{}\n", "-".repeat(200_000));
    assert!(check_bytes("long.xyz", format!("{long}1 2 3\n{long}4 5 6\n{bytes}\n{long}").as_bytes()), "long lines");
}

#[test]
fn text_without_heights_and_returns_and_in_other_units() {
    for none in ["-9999", "-9999.0", "-32768", "-99999", "-9998"] {
        for up in [0.0, 800.0, 20_000.0] {
            let mut rows = lines(DVec3::new(512_000.0, 5_400_000.0, up), 3, |_| String::new());
            rows[1321] = format!("512000 5400000 {none}");
            rows[17] = "512001 5400000 nan".into();
            check_text("heights.xyz", &rows);
            rows[99] = "512000 5400000 -32767".into();
            check_text("two.xyz", &rows);
        }
    }
    let header = |line: &str, rows: Vec<String>| [vec![line.to_owned()], rows].concat();
    for zeros in [1, 2, 900, COUNT] {
        let mut rows = lines(DVec3::ZERO, 5, |_| " 5".into());
        rows.iter_mut().skip(50).take(zeros).for_each(|row| *row = "0 -0 0.0 7".into());
        check_text("zeros.xyz", &rows);
        check_text("feet.csv", &header("easting_m northing_m elevation_ft intensity", rows.clone()));
    }
    let globe: Vec<String> =
        (0..COUNT).map(|i| format!("{} {} {}", 8.5 + i as f64 * 1e-9, 47.25, 400.0 + i as f64)).collect();
    check_text("globe.xyz", &globe);
    check_text("named.csv", &header("lon lat height", globe));
}

/// Scans with poses and without, with colours of 16 bits and fields that others lack.
fn scanned() -> PointCloud {
    let wide = |seed: usize| FieldValues::U16((0..COUNT).map(|i| (i * 601 + seed * 7919) as u16).collect());
    let mut cloud = PointCloud::new(DVec3::new(512_000.0, 5_400_000.0, 300.0), positions(COUNT))
        .with_residuals((0..COUNT).map(|i| [i as f32 * 1e-9; 3]).collect())
        .unwrap()
        .with_colors(colors(COUNT))
        .unwrap();
    for (seed, name) in ["Red", "Green", "Blue", "Intensity"].into_iter().enumerate() {
        cloud = cloud.with_field(name, wide(seed)).unwrap();
    }
    let times = (0..COUNT).map(|i| 3e8 + i as f64 / 7.0).collect();
    let cloud = cloud.with_field("GpsTime", FieldValues::F64(times)).unwrap();
    let at = |x: f64| DMat4::from_rotation_translation(DQuat::from_rotation_z(x), cloud.origin() + DVec3::X * x);
    let scan = |name: &str, pose, points| Scan { name: Some(name.into()), world_from_sensor: pose, points };
    let third = COUNT / 3;
    let far = DMat4::from_translation(DVec3::splat(-1e7));
    let scans = vec![
        scan("first", at(1.0), 0..third),
        scan("second", at(2.0), third + 5..2 * third),
        scan("far", far, 2 * third..2 * third + 100),
    ];
    cloud.with_scans(scans)
}

#[test]
fn e57_of_every_kind() {
    let bytes_of = |cloud: &PointCloud| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.e57");
        write(cloud, &path, &()).unwrap();
        std::fs::read(&path).unwrap()
    };
    let mut with_gaps = scanned();
    assert!(check_bytes("scanned.e57", &bytes_of(&with_gaps)));
    let bytes = bytes_of(&scanned());
    assert!(check_bytes("cut_off.e57", &bytes[..bytes.len() - 9000]));
    let classes = (0..COUNT).map(|i| [2, 7, 5][i % 3]).collect();
    with_gaps = with_gaps.with_field("Classification", FieldValues::U8(classes)).unwrap();
    assert!(check_bytes_with("classes.e57", &bytes_of(&with_gaps), &filters()));
    for zeros in [1, 2, 500, COUNT] {
        let zero = |(i, position): (usize, [f32; 3])| if i % (COUNT / zeros) == 0 { [0.0; 3] } else { position };
        let near: Vec<[f32; 3]> = positions(COUNT).into_iter().enumerate().map(zero).collect();
        let near = PointCloud::new(DVec3::ZERO, near).with_colors(colors(COUNT)).unwrap();
        assert!(check_bytes("zeros.e57", &bytes_of(&near)), "{zeros} points at the scanner");
        let scan = Scan { name: None, world_from_sensor: DMat4::IDENTITY, points: 0..COUNT / 2 };
        assert!(check_bytes("zeros.e57", &bytes_of(&near.with_scans(vec![scan]))), "{zeros} points of one scan");
    }
    let small = positions(COUNT).into_iter().map(|position| position.map(|value| value * 1e-4)).collect();
    assert!(check_bytes("small.e57", &bytes_of(&PointCloud::new(DVec3::ZERO, small))));
    assert!(check_bytes("empty.e57", &bytes_of(&PointCloud::default())));
    // More than a group of packets holds.
    let many = PointCloud::new(DVec3::ZERO, positions(200_000));
    let exact = ReadOptions { exact: true, ..ReadOptions::default() };
    assert!(check_bytes_with("many.e57", &bytes_of(&many), &[exact]));
}

#[test]
fn damaged_files_are_read_or_fail_alike() {
    let few: Vec<Vec<f64>> = rows(DVec3::new(0.0, 5e5, 0.0), |i| vec![i as f64]).into_iter().take(150).collect();
    let mut files: Vec<(String, Vec<u8>)> = plys(&[&XYZ[..], &[("red", "ushort")]].concat(), &few).into();
    files.extend(pcds("WIDTH 50\nHEIGHT 3", &few, "x y z intensity"));
    let text = lines(DVec3::ZERO, 3, |i| format!(" {i} 0 255")).into_iter().take(150);
    files.push(("a.csv".into(), format!("x y z r g b\n{}\n", text.collect::<Vec<_>>().join("\n")).into_bytes()));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.e57");
    let mut scanned = scanned();
    scanned.retain(|i| i % 13 == 0);
    write(&scanned, &path, &()).unwrap();
    files.push(("a.e57".into(), std::fs::read(&path).unwrap()));
    let mut random = Random::from_state(5);
    let options = [ReadOptions { exact: true, ..ReadOptions::default() }];
    for (name, bytes) in &files {
        for round in 0..60 {
            let mut bytes = bytes.clone();
            for _ in 0..=random.modulo(3) {
                // Headers matter more than values.
                let end = if round % 2 == 0 { bytes.len().min(300) } else { bytes.len() };
                let at = random.modulo(end);
                bytes[at] = match random.modulo(3) {
                    0 => random.bits() as u8,
                    1 => b' ',
                    _ => b'9',
                };
            }
            if round % 5 == 0 {
                bytes.truncate(random.modulo(bytes.len()));
            }
            check_bytes_with(name, &bytes, &options);
        }
    }
}
