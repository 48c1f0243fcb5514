//! Files read in parts: the same points as of the whole file, bit for bit, with the same notes and errors.

use std::{
    path::{Path, PathBuf},
    sync::Mutex,
};

use autosplats_cloud::{
    Clouds, Error, FieldValues, PointCloud, PointFilter, Progress, Random, Scan,
    glam::{DMat4, DQuat, DVec3},
};
use autosplats_formats::{ReadOptions, open_parts, open_parts_of, read_with, write};

use crate::common::{colors, pcd_bytes, positions, shared_data};

/// Sizes of parts: a few lines, some thousand records, and everything.
const SIZES: [usize; 3] = [1000, 20_000, 1 << 23];

#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Progress for Notes {
    fn report(&self, fraction: f32) {
        assert!((0.0..=1.0).contains(&fraction), "the fraction {fraction}");
    }

    fn note(&self, note: &str) {
        self.0.lock().unwrap().push(note.into());
    }
}

impl Notes {
    fn sorted(self) -> Vec<String> {
        let mut notes = self.0.into_inner().unwrap();
        notes.sort();
        notes
    }
}

/// The bytes of all values, since NaN is not equal to itself.
fn bits(values: &FieldValues) -> (&'static str, Vec<u8>) {
    macro_rules! bits {
        ($($variant:ident),*) => {
            match values {
                $(FieldValues::$variant(values) => {
                    (stringify!($variant), values.iter().flat_map(|value| value.to_le_bytes()).collect())
                })*
            }
        };
    }
    bits!(U8, I8, U16, I16, U32, I32, U64, I64, F32, F64)
}

fn float_bits(values: &[[f32; 3]]) -> Vec<[u32; 3]> {
    values.iter().map(|value| value.map(f32::to_bits)).collect()
}

/// Names and types of the attributes.
fn shape(cloud: &PointCloud) -> (bool, bool, Vec<(&str, &str)>) {
    let fields = cloud.fields().iter().map(|field| (&*field.name, bits(&field.values).0)).collect();
    (cloud.residuals().is_some(), cloud.colors().is_some(), fields)
}

/// Scans of the same sensor, one after another, as one.
fn joined(scans: &[Scan]) -> Vec<Scan> {
    let mut all: Vec<Scan> = Vec::new();
    for scan in scans.iter().filter(|scan| !scan.points.is_empty()) {
        match all.last_mut() {
            Some(last)
                if last.points.end == scan.points.start
                    && (&last.name, last.world_from_sensor) == (&scan.name, scan.world_from_sensor) =>
            {
                last.points.end = scan.points.end;
            }
            _ => all.push(scan.clone()),
        }
    }
    all
}

fn assert_same(found: &PointCloud, expected: &PointCloud, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}: number of points");
    assert_eq!(found.origin(), expected.origin(), "{what}: origin");
    assert_eq!(shape(found), shape(expected), "{what}: attributes");
    assert!(float_bits(found.positions()) == float_bits(expected.positions()), "{what}: positions");
    let residuals = |cloud: &PointCloud| cloud.residuals().map(float_bits);
    assert!(residuals(found) == residuals(expected), "{what}: residuals");
    assert!(found.colors() == expected.colors(), "{what}: colours");
    for (field, other) in found.fields().iter().zip(expected.fields()) {
        assert!(bits(&field.values) == bits(&other.values), "{what}: field {}", field.name);
    }
    let facts = |cloud: &PointCloud| (cloud.axes(), cloud.crs().clone(), cloud.resolution());
    assert_eq!(facts(found), facts(expected), "{what}: axes and coordinate system");
    assert_eq!(joined(found.scans()), joined(expected.scans()), "{what}: scans that have points");
}

/// Compares a file in parts of each size with the whole. Returns false if it has to be read whole.
fn check(path: &Path, options: &ReadOptions) -> bool {
    let notes = Notes::default();
    let whole = read_with(path, options, &notes);
    let notes = notes.sorted();
    let len = std::fs::metadata(path).unwrap().len();
    for size in SIZES.into_iter().filter(|size| len < 1000 * *size as u64) {
        let what = format!("{} in parts of {size} bytes, {options:?}", path.display());
        let own = Notes::default();
        let parts = match (open_parts_of(path, options, size, &own), &whole) {
            (Ok(None), _) => {
                assert_eq!(own.sorted(), [""; 0], "{what}: notes of what is read whole");
                return false;
            }
            (Ok(Some(parts)), _) => parts,
            (Err(error), Err(expected)) => {
                assert_eq!(error.to_string(), expected.to_string(), "{what}");
                continue;
            }
            (Err(error), Ok(_)) => panic!("{what}: {error}"),
        };
        let whole = whole.as_ref().unwrap_or_else(|error| panic!("{what}: no error, but {error}"));
        assert_eq!(own.sorted(), notes, "{what}: notes");
        // Parts are the same each time.
        for _ in 0..if size == SIZES[1] && len < 100_000 { 2 } else { 1 } {
            let again = Notes::default();
            let mut clouds = Vec::new();
            parts
                .read(&again, &mut |cloud| {
                    clouds.push(cloud.clone());
                    Ok(())
                })
                .unwrap();
            assert_eq!(again.sorted(), [""; 0], "{what}: notes while reading");
            assert_eq!(parts.points(), whole.len(), "{what}: number of points");
            if let Some(first) = clouds.first() {
                for cloud in &clouds {
                    assert!(!cloud.is_empty() && shape(cloud) == shape(first), "{what}: each part");
                    assert_eq!((cloud.origin(), cloud.crs()), (first.origin(), first.crs()), "{what}: each part");
                }
                assert_same(&PointCloud::joined(clouds.iter()), whole, &what);
            }
        }
    }
    true
}

/// Checks a file of such bytes with some options. Returns false if it has to be read whole.
fn check_bytes(name: &str, bytes: &[u8]) -> bool {
    let default = ReadOptions::default;
    let options = [
        ReadOptions { exact: true, ..default() },
        ReadOptions { keep_no_returns: true, ..default() },
        ReadOptions { keep: Some(PointFilter::usual()), ..default() },
    ];
    check_bytes_with(name, bytes, &options)
}

fn check_bytes_with(name: &str, bytes: &[u8], options: &[ReadOptions]) -> bool {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    options.iter().map(|options| check(&path, options)).fold(false, |any, in_parts| any || in_parts)
}

/// Filters, one of which keeps no point.
fn filters() -> Vec<ReadOptions> {
    let keep = |words: &str| Some(words.parse::<PointFilter>().unwrap());
    let options = ["ground,-withheld", "-5,-withheld", "7", "66", "2..7"];
    options.map(|words| ReadOptions { keep: keep(words), exact: true, ..ReadOptions::default() }).into()
}

fn files_in(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { files_in(&path, found) } else { found.push(path) }
    }
}

#[test]
fn real_files() {
    let Some(data) = shared_data() else { return };
    let mut files = Vec::new();
    files_in(&data, &mut files);
    files_in(&data.join("../field"), &mut files);
    files.sort();
    let mut in_parts = 0;
    for path in files {
        // One frame of each animation is enough.
        if path.to_string_lossy().contains("/animation/") && !path.ends_with("frame_000.ply") {
            continue;
        }
        let exact = ReadOptions { exact: true, ..ReadOptions::default() };
        let usual = ReadOptions { keep: Some(PointFilter::usual()), ..ReadOptions::default() };
        in_parts += [exact, usual].iter().filter(|options| check(&path, options)).count();
    }
    assert!(in_parts > 100, "only {in_parts} of the real files are read in parts");
}

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

const COUNT: usize = 2000;

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
            rows[99] = format!("512000 5400000 -32767");
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

#[test]
fn what_is_no_file_of_points_in_parts_is_read_whole_or_fails_alike() {
    let cube = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n";
    assert!(!check_bytes("cube.obj", cube), "a mesh");
    let ply = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    assert!(!check_bytes("mesh.ply", ply), "a mesh");
    for bytes in [&b""[..], b"ply\n", b"words alone\n", b"1 2\n", b"5\n1 2 3\n", b"\x1f\x8b\x08\x00"] {
        check_bytes("bad.ply", bytes);
        check_bytes("bad.xyz", bytes);
    }
}

#[test]
fn a_file_that_changes_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    write(&PointCloud::new(DVec3::ZERO, positions(COUNT)), &path, &()).unwrap();
    let parts = open_parts(&path, &ReadOptions::default(), &()).unwrap().expect("it is a PLY");
    assert_eq!(Clouds::name(&parts), path);
    let count = || {
        let mut points = 0;
        parts.read(&(), &mut |cloud| {
            points += cloud.len();
            Ok(())
        })?;
        Ok::<_, Error>(points)
    };
    assert_eq!(count().unwrap(), COUNT);
    write(&PointCloud::new(DVec3::ZERO, positions(COUNT + 1)), &path, &()).unwrap();
    let error = count().unwrap_err().to_string();
    assert!(error.contains("a.ply") && error.contains("changed"), "{error}");
    std::fs::remove_file(&path).unwrap();
    assert!(matches!(count(), Err(Error::Io { .. })), "it is gone");
}

#[test]
fn reading_can_be_cancelled() {
    struct Cancelled;
    impl Progress for Cancelled {
        fn report(&self, _fraction: f32) {}

        fn cancelled(&self) -> bool {
            true
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    write(&PointCloud::new(DVec3::ZERO, positions(COUNT)), &path, &()).unwrap();
    assert!(matches!(open_parts(&path, &ReadOptions::default(), &Cancelled), Err(Error::Cancelled)));
    let parts = open_parts(&path, &ReadOptions::default(), &()).unwrap().expect("it is a PLY");
    assert!(matches!(parts.read(&Cancelled, &mut |_| panic!("no points are wanted")), Err(Error::Cancelled)));
}
