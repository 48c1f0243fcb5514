//! Hand-made files of every variant of every format, read back.

use std::sync::Mutex;

use crate::common::{colors, error, las_bytes, pcd_bytes, positions, read_bytes, rich_cloud};
use autosplats_cloud::{Axes, Error, FieldValues, PointCloud, Progress, glam::DVec3};
use autosplats_formats::{read, write};

/// Values of a field as `f64`.
fn values(cloud: &PointCloud, name: &str) -> Vec<f64> {
    let field = cloud.field(name).unwrap_or_else(|| panic!("no field {name} in {:?}", names(cloud)));
    (0..cloud.len()).map(|i| field.values.get(i)).collect()
}

fn names(cloud: &PointCloud) -> Vec<&str> {
    cloud.fields().iter().map(|field| field.name.as_str()).collect()
}

const THREE: [[f32; 3]; 3] = [[0.1, 0.2, 0.3], [-1.5, 2.25, 1e-7], [9000.0, -3.0, 0.0]];

#[test]
fn ply_round_trip_keeps_every_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.ply");
    // No point, one point, and more points than a block of the writer.
    for count in [0, 1, 300_000] {
        let cloud = rich_cloud(count);
        write(&cloud, &path, &()).unwrap();
        assert!(read(&path, &()).unwrap() == cloud, "a cloud of {count} points comes back as it was");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays");
    let other = folder.path().join("other");
    std::fs::write(&other, b"").unwrap();
    let permissions = |path| std::fs::metadata(path).unwrap().permissions();
    assert_eq!(permissions(&path), permissions(&other), "those who may read files here may read this one");
}

#[test]
fn ply_round_trip_of_survey_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.ply");
    let cloud = PointCloud::new(DVec3::new(512_345.0, 5_400_001.0, 300.0), positions(1000)).with_axes(Axes::ZUp);
    write(&cloud, &path, &()).unwrap();
    let back = read(&path, &()).unwrap();
    assert_eq!(back.axes(), Some(Axes::ZUp), "the axes are written");
    for i in 0..cloud.len() {
        let error = (back.world_position(i) - cloud.world_position(i)).abs().max_element();
        // Half an f32 step at 16, the largest distance from either origin.
        assert!(error < 1e-6, "point {i} is off by {error}");
    }
}

#[test]
fn ply_field_names_are_made_fit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.ply");
    let field = || FieldValues::U8(vec![7; 4]);
    let mut cloud = PointCloud::new(DVec3::ZERO, positions(4));
    for name in ["two words", "x", "a\nb", ""] {
        cloud = cloud.with_field(name, field()).unwrap();
    }
    write(&cloud, &path, &()).unwrap();
    let back = read(&path, &()).unwrap();
    assert_eq!(names(&back), ["two_words", "x_", "a_b", "_"], "blanks and coordinates are no names");
    assert_eq!(back.positions(), cloud.positions(), "the positions are not disturbed");
}

#[test]
fn a_failed_write_leaves_nothing() {
    struct Stop;
    impl Progress for Stop {
        fn report(&self, _fraction: f32) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.ply");
    assert!(matches!(write(&rich_cloud(10), &path, &Stop), Err(Error::Cancelled)), "cancelled");
    let missing = folder.path().join("missing/cloud.ply");
    assert!(matches!(write(&rich_cloud(10), &missing, &()), Err(Error::Io { .. })), "no such folder");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "the folder stays empty");
    write(&rich_cloud(10), &path, &()).unwrap();
    assert!(matches!(read(&path, &Stop), Err(Error::Cancelled)), "reading is cancelled too");
}

/// The three points with a colour, a list and further elements, in an encoding, with types in either spelling.
fn ply(encoding: &str, newline: &str, spelled_out: bool) -> Vec<u8> {
    let name = |short: &'static str, long: &'static str| if spelled_out { long } else { short };
    let (float, uchar, int) = (name("float", "float32"), name("uchar", "uint8"), name("int", "int32"));
    let header = [
        "ply".into(),
        format!("format {encoding} 1.0"),
        "comment made by hand".into(),
        "obj_info nothing".into(),
        "element camera 2".into(),
        format!("property {int} id"),
        format!("property list {uchar} {int} frames"),
        "element vertex 3".into(),
        format!("property {float} y"),
        format!("property list {uchar} {float} weights"),
        format!("property {float} x"),
        "property double z".into(),
        format!("property {uchar} diffuse_red"),
        format!("property {uchar} diffuse_green"),
        format!("property {uchar} diffuse_blue"),
        format!("property {int} scalar_Intensity"),
        "element face 1".into(),
        format!("property list {uchar} {int} vertex_indices"),
        "end_header".into(),
    ];
    let mut bytes: Vec<u8> = header.iter().flat_map(|line| format!("{line}{newline}").into_bytes()).collect();
    if encoding == "ascii" {
        let body = "7 2 1 2\n8 0\n0.2 1 5 0.1 0.30000001192092896 1 2 3 10\n2.25 0 -1.5 1e-7 4 5 6 -20\n\n\
                    -3 2 1 2 9000 0 7 8 9 30\n3 0 1 2\n";
        bytes.extend(body.replace('\n', newline).bytes());
        return bytes;
    }
    let big = encoding == "binary_big_endian";
    let mut put = |mut value: Vec<u8>| {
        if big {
            value.reverse();
        }
        bytes.extend(value);
    };
    let int = |value: i32| value.to_le_bytes().to_vec();
    for value in [int(7), vec![2], int(1), int(2), int(8), vec![0]] {
        put(value);
    }
    for (i, [x, y, z]) in THREE.into_iter().enumerate() {
        put(y.to_le_bytes().to_vec());
        put(vec![i as u8]);
        (0..i).for_each(|_| put(1f32.to_le_bytes().to_vec()));
        put(x.to_le_bytes().to_vec());
        put(f64::from(z).to_le_bytes().to_vec());
        (1..=3).for_each(|channel| put(vec![i as u8 * 3 + channel]));
        put(int([10, -20, 30][i]));
    }
    for value in [vec![3], int(0), int(1), int(2)] {
        put(value);
    }
    bytes
}

#[test]
fn ply_of_every_encoding() {
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for (newline, spelled_out) in [("\n", false), ("\r\n", true)] {
            let cloud = read_bytes("a.ply", &ply(encoding, newline, spelled_out)).unwrap();
            assert_eq!(cloud.positions(), THREE, "{encoding} {newline:?}");
            assert_eq!(cloud.colors().unwrap(), [[1, 2, 3], [4, 5, 6], [7, 8, 9]], "{encoding}");
            assert_eq!(names(&cloud), ["Intensity"], "lists are left out, {encoding}");
            assert_eq!(cloud.fields()[0].values, FieldValues::I32(vec![10, -20, 30]), "{encoding}");
            assert_eq!(cloud.axes(), None, "nothing says what is up");
        }
    }
}

#[test]
fn content_goes_before_extension() {
    let bytes = ply("ascii", "\n", false);
    for name in ["a.las", "a.xyz", "a", "a.unknown"] {
        assert_eq!(read_bytes(name, &bytes).unwrap().len(), 3, "{name} is a PLY inside");
    }
    let message = error("a.unknown", &[1, 2, 3, 4]);
    assert!(message.contains("PLY") && message.contains("PCD") && message.contains("text"), "{message}");
}

#[test]
fn colours_of_every_width() {
    let ply = |kind: &str, values: [&str; 3]| {
        let [a, b, c] = values;
        let header = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
        let colors = format!("property {kind} r\nproperty {kind} g\nproperty {kind} b\nend_header\n");
        let cloud =
            read_bytes("a.ply", format!("{header}{colors}0 0 0 {a} {b} {c}\n1 1 1 0 0 0\n").as_bytes()).unwrap();
        cloud.colors().unwrap()[0]
    };
    assert_eq!(ply("uchar", ["255", "128", "0"]), [255, 128, 0], "8 bits as they are");
    assert_eq!(ply("ushort", ["65535", "32768", "256"]), [255, 128, 1], "16 bits");
    assert_eq!(ply("ushort", ["255", "128", "1"]), [255, 128, 1], "8 bits in 16");
    assert_eq!(ply("float", ["1", "0.5", "0"]), [255, 128, 0], "0 to 1");
    assert_eq!(ply("float", ["255", "128.4", "1"]), [255, 128, 1], "0 to 255");
    assert_eq!(ply("int", ["255", "7", "300"]), [0, 0, 1], "beyond 255 means 16 bits");
}

#[test]
fn far_coordinates_get_an_origin() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n";
    let doubles = "property double x\nproperty double y\nproperty double z\nend_header\n";
    let world = [[400_000.125, 5_400_000.25, 1.0], [400_001.0, 5_400_002.001, 2.5], [f64::NAN, 0.0, 0.0]];
    let mut bytes = format!("{header}{doubles}").into_bytes();
    world.iter().flatten().for_each(|value| bytes.extend(value.to_le_bytes()));
    let cloud = read_bytes("a.ply", &bytes).unwrap();
    assert_eq!(cloud.origin(), cloud.origin().round(), "whole numbers");
    assert!((cloud.origin() - DVec3::from(world[0])).abs().max_element() < 10.0, "near the data");
    assert_eq!(cloud.world_position(0), DVec3::from(world[0]), "binary fractions are exact");
    assert!((cloud.world_position(1) - DVec3::from(world[1])).abs().max_element() < 1e-6, "others to f32");
    assert_eq!(cloud.len(), 3, "points that are not finite stay");
    assert!(cloud.positions()[2][0].is_nan(), "as they are");
}

#[test]
fn one_wild_point_moves_no_origin() {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\n".to_vec();
    bytes.extend(b"property float x\nproperty float y\nproperty float z\nend_header\n");
    let floats = [[0.1_f32, 0.2, 0.3], [0.4, 0.5, 0.6], [1e30, f32::INFINITY, -1e30]];
    floats.iter().flatten().for_each(|value| bytes.extend(value.to_le_bytes()));
    let cloud = read_bytes("a.ply", &bytes).unwrap();
    assert_eq!((cloud.origin(), cloud.positions()), (DVec3::ZERO, &floats[..]), "the bits of the file");
}

#[test]
fn las_of_every_version_and_format() {
    let cases = [((1, 0), 0), ((1, 1), 1), ((1, 2), 2), ((1, 2), 3), ((1, 3), 4), ((1, 3), 5)];
    let wide = [6, 7, 8, 9, 10].map(|format| ((1, 4), format));
    let (count, expected_positions, expected_colors) = (500, positions(500), colors(500));
    for (version, format) in cases.into_iter().chain(wide) {
        // The compressor does not support wave packets.
        for compressed in [false, true].into_iter().take(if matches!(format, 4 | 5 | 9 | 10) { 1 } else { 2 }) {
            let case = format!("LAS {version:?}, format {format}, compressed: {compressed}");
            let bytes = las_bytes(version, format, compressed, count);
            let cloud = read_bytes("a.las", &bytes).unwrap_or_else(|error| panic!("{case}: {error}"));
            assert_eq!((cloud.len(), cloud.axes()), (count, Some(Axes::ZUp)), "{case}");
            for (i, position) in expected_positions.iter().enumerate() {
                let expected = DVec3::new(5e5, 5e6, 0.0) + DVec3::from(position.map(f64::from));
                let error = (cloud.world_position(i) - expected).abs().max_element();
                // Half a unit of the integers, plus half an f32 step at 16.
                assert!(error < 0.000_502, "{case}: point {i} is off by {error}");
            }
            let has_color = matches!(format, 2 | 3 | 5 | 7 | 8 | 10);
            assert_eq!(cloud.colors(), has_color.then_some(&expected_colors[..]), "{case}");
            assert!(values(&cloud, "ReturnNumber").iter().all(|value| (1.0..=3.0).contains(value)), "{case}");
            assert!(values(&cloud, "NumberOfReturns").iter().all(|&value| value == 3.0), "{case}");
            assert!(values(&cloud, "Classification").iter().all(|value| (1.0..=6.0).contains(value)), "{case}");
            assert!(values(&cloud, "PointSourceId").iter().all(|value| (1.0..=9.0).contains(value)), "{case}");
            assert_eq!(cloud.field("GpsTime").is_some(), !matches!(format, 0 | 2), "{case}");
            assert_eq!(cloud.field("Infrared").is_some(), matches!(format, 8 | 10), "{case}");
        }
    }
}

#[test]
fn laz_equals_las() {
    for format in [3, 7] {
        let version = if format > 5 { (1, 4) } else { (1, 2) };
        // More than one chunk of 50,000.
        let plain = read_bytes("a.las", &las_bytes(version, format, false, 120_000)).unwrap();
        let compressed = read_bytes("a.laz", &las_bytes(version, format, true, 120_000)).unwrap();
        assert!(plain == compressed, "format {format}: compression changes nothing");
    }
}

/// A LAS 1.2 file of format 3, compressed in one of several ways.
fn recompressed(las: &[u8], chunk_size: Option<u32>, in_chunks: bool) -> Vec<u8> {
    use std::io::{Cursor, Seek as _, SeekFrom};

    let (header, records) = las.split_at(227);
    let items = laz::LazItemRecordBuilder::default_for_point_format_id(3, 0).unwrap();
    let builder = laz::LazVlrBuilder::new(items);
    let vlr = match chunk_size {
        Some(size) => builder.with_fixed_chunk_size(size).build(),
        None => builder.with_variable_chunk_size().build(),
    };
    let mut vlr_data = Vec::new();
    vlr.write_to(&mut vlr_data).unwrap();
    if !in_chunks {
        vlr_data[0] = 1;
    }
    let mut bytes = header.to_vec();
    bytes[96..100].copy_from_slice(&(227 + 54 + vlr_data.len() as u32).to_le_bytes());
    bytes[100] = 1;
    bytes[104] |= 0x80;
    bytes.extend([0; 2]);
    bytes.extend(b"laszip encoded\0\0");
    bytes.extend(22204_u16.to_le_bytes());
    bytes.extend((vlr_data.len() as u16).to_le_bytes());
    bytes.extend([0; 32]);
    bytes.extend(vlr_data);

    let start = bytes.len();
    let mut cursor = Cursor::new(bytes);
    cursor.seek(SeekFrom::End(0)).unwrap();
    let mut compressor = laz::LasZipCompressor::new(cursor, vlr).unwrap();
    for part in records.chunks(34 * 1234) {
        compressor.compress_many(part).unwrap();
        if chunk_size.is_none() {
            compressor.finish_current_chunk().unwrap();
        }
    }
    compressor.done().unwrap();
    let mut bytes = compressor.into_inner().into_inner();
    if !in_chunks {
        // A single run of points has no offset of a chunk table before it.
        bytes.drain(start..start + 8);
    }
    bytes
}

#[test]
fn laz_in_chunks_of_every_kind() {
    // The longer files are decompressed in blocks.
    let cases = [(50_000, Some(777), true), (50_000, None, true), (540_000, Some(700_000), true)];
    for (count, chunk_size, in_chunks) in cases.into_iter().chain([(540_000, Some(700_000), false)]) {
        let las = las_bytes((1, 2), 3, false, count);
        let plain = read_bytes("a.las", &las).unwrap();
        let laz = recompressed(&las, chunk_size, in_chunks);
        let cloud = read_bytes("a.laz", &laz).unwrap_or_else(|error| panic!("{chunk_size:?} {in_chunks}: {error}"));
        assert!(cloud == plain, "chunks of {chunk_size:?}, {in_chunks}: the same points");
        if in_chunks {
            let half = &laz[..laz.len() / 2];
            if chunk_size == Some(777) {
                let kept = read_bytes("a.laz", half).unwrap().len();
                assert!(
                    kept.is_multiple_of(777) && (count / 3..count).contains(&kept),
                    "the whole chunks are left: {kept} points"
                );
            } else {
                let message = error("a.laz", half);
                assert!(message.contains("copy"), "chunks of {chunk_size:?}: no chunk is whole: {message}");
            }
        } else {
            let half = read_bytes("a.laz", &laz[..laz.len() / 2]).unwrap();
            let kept = half.len();
            assert!((count / 3..count).contains(&kept), "a single run is read up to where it is cut: {kept} points");
            assert!((0..kept).all(|i| half.world_position(i) == plain.world_position(i)), "and these are right");
        }
    }
}

#[test]
fn pcd_of_every_encoding() {
    for encoding in ["ascii", "binary", "binary_compressed"] {
        let cloud = read_bytes("a.pcd", &pcd_bytes(encoding, 5000)).unwrap();
        assert_eq!(cloud.positions(), positions(5000), "{encoding}");
        assert_eq!(cloud.colors().unwrap(), colors(5000), "{encoding}");
        let labels = (0..5000).map(|i| (i % 1000) as u16).collect();
        assert_eq!(cloud.field("label").unwrap().values, FieldValues::U16(labels), "{encoding}");
        // Colours, and points near and in front of the origin, mean a depth camera.
        assert_eq!((cloud.axes(), cloud.fields().len()), (Some(Axes::Camera), 1), "{encoding}");
    }
}

#[test]
fn pcd_oddities() {
    let text = "VERSION .7\nFIELDS X Y Z _ histogram rgb\nSIZE 4 4 4 1 4 4\nTYPE F F F U F U\nCOUNT 1 1 1 2 3 1\nWIDTH 2\n\
                HEIGHT 1\nDATA ascii\n1 2 3 0 0 9 9 9 16711680\nnan nan -nan 0 0 9 9 9 255\n";
    let cloud = read_bytes("a.pcd", text.as_bytes()).unwrap();
    assert_eq!(cloud.positions()[0], [1.0, 2.0, 3.0], "upper-case names, points from width and height");
    assert!(cloud.positions()[1].iter().all(|value| value.is_nan()), "points that are not finite stay");
    assert_eq!(cloud.colors().unwrap(), [[255, 0, 0], [0, 0, 255]], "integer colours");
    assert_eq!(names(&cloud), ["histogram_0", "histogram_1", "histogram_2"], "each of several values, no padding");

    let image = |z: &str, viewpoint: &str| {
        let text = format!(
            "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 2\nVIEWPOINT {viewpoint}\nDATA ascii\n\
             0 0 1\n1 0 1\nnan nan nan\n0 1 {z}\n"
        );
        read_bytes("a.pcd", text.as_bytes()).unwrap().axes()
    };
    assert_eq!(image("2", "0 0 0 1 0 0 0"), Some(Axes::Camera), "an image seen from the origin");
    assert_eq!(image("-2", "0 0 0 1 0 0 0"), None, "points behind the camera");
    assert_eq!(image("2", "1 0 0 1 0 0 0"), None, "a camera elsewhere");
}

#[test]
fn text_of_every_kind() {
    let three = |name: &str, text: &str| {
        let cloud = read_bytes(name, text.as_bytes()).unwrap_or_else(|error| panic!("{text:?}: {error}"));
        assert_eq!(cloud.positions(), [[1.0, 2.0, 3.0], [-4.5, 0.5, 0.25]], "{text:?}");
        cloud
    };
    for text in [
        "1 2 3\n-4.5 .5 0.25\n",
        "1\t2\t3\r\n-4.5\t0.5\t2.5e-1\r\n",
        "1,2,3\n-4.5,0.5,0.25",
        "1; 2; 3\n-4.5; 0.5; 0.25\n\n",
        "# a comment\n// another\n1 2 3\n# between\n-4.5 0.5 0.25\n",
        "\u{feff}x y z\n1 2 3\n-4.5 0.5 0.25\n",
        "2\n1 2 3\n-4.5 0.5 0.25\n",
        "1\n1 2 3\n1\n-4.5 0.5 0.25\n",
    ] {
        assert!(three("a.txt", text).fields().is_empty(), "{text:?}");
    }
    assert_eq!(values(&three("a.xyz", "1 2 3 9\n-4.5 0.5 0.25 8\n"), "intensity"), [9.0, 8.0], "four columns");
    let rgb = Some(&[[9, 8, 7], [255, 0, 1]][..]);
    assert_eq!(three("a.asc", "1 2 3 9 8 7\n-4.5 0.5 0.25 255 0 1\n").colors(), rgb, "six columns");
    let normals = three("a.xyz", "1 2 3 0 0.6 0.8\n-4.5 0.5 0.25 -1 0 0\n");
    assert_eq!(
        (names(&normals), normals.colors()),
        (vec!["NormalX", "NormalY", "NormalZ"], None),
        "six columns of normals"
    );
    let pts = three("a.pts", "2\n1 2 3 -1035 9 8 7\n-4.5 0.5 0.25 -20 255 0 1\n");
    assert_eq!((pts.colors(), values(&pts, "Intensity")), (rgb, vec![-1035.0, -20.0]), "PTS");
    let alpha = three("a.xyz", "1 2 3 9.0 8.0 7.0 255.0\n-4.5 0.5 0.25 255.0 0 1 255.0\n");
    assert_eq!((alpha.colors(), names(&alpha)), (rgb, vec!["Alpha"]), "seven columns with alpha");
    let csv =
        three("a.csv", "Classification,x,\"y\",Z,Scan Angle,R,G,B\n3,1,2,3,-7,9,8,7\n4,-4.5,0.5,0.25,7,255,0,1\n");
    assert_eq!((csv.colors(), names(&csv)), (rgb, vec!["Classification", "Scan Angle"]), "names in any order");
    assert_eq!(three("a.txt", "//X Y Z R G B\n1 2 3 9 8 7\n-4.5 0.5 0.25 255 0 1\n").colors(), rgb, "CloudCompare");
    assert_eq!(read_bytes("a.csv", b"x,y,z\n").unwrap().len(), 0, "a header and no points");
}

#[test]
fn long_text_keeps_its_order() {
    let lines: String = (0..200_000).map(|i| format!("{i} {} 0.5\n", i % 7)).collect();
    let cloud = read_bytes("a.xyz", lines.as_bytes()).unwrap();
    assert_eq!(cloud.len(), 200_000, "all rows");
    assert!((0..cloud.len()).all(|i| cloud.world_position(i).x == i as f64), "in order");
    let broken = lines.replace("150000 4 0.5", "150000 four 0.5");
    assert!(error("a.xyz", broken.as_bytes()).contains("line 150001: 'four' is not a number"), "the place is right");
}

#[test]
fn errors_name_place_and_remedy() {
    let check = |name: &str, bytes: &[u8], parts: &[&str]| {
        let message = error(name, bytes);
        assert!(parts.iter().all(|part| message.contains(part)), "{message} should contain {parts:?}");
    };
    let vertex = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n";
    check("a.ply", format!("{vertex}end_header\n1 2\n3 4\n").as_bytes(), &["header", "x, y and z"]);
    let vertex = format!("{vertex}property float z\nend_header\n");
    check("a.ply", format!("{vertex}1 2 3\n4 5\n").as_bytes(), &["line 9", "2 values", "3"]);
    check("a.ply", format!("{vertex}1 2 3\n4 5 6 7\n").as_bytes(), &["line 9", "'7'"]);
    check("a.ply", vertex.as_bytes(), &["before the first of 2 points", "copy"]);
    check("a.ply", b"ply\nformat ascii 1.0\nelement vertex many\n", &["line 3", "'many'"]);
    check("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty \x1b[31m x\n", &["line 4", "[31m"]);
    check("a.ply", b"", &["empty"]);
    check("a.pcd", b"1 2 three\n", &["line 1", ".xyz"]);
    check("a.xyz", b"1 2\n3 4\n", &["line 1", "x, y and z"]);
    check("a.xyz", b"1 2 3\n4 5 6 7\n", &["line 2", "'7'"]);
    check("a.xyz", b"words\nand more words\n", &["line 1", "'words'", "no points"]);
    check("a.csv", b"1,5;2.5;3,5\n", &["decimal commas", "points"]);
    check("a.pts", b"5\n1 2 3\n", &["1 of 5 points"]);
    check("a.txt", &[b'1', 0, b' ', 0], &["byte 1", "UTF-8"]);
    check("a.laz", b"nothing", &["byte 0", "LASF"]);
    let las = las_bytes((1, 2), 0, false, 100);
    check("a.las", &las[..las.len() - 1999], &["first of 100 points", "copy"]);
}

/// Stores the reported progress, and cancels once it reaches `stop_at`.
struct Watch {
    stop_at: f32,
    reported: Mutex<Vec<f32>>,
}

impl Progress for Watch {
    fn report(&self, fraction: f32) {
        self.reported.lock().unwrap().push(fraction);
    }

    fn cancelled(&self) -> bool {
        self.reported.lock().unwrap().last().is_some_and(|&last| last >= self.stop_at)
    }
}

#[test]
fn progress_rises_and_cancelling_ends_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("written.ply");
    let count = 600_000;
    write(&rich_cloud(count), &path, &()).unwrap();
    let rows: String = positions(count).iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
    let header = "ply\nformat ascii 1.0\nelement vertex 600000\nproperty float x\nproperty float y\nproperty float z\n";
    // A list before the vertices and one inside them.
    let mut lists =
        b"ply\nformat binary_little_endian 1.0\nelement face 100000\nproperty list uchar uchar a\n".to_vec();
    lists.extend(b"element vertex 100000\nproperty float x\nproperty float y\nproperty float z\n");
    lists.extend(b"property list uchar uchar b\nend_header\n");
    lists.extend(vec![0; 100_000]);
    lists.extend(vec![0; 1_300_000]);
    let files = [
        ("ascii.ply", format!("{header}end_header\n{rows}").into_bytes()),
        ("lists.ply", lists),
        ("a.xyz", rows.into_bytes()),
        ("a.las", las_bytes((1, 2), 3, false, count)),
        ("a.laz", las_bytes((1, 4), 7, true, count)),
        ("a.pcd", pcd_bytes("binary_compressed", count)),
    ];
    let mut paths = vec![path];
    for (name, bytes) in files {
        paths.push(folder.path().join(name));
        std::fs::write(&paths[paths.len() - 1], bytes).unwrap();
    }
    for path in paths {
        let name = path.file_name().unwrap().to_str().unwrap();
        let watch = Watch { stop_at: 2.0, reported: Mutex::default() };
        read(&path, &watch).unwrap_or_else(|error| panic!("{error}"));
        let reported = watch.reported.into_inner().unwrap();
        assert!(reported.is_sorted(), "{name}: progress never falls: {reported:?}");
        assert_eq!((reported[0], reported[reported.len() - 1]), (0.0, 1.0), "{name}: from nothing to all");
        assert!(reported.iter().any(|fraction| (0.1..0.9).contains(fraction)), "{name}: and between: {reported:?}");

        let watch = Watch { stop_at: 0.1, reported: Mutex::default() };
        assert!(matches!(read(&path, &watch), Err(Error::Cancelled)), "{name}: cancelled on the way");
        let last = watch.reported.into_inner().unwrap().pop().unwrap();
        assert!(last < 1.0, "{name}: and at once, not at the end");
    }
}
