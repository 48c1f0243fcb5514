//! Tests of E57: real files match other programs, written files come back unchanged, and broken files are reported.

use std::{
    path::Path,
    sync::Mutex,
    time::{Duration, Instant},
};

use crate::common::{rich_cloud, shared_data};
use autosplats_cloud::{
    Axes, Crs, FieldValues, PointCloud, Progress, Random, Scan, Unit,
    glam::{DMat4, DQuat, DVec3, EulerRot},
};
use autosplats_formats::{ReadOptions, describe, describe_bytes, read_bytes, read_with, write};

/// Stores the notes.
#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Progress for Notes {
    fn report(&self, _fraction: f32) {}

    fn note(&self, note: &str) {
        self.0.lock().unwrap().push(note.into());
    }
}

fn load(path: &Path, options: &ReadOptions) -> (PointCloud, Vec<String>) {
    let notes = Notes::default();
    let cloud = read_with(path, options, &notes).unwrap_or_else(|error| panic!("{error}"));
    (cloud, notes.0.into_inner().unwrap())
}

fn bounds(cloud: &PointCloud) -> [DVec3; 2] {
    (0..cloud.len())
        .map(|i| cloud.world_position(i))
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], point| [low.min(point), high.max(point)])
}

/// File, points, bounds, whether there are colours.
type Case = (&'static str, usize, [f64; 3], [f64; 3], bool);

#[rustfmt::skip]
const CASES: &[Case] = &[
    ("scans/bunny_float.e57", 30_571, [-0.094689, 0.040011, -0.061873], [0.061009, 0.187321, 0.058799], false),
    ("scans/bunny_scaledint19.e57", 30_571, [-0.094689, 0.040011, -0.061873], [0.061009, 0.187321, 0.058799], false),
    ("scans/pump_room.e57", 155_201, [-2.903763, -5.301102, -1.899704], [1.721603, -0.792648, 1.843002], true),
    ("scans/rgb_float.e57", 2_090, [-9.77953, 4.513879, 295.5247], [-6.774238, 7.51546, 298.5322], true),
    ("scans/spherical.e57", 180, [6.341362e-7, -0.4999986, 0.0], [1.0, 0.4999998, 0.9999997], false),
    ("scans/two_scans.e57", 6, [-44.11944, 0.7053028, -0.6077], [-42.6395, 2.0578, 0.6667], true),
    ("malformed/e57_read_error.e57", 2_651, [0.0; 3], [0.0; 3], true),
    ("malformed/e57_invalid_cv_header.e57", 0, [f64::INFINITY; 3], [f64::NEG_INFINITY; 3], false),
    ("malformed/e57_empty.e57", 0, [f64::INFINITY; 3], [f64::NEG_INFINITY; 3], false),
];

#[test]
fn real_files_are_what_others_say() {
    let Some(folder) = shared_data() else { return };
    for exact in [false, true] {
        for &(file, count, low, high, colored) in CASES {
            let (cloud, notes) = load(&folder.join(file), &ReadOptions { exact, ..ReadOptions::default() });
            assert_eq!((cloud.len(), cloud.colors().is_some()), (count, colored), "{file}");
            let [found_low, found_high] = bounds(&cloud);
            for (found, expected) in [(found_low, low), (found_high, high)] {
                let error = (found - DVec3::from(expected)).abs().max_element();
                assert!(count == 0 || error < 1e-6 * found.length().max(1.0), "{file}: {found} is not {expected:?}");
            }
            drop(notes);
        }
    }
}

pub(crate) fn exact() -> ReadOptions {
    ReadOptions { exact: true, ..ReadOptions::default() }
}

/// Writes a cloud and reads it back. Also returns the notes of writing.
fn round_trip(cloud: &PointCloud, options: &ReadOptions) -> (PointCloud, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.e57");
    let notes = Notes::default();
    write(cloud, &path, &notes).unwrap_or_else(|error| panic!("{error}"));
    (load(&path, options).0, notes.0.into_inner().unwrap())
}

fn check_positions(what: &str, back: &PointCloud, cloud: &PointCloud) {
    assert_eq!(back.len(), cloud.len(), "{what}: all points");
    for i in 0..cloud.len() {
        let (found, expected) = (back.world_position(i), cloud.world_position(i));
        let error = (found - expected).abs().max_element();
        assert!(error <= 1e-14 * expected.length().max(100.0), "{what}: point {i} is at {found}, not {expected}");
    }
}

#[test]
fn real_files_come_back() {
    let Some(folder) = shared_data() else { return };
    for &(file, ..) in CASES {
        let (cloud, _) = load(&folder.join(file), &exact());
        let (back, notes) = round_trip(&cloud, &exact());
        check_positions(file, &back, &cloud);
        assert_eq!((back.colors(), back.fields()), (cloud.colors(), cloud.fields()), "{file}: colours and fields");
        assert_eq!(back.crs(), cloud.crs(), "{file}: the coordinate system");
        // Points of no scan come back as one scan.
        assert!(cloud.scans().is_empty() || back.scans() == cloud.scans(), "{file}: scans");
        assert_eq!(notes, [""; 0], "{file}: nothing is lost");
    }
}

#[test]
fn fields_of_every_type_come_back() {
    // More points than a packet holds, one point, and none.
    for count in [0, 1, 5, 20_000] {
        let mut random = Random::from_state(9);
        let mut values = |least: u64| (0..count).map(|_| random.bits() >> 1 | least).collect::<Vec<u64>>();
        let cloud = rich_cloud(count)
            .with_field("big", FieldValues::I64(values(0).into_iter().map(|v| v as i64 - (1 << 62)).collect()))
            .unwrap()
            .with_field("ReturnNumber", FieldValues::U8(values(1).into_iter().map(|v| v as u8 | 1).collect()))
            .unwrap()
            .with_field("NumberOfReturns", FieldValues::U8(values(1).into_iter().map(|v| v as u8).collect()))
            .unwrap();
        let (back, notes) = round_trip(&cloud, &exact());
        assert_eq!((back.positions(), back.colors()), (cloud.positions(), cloud.colors()), "{count}: every bit");
        assert_eq!(notes, ["E57 does not store which axis is up"], "{count}: told");
        assert_eq!(back.fields().len(), if count == 0 { back.fields().len() } else { cloud.fields().len() }, "{count}");
        for field in back.fields() {
            if field.name == "ReturnNumber" {
                // E57 stores one less, so the value 256 is possible and the type is wider.
                let same =
                    (0..count).all(|i| field.values.get(i) == cloud.field("ReturnNumber").unwrap().values.get(i));
                assert!(same, "{count}: returns");
                continue;
            }
            assert_eq!(Some(field), cloud.field(&field.name), "{count}: {}", field.name);
        }
    }
}

/// Two scans with poses, and points of no scan before, between and after them.
pub(crate) fn posed() -> PointCloud {
    let mut random = Random::from_state(7);
    let positions: Vec<[f32; 3]> =
        (0..100).map(|_| [random.unit() as f32 * 50.0, random.unit() as f32 * 50.0, random.unit() as f32]).collect();
    let residuals = (0..100).map(|_| [random.unit() as f32 * 1e-7; 3]).collect();
    let normal = |axis: usize| {
        let values = positions.iter().map(|position| DVec3::from(position.map(f64::from)).normalize()[axis] as f32);
        FieldValues::F32(values.collect())
    };
    let wide = |seed: usize| FieldValues::U16((0..100).map(|i| (i * 601 + seed * 7919) as u16).collect());
    let pose = |angle: f64, x: f64| {
        let rotation = DQuat::from_euler(EulerRot::XYZ, angle, 0.3, -angle);
        DMat4::from_rotation_translation(rotation, DVec3::new(512_000.25 + x, 5_400_000.0, 310.0))
    };
    let scan = |name: &str, angle, points| Scan {
        name: Some(name.into()),
        world_from_sensor: pose(angle, angle * 7.0),
        points,
    };
    let fields = [("Red", wide(1)), ("Green", wide(2)), ("Blue", wide(3))];
    let normals = [("NormalX", normal(0)), ("NormalY", normal(1)), ("NormalZ", normal(2))];
    let time = ("GpsTime", FieldValues::F64((0..100).map(|i| 3.1e8 + f64::from(i) / 3.0).collect()));
    let mut cloud = PointCloud::new(DVec3::new(512_000.0, 5_400_000.0, 300.0), positions.clone())
        .with_residuals(residuals)
        .unwrap();
    for (name, values) in fields.into_iter().chain(normals).chain([time]) {
        cloud = cloud.with_field(name, values).unwrap();
    }
    let crs = Crs { unit: Some(Unit::Metre), epsg: Some(25832), name: Some("EPSG:25832".into()), ..Crs::default() };
    cloud.with_scans(vec![scan("second <&> \"one\"", 2.0, 60..90), scan("first", 0.5, 10..40)]).with_crs(crs)
}

#[test]
fn poses_scans_and_wide_colours_come_back() {
    let cloud = posed();
    let (back, notes) = round_trip(&cloud, &exact());
    assert_eq!(notes, [""; 0], "nothing is lost");
    // Points of no scan come last.
    let order: Vec<usize> = (10..40).chain(60..90).chain(0..10).chain(40..60).chain(90..100).collect();
    assert_eq!(back.len(), 100, "all points");
    for (i, &from) in order.iter().enumerate() {
        let error = (back.world_position(i) - cloud.world_position(from)).abs().max_element();
        // A step of f64 at 5.4e6 is 1e-9.
        assert!(error < 4e-9, "point {i} is off by {error}");
        for (name, tolerance) in
            [("NormalX", 1e-9), ("NormalY", 1e-9), ("NormalZ", 1e-9), ("Red", 0.0), ("GpsTime", 0.0)]
        {
            let value = |cloud: &PointCloud, i| cloud.field(name).unwrap().values.get(i);
            let error = (value(&back, i) - value(&cloud, from)).abs();
            assert!(error <= tolerance, "{name} of point {i} is off by {error}");
        }
    }
    assert_eq!(
        back.scans().iter().map(|scan| scan.points.clone()).collect::<Vec<_>>(),
        [0..30, 30..60],
        "scans; no scanner saw the rest"
    );
    for (scan, expected) in back.scans().iter().zip([&cloud.scans()[1], &cloud.scans()[0]]) {
        assert_eq!(scan.name, expected.name, "names, whatever is in them");
        let same = scan.world_from_sensor.abs_diff_eq(expected.world_from_sensor, 1e-14);
        assert!(same, "{} is not {}", scan.world_from_sensor, expected.world_from_sensor);
    }
    assert_eq!((back.crs(), back.axes()), (cloud.crs(), Some(Axes::ZUp)), "metadata");
    assert_eq!(
        back.colors().unwrap()[0],
        [6010 + 7919, 6010 + 15838, 6010 + 23757].map(|v: u16| (v >> 8) as u8),
        "8 bits"
    );

    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["a.e57", "b.e57"].map(|name| folder.path().join(name));
    write(&cloud, &first, &()).unwrap();
    write(&cloud, &second, &()).unwrap();
    assert!(std::fs::read(&first).unwrap() == std::fs::read(&second).unwrap(), "the same cloud, the same file");
    let description = describe(&first, &ReadOptions::default()).unwrap();
    assert!(description.format.starts_with("E57 1.0 (autosplats"), "{}", description.format);
    assert_eq!((description.points, description.scans.len()), (Some(100), 2), "those of scanners");
    let attribute =
        |name: &str| &description.attributes.iter().find(|attribute| attribute.name == name).unwrap().stored;
    assert_eq!((&**attribute("colorRed"), &**attribute("nor:normalX")), ("int 16 bit", "float64"), "types");
    let [low, high] = description.bounds.unwrap();
    for i in 0..back.len() {
        let point = back.world_position(i);
        assert!((low - 1e-6).cmple(point).all() && point.cmple(high + 1e-6).all(), "bounds hold point {i}");
    }
}

#[test]
fn what_somebody_could_stand_in_has_z_up() {
    let scan = Scan { name: None, world_from_sensor: DMat4::from_translation(DVec3::Z), points: 0..9 };
    let z_up = Some(Axes::ZUp);
    for (size, scans, axes) in [(0.9, vec![], None), (1.1, vec![], z_up), (0.9, vec![scan], z_up)] {
        let mut positions = vec![[0.0; 3]; 9];
        (positions[3], positions[7]) = ([0.5 * size, f32::NAN, 0.0], [0.1, 0.2, size]);
        let cloud = PointCloud::new(DVec3::new(0.0, 500.0, 0.0), positions).with_scans(scans).with_axes(Axes::ZUp);
        let (back, notes) = round_trip(&cloud, &ReadOptions::default());
        assert_eq!(back.axes(), axes, "{size} metres, {} scans", cloud.scans().len());
        assert_eq!(notes.join("").contains("which axis is up"), axes.is_none(), "{size} metres: {notes:?}");
    }
}

#[test]
fn points_without_position_are_invalid() {
    let mut positions = crate::common::positions(9);
    positions[4] = [f32::NAN; 3];
    positions[6][1] = f32::INFINITY;
    let cloud = PointCloud::new(DVec3::ZERO, positions.clone());
    let (back, _) = round_trip(&cloud, &ReadOptions::default());
    let kept: Vec<_> = positions.iter().filter(|position| position.iter().all(|v| v.is_finite())).copied().collect();
    assert_eq!(back.positions(), kept, "dropped");
    let (back, _) = round_trip(&cloud, &ReadOptions { keep_no_returns: true, ..ReadOptions::default() });
    assert_eq!((back.len(), back.positions()[8]), (9, positions[8]), "kept if wanted");
    assert!(back.positions()[4][0].is_nan() && back.positions()[6][0].is_nan(), "as no numbers");
}

#[test]
fn what_cannot_be_held_is_told() {
    let mirror = DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
    let scan = |points| Scan { name: None, world_from_sensor: mirror, points };
    let cloud = PointCloud::new(DVec3::ZERO, crate::common::positions(3))
        .with_field("two words", FieldValues::U8(vec![1, 2, 3]))
        .unwrap()
        .with_field("two_words", FieldValues::U8(vec![4, 5, 6]))
        .unwrap()
        .with_field("1st", FieldValues::U64(vec![u64::MAX, 0, 1 << 60]))
        .unwrap()
        .with_scans(vec![scan(0..2), scan(1..3)])
        .with_crs(Crs { unit: Some(Unit::Foot), ..Crs::default() });
    let (back, notes) = round_trip(&cloud, &ReadOptions::default());
    let names: Vec<_> = back.fields().iter().map(|field| &*field.name).collect();
    assert_eq!(names, ["two_words", "two_words_", "_1st"], "names are made fit");
    assert_eq!(back.fields()[1].values, FieldValues::U8(vec![4, 5, 6]), "and keep their values");
    assert_eq!(back.fields()[2].values.get(0), u64::MAX as f64, "as near as floats come");
    let all = notes.join("\n");
    for words in ["metres", "'two words' is called two_words", "63 bits", "several scans share", "scale or mirror"] {
        assert!(all.contains(words), "'{words}' is not in: {all}");
    }
}

#[test]
fn coordinates_are_written_in_metres() {
    let place = DVec3::new(635_619.0, 848_899.0, 400.0);
    let pose = DMat4::from_translation(place + 10.0);
    let scans = vec![Scan { name: None, world_from_sensor: pose, points: 0..50 }];
    let cloud = |crs: Crs| PointCloud::new(place, crate::common::positions(50)).with_scans(scans.clone()).with_crs(crs);
    let exact = ReadOptions { exact: true, ..ReadOptions::default() };
    let (foot, survey) = (0.3048, 1200.0 / 3937.0);
    let us = Some(Unit::UsSurveyFoot);
    for (unit, vertical_unit, scale, told) in [
        (Unit::Foot, None, DVec3::splat(foot), "coordinates in foot are scaled"),
        (Unit::UsSurveyFoot, None, DVec3::splat(survey), "coordinates in US survey foot are scaled"),
        (Unit::Metre, us, DVec3::new(1.0, 1.0, survey), "coordinates in metre, heights in US survey foot"),
        (Unit::Millimetre, None, DVec3::splat(0.001), "coordinates in millimetre"),
        (Unit::Metre, None, DVec3::ONE, ""),
    ] {
        let cloud = cloud(Crs { unit: Some(unit), vertical_unit, epsg: Some(2992), ..Crs::default() });
        let (back, notes) = round_trip(&cloud, &exact);
        let off = |i| (back.world_position(i) - cloud.world_position(i) * scale).abs().max_element();
        assert!((0..50).map(off).fold(0.0, f64::max) < 1e-8, "{unit:?}: every digit");
        assert!(
            (back.scans()[0].position() - (place + 10.0) * scale).abs().max_element() < 1e-8,
            "{unit:?}: the scanner"
        );
        assert_eq!(back.crs().unit, Some(Unit::Metre), "{unit:?}");
        assert_eq!(back.crs().epsg, told.is_empty().then_some(2992), "{unit:?}: a system in feet is not of metres");
        let converted = notes.iter().any(|note| note.contains("E57 requires metres") && note.contains(told));
        assert_eq!(converted, !told.is_empty(), "{unit:?}: {notes:?}");
    }
    let degrees = Crs { unit: Some(Unit::Degree), vertical_unit: Some(Unit::Metre), ..Crs::default() };
    let points = vec![[0.0; 3], [0.01, 0.01, 30.0]];
    let cloud = PointCloud::new(DVec3::new(-94.0, 31.0, 5.0), points).with_crs(degrees);
    let (back, notes) = round_trip(&cloud, &exact);
    // 0.01° at 31° north is 955 m to the east and 1108.7 m to the north.
    let size = back.world_position(1) - back.world_position(0);
    assert!((size - DVec3::new(955.2, 1108.7, 30.0)).abs().max_element() < 1.0, "{size}");
    assert!(notes.iter().any(|note| note.contains("degrees become metres")), "{notes:?}");
}

/// Writes a cloud to bytes.
pub(crate) fn written(cloud: &PointCloud) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.e57");
    write(cloud, &path, &()).unwrap();
    std::fs::read(path).unwrap()
}

/// CRC-32C bit by bit, independent of the code under test.
pub(crate) fn checksum(data: &[u8]) -> [u8; 4] {
    let step = |crc: u32| if crc & 1 == 1 { crc >> 1 ^ 0x82f6_3b78 } else { crc >> 1 };
    let crc = data.iter().fold(u32::MAX, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), |crc, _| step(crc)));
    (!crc).to_be_bytes()
}

/// Replaces text in a file's data by text of the same length, and recomputes the checksums.
fn changed(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    let mut data: Vec<u8> = bytes.chunks(1024).flat_map(|page| &page[..1020]).copied().collect();
    let to = format!("{to:<width$}", width = from.len());
    let at = data.windows(from.len()).position(|window| window == from.as_bytes());
    let at = at.unwrap_or_else(|| panic!("there is no {from}"));
    data.splice(at..at + from.len(), to.into_bytes());
    data.chunks(1020).flat_map(|page| [page, &checksum(page)].concat()).collect()
}

pub(crate) fn message(bytes: &[u8]) -> String {
    let result = read_bytes(Path::new("a.e57"), bytes, &ReadOptions::default(), &());
    let message = result.map(|cloud| cloud.len()).unwrap_err().to_string();
    assert!(!message.contains(char::is_control), "one line: {message:?}");
    message
}

#[test]
fn checksums_are_those_of_the_standard() {
    assert_eq!(checksum(b"123456789"), 0xe306_9283_u32.to_be_bytes(), "the known value");
    let bytes = written(&posed());
    for (index, page) in bytes.chunks(1024).enumerate() {
        assert_eq!(page[1020..], checksum(&page[..1020]), "page {index}");
    }
}

#[test]
fn damage_costs_its_scan() {
    let bytes = written(&posed());
    let whole = changed(&bytes, "recordCount", "recordCount");
    assert!(whole == bytes, "the test's own checksums");
    // The first scan is in pages 1 and 2, the second in pages 2 to 4.
    for (at, kept, name) in [(100, 70, "scan 1 'first'"), (2600, 70, "scan 2 'second")] {
        let mut damaged = bytes.clone();
        damaged[at] ^= 4;
        let notes = Notes::default();
        let cloud = read_bytes(Path::new("a.e57"), &damaged, &ReadOptions::default(), &notes);
        let notes = notes.0.into_inner().unwrap().join("\n");
        let page = format!("byte {}: the checksum of page {}", at / 1024 * 1024, at / 1024 + 1);
        assert!(notes.contains(name) && notes.contains(&page), "{notes}: not {name}, {page}");
        assert_eq!(cloud.unwrap().len(), kept, "the other scans are read");
    }
    let mut damaged = bytes.clone();
    let last = damaged.len() - 600;
    damaged[last] ^= 1;
    assert!(message(&damaged).contains("checksum of page"), "the XML section is needed");
    damaged = written(&PointCloud::new(DVec3::ZERO, crate::common::positions(300)));
    damaged[2000] ^= 1;
    assert!(message(&damaged).contains("byte 1024: scan 1: the checksum of page 2 is wrong"), "{}", message(&damaged));
}

#[test]
fn claims_that_lie_are_refused() {
    let cloud = PointCloud::new(DVec3::ZERO, crate::common::positions(300));
    let cloud = cloud.with_field("Intensity", FieldValues::U8(vec![3; 300])).unwrap();
    let bytes = written(&cloud);
    let single = "<cartesianX type=\"Float\" precision=\"single\"/>";
    let cases = [
        ("type=\"Float\" precision=\"single\"", "type=\"Complex\"", "unknown type 'Complex'"),
        ("minimum=\"0\" maximum=\"255\"", "minimum=\"9\" maximum=\"1\"", "minimum 9 is above maximum 1"),
        ("minimum=\"0\" maximum=\"255\"", "minimum=\"x\"", "'x' is not an integer"),
        (single, "", "a packet of 4 values where points have 3"),
        ("fileOffset=\"48\"", "fileOffset=\"4\"", "no compressed vector"),
        ("<e57Root", "<f57Root", "e57Root"),
        ("cartesianY", "cartesianQ", "neither x, y and z"),
        ("recordCount=\"300\"", "recordCount=\"-30\"", "'-30' is not a valid recordCount"),
    ];
    for (from, to, words) in cases {
        let lie = changed(&bytes, from, to);
        let message = message(&lie);
        assert!(message.contains(words) && message.contains("a.e57: "), "{from} to {to}: {message}");
    }
    // More points claimed than values stored: the stored ones are read.
    let more = changed(&bytes, "recordCount=\"300\"", "recordCount=\"999\"");
    let notes = Notes::default();
    let cloud = read_bytes(Path::new("a.e57"), &more, &ReadOptions::default(), &notes).unwrap();
    let notes = notes.0.into_inner().unwrap().join("\n");
    assert!(cloud.len() == 300 && notes.contains("end after 300 of 999 points"), "{} {notes}", cloud.len());
    let whole = ReadOptions { whole: true, ..ReadOptions::default() };
    let refused = read_bytes(Path::new("a.e57"), &more, &whole, &()).map(|cloud| cloud.len()).unwrap_err().to_string();
    assert!(
        refused.contains("end after 300 of 999 points") && refused.ends_with("--salvage takes what is left"),
        "{refused}"
    );
    // Constants would take no bytes, but no file has them only.
    let boast = changed(&bytes, "recordCount=\"300\"", "recordCount=\"18446744073709551615\"");
    let about = describe_bytes(Path::new("a.e57"), &boast, &ReadOptions::default()).unwrap();
    assert_eq!(about.points, None, "no more than the file can hold");
    assert!(about.notes.iter().any(|note| note.contains("18446744073709551615 points, which")), "{:?}", about.notes);
}

#[test]
fn points_that_are_nowhere_are_told() {
    let mut places = crate::common::positions(9);
    places[4][1] = f32::NAN;
    let (back, notes) = round_trip(&PointCloud::new(DVec3::ZERO, places).with_axes(Axes::ZUp), &exact());
    assert_eq!(back.len(), 8, "marked as invalid");
    assert!(notes.iter().any(|note| note.starts_with("1 points without finite coordinates")), "{notes:?}");
}

#[test]
fn changes_that_checksums_do_not_tell() {
    let bytes = written(&posed());
    let data: Vec<u8> = bytes.chunks(1024).flat_map(|page| &page[..1020]).copied().collect();
    let mut random = Random::from_state(11);
    for round in 0..1500 {
        let mut lie = data.clone();
        // Headers of file and section, packets, and the XML section at the end.
        let [start, len] = [[0, 120], [48, 6000], [lie.len() - 7000, 7000]][round % 3];
        for _ in 0..=random.modulo(3) {
            let at = start + random.modulo(len);
            lie[at] = [random.bits() as u8, 0, 0xff, b'9', lie[at] ^ 1 << random.modulo(8)][random.modulo(5)];
        }
        let lie: Vec<u8> = lie.chunks(1020).flat_map(|page| [page, &checksum(page)].concat()).collect();
        let start = Instant::now();
        let result = read_bytes(Path::new("a.e57"), &lie, &exact(), &());
        assert!(start.elapsed() < Duration::from_secs(20), "round {round} took {:?}", start.elapsed());
        match result {
            Ok(cloud) => assert!(cloud.len() <= lie.len(), "round {round}: {} points", cloud.len()),
            Err(error) => {
                let message = error.to_string();
                assert!(!message.contains(char::is_control), "round {round}: one line: {message:?}");
            }
        }
    }
}

/// A file with this XML section after `data`.
pub(crate) fn file(data: &[u8], xml: &str) -> Vec<u8> {
    let mut all = b"ASTM-E57".to_vec();
    let len = (48 + data.len() + xml.len()).div_ceil(1020) as u64 * 1024;
    let start = (48 + data.len()) as u64;
    let words = [1, len, start / 1020 * 1024 + start % 1020, xml.len() as u64, 1024];
    all.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    all.extend([data, xml.as_bytes()].concat());
    all.resize(all.len().next_multiple_of(1020), 0);
    all.chunks(1020).flat_map(|page| [page, &checksum(page)].concat()).collect()
}
