//! Tests of sensor files: bare sweeps, depth images, PCD; generated, and real ones from the shared set.

use std::{
    path::Path,
    sync::Mutex,
    time::{Duration, Instant},
};

use crate::common::{colors, pcd_bytes, positions, rich_cloud, shared_data};
use autosplats_cloud::{
    Axes, Error, FieldValues, PointCloud, Progress, Random, Scan, Unit,
    glam::{DMat4, DQuat, DVec3},
};
use autosplats_formats::{DepthCamera, ReadOptions, describe_bytes, read_bytes, read_with, write};

#[derive(Default)]
struct Ear(Mutex<Vec<String>>);

impl Progress for Ear {
    fn report(&self, _fraction: f32) {}

    fn note(&self, note: &str) {
        self.0.lock().unwrap().push(note.into());
    }
}

fn noted(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<(PointCloud, Vec<String>), Error> {
    let ear = Ear::default();
    let cloud = read_bytes(Path::new(name), bytes, options, &ear)?;
    Ok((cloud, ear.0.into_inner().unwrap()))
}

fn load(name: &str, bytes: &[u8]) -> PointCloud {
    noted(name, bytes, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}")).0
}

fn error(name: &str, bytes: &[u8]) -> String {
    noted(name, bytes, &ReadOptions::default()).unwrap_err().to_string()
}

fn bounds(cloud: &PointCloud) -> [DVec3; 2] {
    let points = (0..cloud.len()).map(|i| cloud.world_position(i)).filter(|point| point.is_finite());
    points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], point| [low.min(point), high.max(point)])
}

fn names(cloud: &PointCloud) -> Vec<&str> {
    cloud.fields().iter().map(|field| field.name.as_str()).collect()
}

#[test]
fn too_few_columns_are_told() {
    let named = |names: &str| {
        let columns = Some(names.split(',').map(str::to_owned).collect());
        ReadOptions { columns, ..ReadOptions::default() }
    };
    for (width, names, told) in [
        (4, "x,y,z", Some("points of 4 floats (x y z intensity)")),
        (5, "x,y,z,Intensity", Some("points of 5 floats")),
        (4, "x,y,z,-", None),
        (3, "x,y,z", None),
    ] {
        let (_, notes) = noted("a.bin", &sweep(600, width), &named(names)).unwrap();
        let found = notes.iter().any(|note| told.is_some_and(|told| note.contains(told) && note.contains("'-'")));
        assert_eq!(found, told.is_some(), "{names} of {width}: {notes:?}");
    }
    let says_itself = |notes: Vec<String>| notes.iter().any(|note| note.contains("--columns is for text"));
    let text = b"1 2 3\n4 5 6\n";
    assert!(!says_itself(noted("a.xyz", text, &named("x,y,z")).unwrap().1), "text is what it is for");
    assert!(!says_itself(noted("a.pcd", text, &named("x,y,z")).unwrap().1), "whatever it is called");
    let ply =
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\nend_header\n1 2 3\n";
    assert!(says_itself(noted("a.ply", ply, &named("x,y,z")).unwrap().1), "PLY names its own");
}

/// Rows of floats: x y z, then intensity and ring as far as `columns` allows.
fn sweep(count: usize, columns: usize) -> Vec<u8> {
    let mut random = Random::from_state(9);
    let rows = positions(count).into_iter().enumerate();
    let row = |(i, [x, y, z]): (usize, [f32; 3])| [x, y - 0.5, z - 1.0, random.unit() as f32, (i % 32) as f32];
    rows.map(row).flat_map(|row| row[..columns].to_vec()).flat_map(f32::to_le_bytes).collect()
}

#[test]
fn sweeps_of_every_width() {
    for (columns, fields) in [(3, &[][..]), (4, &["Intensity"]), (5, &["Intensity", "Ring"])] {
        // Divisible by every width, so the values decide.
        let (cloud, notes) = noted("a.bin", &sweep(600, columns), &ReadOptions::default()).unwrap();
        assert_eq!((cloud.len(), names(&cloud), cloud.axes()), (600, fields.to_vec(), Some(Axes::ZUp)), "{columns}");
        assert_eq!(
            cloud.scans()[0],
            Scan { name: None, world_from_sensor: DMat4::IDENTITY, points: 0..600 },
            "{columns}"
        );
        assert!(notes[0].starts_with("columns taken for x y z") && notes[0].contains("--columns"), "{notes:?}");
        let expected: Vec<_> = positions(600).iter().map(|[x, y, z]| [*x, y - 0.5, z - 1.0]).collect();
        assert_eq!(cloud.positions(), expected, "{columns}: the bits of the file");
        let description = describe_bytes(Path::new("a.bin"), &sweep(600, columns), &ReadOptions::default()).unwrap();
        assert_eq!((description.points, description.attributes.len()), (Some(600), columns), "{columns}: described");
    }
    let options = |names: &str| ReadOptions {
        columns: Some(names.split(' ').map(String::from).collect()),
        ..ReadOptions::default()
    };
    let (cloud, notes) = noted("a.bin", &sweep(600, 5), &options("z y x - t")).unwrap();
    assert_eq!((names(&cloud), notes.len()), (vec!["t"], 0), "columns by name");
    assert_eq!(cloud.positions()[7][2], positions(600)[7][0], "in that order");
    let message = noted("a.bin", &sweep(601, 5), &options("x y z i")).unwrap_err().to_string();
    assert!(message.contains("byte 12020") && message.contains("--columns"), "{message}");
    // No return.
    let mut bytes = sweep(600, 4);
    bytes[..16].fill(0);
    assert_eq!(load("a.bin", &bytes).len(), 599, "a point in the sensor is none");
}

#[test]
fn other_files_are_no_sweeps() {
    let integers: Vec<u8> = (0..900_u32).flat_map(u32::to_le_bytes).collect();
    let text = b"oid sha256:0123456789abcdef01\nan explanation in place of a file, as servers write it\n".to_vec();
    let mut random = Random::from_state(4);
    let noise: Vec<u8> = (0..6000).map(|_| random.bits() as u8).collect();
    let doubles: Vec<u8> = positions(60).into_iter().flatten().flat_map(|v| f64::from(v).to_le_bytes()).collect();
    for (what, bytes) in [
        ("integers", integers),
        ("text", text),
        ("noise", noise),
        ("doubles", doubles),
        ("zeros", vec![0; 6000]),
        ("odd", vec![1; 7]),
    ] {
        let message = error("a.bin", &bytes);
        assert!(message.contains("no plausible points") && message.contains("--columns"), "{what}: {message}");
    }
    assert!(error("a.bin", b"").contains("empty"), "nothing");
}

/// 16-bit grey, binary or as text, with 3 columns and 2 rows.
fn pgm(ascii: bool) -> Vec<u8> {
    let depths = [0_u16, 1000, 2000, 500, 65535, 0];
    if ascii {
        let values: Vec<String> = depths.iter().map(u16::to_string).collect();
        return format!("P2\n# made by hand\n3 2\n65535\n{}\n", values.join(" ")).into_bytes();
    }
    let mut bytes = b"P5\n# made by hand\n3 2 65535\n".to_vec();
    bytes.extend(depths.iter().flat_map(|value| value.to_be_bytes()));
    bytes
}

fn png(depth: bool, width: u32, height: u32) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    if depth {
        let values: Vec<u16> =
            [0, 1000, 2000, 500, 65535, 0].into_iter().cycle().take((width * height) as usize).collect();
        let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(width, height, values).unwrap();
        image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    } else {
        let image = image::RgbImage::from_fn(width, height, |x, y| image::Rgb([x as u8, y as u8, 7]));
        image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    }
    bytes.into_inner()
}

const CAMERA: DepthCamera = DepthCamera { fx: 2.0, fy: 4.0, cx: 1.0, cy: 0.5, scale: Some(1000.0) };

#[test]
fn depth_images_of_every_kind() {
    let options = ReadOptions { depth_camera: Some(CAMERA), ..ReadOptions::default() };
    for (name, bytes) in [("a.pgm", pgm(false)), ("b.pgm", pgm(true)), ("c.png", png(true, 3, 2)), ("d", pgm(false))] {
        let (cloud, notes) = noted(name, &bytes, &options).unwrap();
        let expected = [[0.0, -0.125, 1.0], [1.0, -0.25, 2.0], [-0.25, 0.0625, 0.5], [0.0, 8.191_875, 65.535]];
        assert_eq!(cloud.positions(), expected, "{name}");
        assert_eq!((cloud.axes(), cloud.crs().unit), (Some(Axes::Camera), Some(Unit::Metre)), "{name}");
        assert_eq!(cloud.scans()[0], Scan { name: None, world_from_sensor: DMat4::IDENTITY, points: 0..4 }, "{name}");
        assert_eq!(notes, ["2 of 6 pixels have no depth; dropped"], "{name}");
        let description = describe_bytes(Path::new(name), &bytes, &options).unwrap();
        assert!(description.format.starts_with("depth image, P"), "{}", description.format);
        assert_eq!(description.details[0].1, "3 × 2", "{name}");
    }
    let (_, notes) = noted("a.pgm", &pgm(false), &ReadOptions::default()).unwrap();
    assert!(notes[0].contains("no camera is known") && notes[0].contains("camera.txt"), "{notes:?}");
}

#[test]
fn what_lies_beside_a_depth_image() {
    let folder = tempfile::tempdir().unwrap();
    let put = |path: &str, bytes: &[u8]| {
        let path = folder.path().join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let options = ReadOptions { depth_camera: Some(CAMERA), ..ReadOptions::default() };
    let picture = Some(vec![[1, 0, 7], [2, 0, 7], [0, 1, 7], [1, 1, 7]]);
    for (depth, color) in [
        ("a/depth_1.pgm", "a/color_1.png"),
        ("b/depth/1.5.pgm", "b/rgb/1.5.png"),
        ("c/Depth1.pgm", "c/Color1.png"),
        ("d/depth/depth_1.pgm", "d/image/image_1.png"),
    ] {
        let depth = put(depth, &pgm(false));
        put(color, &png(false, 3, 2));
        let cloud = read_with(&depth, &options, &()).unwrap();
        assert_eq!(cloud.colors().map(<[_]>::to_vec), picture, "{color}");
    }
    let depth = put("e/depth.png", &png(true, 3, 2));
    for (picture, why) in
        [(png(false, 4, 2), "4 × 2 pixels"), (b"\x89PNG nothing".to_vec(), "color.png"), (vec![7; 9], "color.png")]
    {
        put("e/color.png", &picture);
        let ear = Ear::default();
        let cloud = read_with(&depth, &options, &ear).unwrap();
        let notes = ear.0.into_inner().unwrap();
        assert!(
            cloud.colors().is_none() && notes[0].starts_with("no colours: ") && notes[0].contains(why),
            "{notes:?}"
        );
        assert!(!notes[0].contains(char::is_control), "{notes:?} are lines of plain text");
    }
    put("e/camera.txt", b"2 0 1\n0 4 0.5\n0 0 1\n1000\n");
    let ear = Ear::default();
    let cloud = read_with(&depth, &ReadOptions::default(), &ear).unwrap();
    assert_eq!(cloud.positions()[1], [1.0, -0.25, 2.0], "the camera beside the image");
    assert!(ear.0.into_inner().unwrap()[0].contains("camera.txt"), "is told");
}

#[test]
fn pictures_without_depth_and_broken_ones() {
    for (name, bytes, words) in [
        ("a.png", png(false, 3, 2), ["without depth", "8-bit colour"]),
        ("a.pgm", b"P5 3 2 255\n123456".to_vec(), ["without depth", "8-bit grey"]),
        ("a.pgm", b"P5 3 2 65535\n123456".to_vec(), ["3 of 6 pixels", "copy"]),
        ("a.pgm", b"P2 3 2 65535\n1 2 3 4 5 70000".to_vec(), ["line 2", "'70000'"]),
        ("a.pgm", b"P5 3 x 65535\n".to_vec(), ["byte 4", "'x' is not a valid height"]),
        ("a.pgm", b"P5 16000000 16000000 65535\n12".to_vec(), ["1 of 256000000000000 pixels", "copy"]),
        ("a.pgm", b"P6 3 2 255\n".to_vec(), ["byte 0", "PGM"]),
        ("a.png", b"\x89PNG\r\n\x1a\n\0\0\0\rIH".to_vec(), ["byte 12", "copy"]),
    ] {
        let message = error(name, &bytes);
        assert!(words.iter().all(|word| message.contains(word)), "{message} should contain {words:?}");
        assert!(!message.contains(char::is_control), "{message:?} is one line of plain text");
    }
    // A header that claims more than the file can hold.
    let mut bytes = png(true, 3, 2);
    bytes[16..24].copy_from_slice(&[0, 0xff, 0xff, 0xff, 0, 0xff, 0xff, 0xff]);
    assert!(error("a.png", &bytes).contains("cannot be in"), "refused before anything is decoded");
}

#[test]
fn broken_in_every_way() {
    let compressed = pcd_bytes("binary_compressed", 300);
    let text = format!("x;y;z;i;\"kind\"\r\n{}", "1,5;-2,5;3;NA;\"a\"\r\n".repeat(30)).into_bytes();
    let samples = [
        ("a.bin", sweep(300, 4)),
        ("b.pcd.bin", sweep(300, 5)),
        ("a.pgm", pgm(false)),
        ("b.pgm", pgm(true)),
        ("a.png", png(true, 40, 30)),
        ("a.pcd", compressed),
        ("a.csv", text),
    ];
    let mut random = Random::from_state(6);
    let survive = |name: &str, what: &str, bytes: &[u8]| {
        let start = Instant::now();
        if let Err(error) = noted(name, bytes, &ReadOptions::default()) {
            let message = error.to_string();
            assert!(!message.contains(char::is_control), "{name}, {what}: {message:?} is one line of plain text");
        }
        let _ = describe_bytes(Path::new(name), bytes, &ReadOptions::default());
        assert!(start.elapsed() < Duration::from_secs(5), "{name}, {what}: took {:?}", start.elapsed());
    };
    for (name, bytes) in samples {
        assert!(
            noted(name, &bytes, &ReadOptions::default()).is_ok_and(|(cloud, _)| !cloud.is_empty()),
            "{name}: whole"
        );
        for len in (0..bytes.len().min(300)).chain((0..60).map(|i| bytes.len() * i / 60)) {
            survive(name, &format!("cut after {len}"), &bytes[..len]);
        }
        for round in 0..500 {
            let mut changed = bytes.clone();
            for _ in 0..=random.modulo(3) {
                let at = random.modulo(if round % 2 == 0 { bytes.len() } else { bytes.len().min(80) });
                changed[at] = [random.bits() as u8, 0, 0xff, changed[at] ^ 1 << random.modulo(8)][random.modulo(4)];
            }
            survive(name, &format!("change {round}"), &changed);
        }
    }
}

#[test]
fn pcd_viewpoints_are_places_of_the_sensor() {
    let text = |viewpoint: &str| {
        format!(
            "VERSION .7\nFIELDS x y z rgba i\nSIZE 4 4 4 4 4\nTYPE F F F U F\nCOUNT 1 1 1 1 2\nWIDTH 2\nHEIGHT 1\n\
             VIEWPOINT {viewpoint}\nDATA ascii\n1 2 3 4278190335 5 6\n4 5 6 16711680 7 8\n"
        )
    };
    let cloud = load("a.pcd", text("10 20 30 0.7071067811865476 0 0 0.7071067811865476").as_bytes());
    let pose = cloud.scans()[0].world_from_sensor;
    assert_eq!(
        (cloud.scans()[0].position(), cloud.scans()[0].points.clone()),
        (DVec3::new(10.0, 20.0, 30.0), 0..2),
        "place"
    );
    assert!((pose.transform_vector3(DVec3::X) - DVec3::Y).length() < 1e-12, "a quarter turn about z");
    assert_eq!(cloud.positions(), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "the points stay");
    assert_eq!(names(&cloud), ["Alpha", "i_0", "i_1"], "a varying alpha, and each of several values");
    assert_eq!(cloud.colors().unwrap(), [[0, 0, 255], [255, 0, 0]], "colours");
    for nowhere in ["0 0 0 1 0 0 0", "1 2 3 0 0 0 0", "nan 0 0 1 0 0 0", "1 2 3", "a b c d e f g"] {
        assert!(load("a.pcd", text(nowhere).as_bytes()).scans().is_empty(), "{nowhere} says nothing");
    }
    let described =
        describe_bytes(Path::new("a.pcd"), text("1 2 3 1 0 0 0").as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!(described.scans[0].position(), DVec3::new(1.0, 2.0, 3.0), "described");
    assert_eq!(described.details[0].1, "2 × 1", "with the size of the image");
    let histogram = text("0 0 0 1 0 0 0").replace("COUNT 1 1 1 1 2", "COUNT 1 1 1 1 33");
    let histogram = histogram.replace(" 5 6\n", &(" 5".repeat(33) + "\n")).replace(" 7 8\n", &" 7".repeat(33));
    let (cloud, notes) = noted("a.pcd", histogram.as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!((names(&cloud), notes.len()), (vec!["Alpha"], 1), "descriptors are left out");
    assert!(notes[0].contains("i has 33 values"), "{notes:?}");
}

/// A text PCD of the given width with these points.
fn pcd_image(width: usize, points: &[DVec3], viewpoint: &str) -> Vec<u8> {
    let (count, height) = (points.len(), points.len() / width);
    let mut text = format!(
        "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {width}\nHEIGHT {height}\n\
         VIEWPOINT {viewpoint}\nPOINTS {count}\nDATA ascii\n"
    );
    points.iter().for_each(|point| text += &format!("{} {} {}\n", point.x, point.y, point.z));
    text.into_bytes()
}

#[test]
fn images_of_points_are_seen_from_the_origin_unless_they_were_moved() {
    // A wall with a box in front of it, and holes.
    let pixel = |i: usize| {
        let (u, v) = ((i % 40) as f64 - 19.5, (i / 40) as f64 - 14.5);
        let depth = if u.abs() < 8.0 && v.abs() < 8.0 { 2.0 } else { 5.0 + 0.1 * u };
        if i % 11 == 3 { DVec3::NAN } else { depth * DVec3::new(u / 40.0, v / 40.0, 1.0) }
    };
    let points: Vec<DVec3> = (0..40 * 30).map(pixel).collect();
    let scans =
        |width, points: &[DVec3], viewpoint| load("a.pcd", &pcd_image(width, points, viewpoint)).scans().to_vec();
    let identity = "0 0 0 1 0 0 0";
    let seen = [Scan { name: None, world_from_sensor: DMat4::IDENTITY, points: 0..1200 }];
    assert_eq!(scans(40, &points, identity), seen, "as the camera has them");
    let none = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 0\nHEIGHT 2\nPOINTS 2\nDATA ascii\n0 0 1\n0 1 1\n";
    assert_eq!(load("a.pcd", none.as_bytes()).scans(), [], "an image without a width");
    let turned: Vec<DVec3> = points.iter().map(|point| DVec3::new(point.z, -point.x, -point.y)).collect();
    assert_eq!(scans(40, &turned, identity), seen, "turned about it");
    let moved: Vec<DVec3> = points.iter().map(|point| *point + DVec3::new(3.0, 0.0, -3.0)).collect();
    assert_eq!(scans(40, &moved, identity), [], "moved away from it");
    assert_eq!(scans(40, &moved, "3 0 -3 1 0 0 0")[0].position(), DVec3::new(3.0, 0.0, -3.0), "and said so");
    assert_eq!(scans(1200, &points, identity), [], "no image");
    assert_eq!(scans(40, &vec![DVec3::NAN; 1200], identity), [], "nothing was seen");
    assert_eq!(scans(40, &points, "1e300 0 0 1 0 0 0"), [], "nobody stands there");
}

#[test]
fn a_sensor_at_the_origin_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let scan = Scan { name: None, world_from_sensor: DMat4::IDENTITY, points: 0..50 };
    for name in ["a.pcd", "a.e57"] {
        let path = folder.path().join(name);
        for scans in [vec![scan.clone()], Vec::new()] {
            write(&rich_cloud(50).with_scans(scans.clone()), &path, &()).unwrap();
            let back = read_with(&path, &ReadOptions::default(), &()).unwrap();
            assert_eq!(back.scans(), scans, "{name}: the one that was written, if any");
            let described = autosplats_formats::describe(&path, &ReadOptions::default()).unwrap();
            assert_eq!(described.scans, scans, "{name}: described alike");
        }
    }
}

#[test]
fn written_pcd_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pcd");
    for count in [0, 1, 300_000] {
        let cloud = rich_cloud(count)
            .with_field("big", FieldValues::U64((0..count as u64).map(|i| u64::MAX - i).collect()))
            .unwrap();
        write(&cloud, &path, &()).unwrap();
        assert!(
            read_with(&path, &ReadOptions::default(), &()).unwrap() == cloud,
            "{count} points come back as they were"
        );
    }
    let pose =
        DMat4::from_rotation_translation(DQuat::from_axis_angle(DVec3::Z, 0.5), DVec3::new(512_001.0, 5.4e6, 312.0));
    let exact = ReadOptions { exact: true, ..ReadOptions::default() };
    let text = "x y z\n512000.1234567 5400000.25 310.1\n512001.7 5400001.3 311\n";
    let survey = read_bytes(Path::new("a.xyz"), text.as_bytes(), &exact, &()).unwrap();
    let survey =
        survey.with_scans(vec![Scan { name: None, world_from_sensor: pose, points: 0..2 }]).with_axes(Axes::ZUp);
    write(&survey, &path, &()).unwrap();
    let back = read_with(&path, &exact, &()).unwrap();
    assert_eq!(
        (back.origin(), back.positions(), back.residuals()),
        (survey.origin(), survey.positions(), survey.residuals()),
        "every digit"
    );
    let difference = (back.scans()[0].world_from_sensor - pose).to_cols_array();
    assert!(difference.iter().all(|value| value.abs() < 1e-9), "the pose: {difference:?}");
    assert_eq!(back.axes(), Some(Axes::ZUp), "which way is up");

    let ear = Ear::default();
    let scan = |points| Scan { name: None, world_from_sensor: pose, points };
    let two = PointCloud::new(DVec3::ZERO, positions(4)).with_scans(vec![scan(0..2), scan(2..4)]);
    write(&two, &path, &ear).unwrap();
    assert!(ear.0.into_inner().unwrap()[0].contains("one sensor pose"), "several sensors are told to be lost");
    assert!(read_with(&path, &ReadOptions::default(), &()).unwrap().scans().is_empty(), "and lost");
    let named = PointCloud::new(DVec3::ZERO, positions(4)).with_colors(colors(4)).unwrap();
    let named = named.with_field("two words", FieldValues::U8(vec![7; 4])).unwrap();
    write(&named.with_field("rgb", FieldValues::U8(vec![7; 4])).unwrap(), &path, &()).unwrap();
    assert_eq!(
        names(&read_with(&path, &ReadOptions::default(), &()).unwrap()),
        ["two_words", "rgb_"],
        "names are made fit"
    );
}

#[test]
fn real_sweeps() {
    let Some(folder) = shared_data() else { return };
    let check = |file: &str, count: usize, low: [f64; 3], high: [f64; 3], fields: &[(&str, f64)]| {
        let cloud = read_with(&folder.join(file), &ReadOptions::default(), &()).unwrap();
        assert_eq!(
            (cloud.len(), names(&cloud)),
            (count, fields.iter().map(|field| field.0).collect::<Vec<_>>()),
            "{file}"
        );
        for (found, expected) in bounds(&cloud).into_iter().zip([low, high]) {
            assert!((found - DVec3::from(expected)).abs().max_element() < 1e-4, "{file}: {found} is not {expected:?}");
        }
        for (name, largest) in fields {
            let values = &cloud.field(name).unwrap().values;
            let found = (0..cloud.len()).map(|i| values.get(i)).fold(0.0, f64::max);
            assert!((found - largest).abs() < 1e-6, "{file}: {name} up to {found}, not {largest}");
        }
    };
    check(
        "scans/kitti_000008_fov.bin",
        17_238,
        [2.889, -26.42, -3.607],
        [76.835, 10.278, 2.866],
        &[("Intensity", 0.99)],
    );
    let rings = [("Intensity", 255.0), ("Ring", 31.0)];
    check(
        "scans/nuscenes_n015.pcd.bin",
        34_688,
        [-57.99585, -96.29041, -3.416712],
        [96.85275, 98.59201, 19.02802],
        &rings,
    );
}

#[test]
fn a_real_depth_image() {
    let Some(folder) = shared_data() else { return };
    let camera = DepthCamera { fx: 518.0, fy: 519.0, cx: 325.5, cy: 253.5, scale: Some(1000.0) };
    let options = ReadOptions { depth_camera: Some(camera), ..ReadOptions::default() };
    let path = folder.join("sequences/rgbd_kinect/depth_1.pgm");
    let bytes = std::fs::read(&path).unwrap();
    let depths: Vec<u16> =
        bytes[bytes.len() - 640 * 480 * 2..].chunks(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
    let cloud = read_with(&path, &options, &()).unwrap();
    assert_eq!(cloud.len(), depths.iter().filter(|&&depth| depth > 0).count(), "every pixel with depth");
    assert!((0.6..0.75).contains(&(cloud.len() as f64 / depths.len() as f64)), "about 68 % of them");
    let pixel = depths.iter().rposition(|&depth| depth > 0).unwrap();
    let (u, v, z) = ((pixel % 640) as f64, (pixel / 640) as f64, f64::from(depths[pixel]) / 1000.0);
    let expected = DVec3::new((u - 325.5) * z / 518.0, (v - 253.5) * z / 519.0, z);
    assert!((cloud.world_position(cloud.len() - 1) - expected).length() < 1e-6, "the last one");
    let color = image::open(folder.join("sequences/rgbd_kinect/color_1.png")).unwrap().into_rgb8();
    assert_eq!(cloud.colors().unwrap()[cloud.len() - 1], color.get_pixel(u as u32, v as u32).0, "and its colour");
}
