//! Real files from a shared set that is too large for the repository. Counts and bounds must be those found by other
//! programs, as listed in the set's `README.md`.
//!
//! The set lies beside the repository in `../shared/data`, or where `AUTOSPLATS_DATA` points. Without the set these
//! tests report that they check nothing, and fail if `CI` is set.

use std::path::{Path, PathBuf};

use crate::common::shared_data;
use autosplats_cloud::{Axes, PointCloud, glam::DVec3};
use autosplats_formats::{ReadOptions, describe, read, read_mesh};

fn load(folder: &Path, file: &str) -> PointCloud {
    read(&folder.join(file), &()).unwrap_or_else(|error| panic!("{error}"))
}

/// Bounds of the finite points of some clouds.
fn bounds(clouds: &[PointCloud]) -> [DVec3; 2] {
    let points = clouds.iter().flat_map(|cloud| (0..cloud.len()).map(|i| cloud.world_position(i)));
    points
        .filter(|point| point.is_finite())
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], point| [low.min(point), high.max(point)])
}

/// Asserts bounds known to seven digits.
fn check_bounds(what: &str, clouds: &[PointCloud], low: [f64; 3], high: [f64; 3]) {
    let [found_low, found_high] = bounds(clouds);
    for axis in 0..3 {
        for (found, expected) in [(found_low[axis], low[axis]), (found_high[axis], high[axis])] {
            let tolerance = 1e-6 * expected.abs().max(1e-3);
            assert!((found - expected).abs() <= tolerance, "{what}, axis {axis}: {found} is not {expected}");
        }
    }
}

/// File, points, bounds, required fields, whether there are colours.
type Case = (&'static str, usize, [f64; 3], [f64; 3], &'static [&'static str], bool);

const LAS: &[&str] = &["Intensity", "ReturnNumber", "NumberOfReturns", "Classification", "PointSourceId", "GpsTime"];

#[rustfmt::skip]
const CASES: &[Case] = &[
    ("models/armadillo_normals.ply", 38_294, [-13.66165, -12.38138, -48.86357], [11.12058, 95.40793, 57.714], &["NormalX", "NormalY", "NormalZ"], false),
    ("models/bunny.ply", 35_947, [-0.0946899, 0.0329874, -0.0618736], [0.0610091, 0.187321, 0.0587997], &["confidence", "Intensity"], false),
    ("models/camelhead.off", 11_381, [-0.261816, -0.329475, -0.532113], [0.26182, 0.202191, 0.467887], &[], false),
    ("models/guanyin_color.ply", 238_154, [-0.510808, 0.002058, -0.370374], [0.474869, 1.292931, 0.453506], &[], true),
    ("models/igea.ply", 134_345, [-0.034556, -0.049669, -0.049538], [0.034556, 0.049669, 0.049538], &[], false),
    ("scans/autzen_thin.las", 10_653, [635589.0, 848886.5, 406.59], [638994.8, 853535.4, 593.73], LAS, true),
    ("scans/autzen_trim.laz", 110_000, [636001.8, 848935.2, 406.26], [637179.2, 849497.9, 520.51], LAS, true),
    ("scans/bunny.pts", 30_571, [-0.094689, 0.040011, -0.061873], [0.061009, 0.187321, 0.058799], &[], false),
    ("scans/courtyard_1p46M.laz", 1_460_879, [406047.0, 7405439.0, 517.898], [406185.0, 7405572.0, 568.623], &["Intensity", "PointSourceId"], true),
    ("scans/five_people.pcd", 307_200, [-1.931119, -3.874923, 1.759], [2.988514, 1.140606, 9.757001], &[], true),
    ("scans/ign_lambert93_extrabytes.laz", 697_721, [484649.4, 6632630.0, 99.65], [485000.0, 6633000.0, 120.42], LAS, true),
    ("scans/intensity_rgb.pts", 19, [-25.05046, -24.53355, -2.000961], [3.980972, -2.006119, -0.010086], &["Intensity"], true),
    ("scans/isprs_samp11_utm_f32.pcd", 38_010, [512700.9, 5403548.0, 295.25], [512834.8, 5403850.0, 404.08], &[], false),
    ("scans/latlon_degrees.las", 5_380, [-94.68347, 31.03673, 39.081], [-94.66063, 31.04733, 78.119], &["Intensity"], false),
    ("scans/lion_takanawa.copc.laz", 341_989, [-4.99, 1.04, -3.45], [-0.79, 6.72, 1.12], &["Intensity"], true),
    ("scans/livingroom_fragment.pcd", 113_662, [1.151989, 0.8152729, 0.7264091], [3.519531, 2.761719, 1.530428], &["NormalX", "Curvature"], true),
    ("scans/lone_star.copc.laz", 518_862, [515368.6, 4918340.0, 2322.896], [515401.0, 4918381.0, 2338.575], &["Intensity"], false),
    ("scans/rops_ascii.pcd", 32_087, [-0.41984, -0.24034, -1.4022], [0.40617, 0.24871, -1.0098], &[], false),
    ("scans/simple_1065.las", 1_065, [635619.8, 848899.7, 406.59], [638982.6, 853535.4, 586.38], LAS, true),
];

#[test]
fn real_files_are_what_others_say() {
    let Some(folder) = shared_data() else { return };
    for &(file, count, low, high, fields, colored) in CASES {
        let cloud = load(&folder, file);
        assert_eq!(cloud.len(), count, "{file}");
        assert_eq!(cloud.colors().is_some(), colored, "{file}: colours");
        for field in fields {
            assert!(cloud.field(field).is_some(), "{file}: no field {field}");
        }
        check_bounds(file, &[cloud], low, high);
    }
}

#[test]
fn sequences_are_what_others_say() {
    let Some(folder) = shared_data() else { return };
    let all = |folder: PathBuf, extension: &str| {
        let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let mut files: Vec<_> = files.filter(|path| path.extension().is_some_and(|found| found == extension)).collect();
        files.sort();
        files.iter().map(|path| read(path, &()).unwrap_or_else(|error| panic!("{error}"))).collect::<Vec<_>>()
    };
    let counts = |clouds: &[PointCloud]| clouds.iter().map(PointCloud::len).collect::<Vec<_>>();

    let horse = all(folder.join("animation/horse_gallop"), "ply");
    assert_eq!(counts(&horse), [8431; 48], "horse");
    check_bounds("horse", &horse, [-0.203508, -0.03346871, -1.340348], [0.2066388, 1.446252, 0.8903888]);
    let samba = all(folder.join("animation/samba"), "ply");
    assert_eq!(counts(&samba), [9971; 30], "samba");
    check_bounds("samba", &samba, [-0.509918, 0.0198157, -0.643406], [0.774913, 1.79319, 0.495332]);
    let drive = all(folder.join("sequences/kitti_drive_pcd"), "pcd");
    // Each file has one point at the sensor itself, which means no return.
    assert_eq!(counts(&drive), [119_977, 118_702, 116_650, 115_650, 115_150], "drive");
    check_bounds("drive", &drive, [-79.719, -36.888, -28.347], [79.923, 43.326, 2.912]);
    let scans = all(folder.join("multiview/bunny_scans"), "ply");
    assert_eq!(counts(&scans), [40_256, 40_097, 30_379, 40_251, 31_701, 35_336], "range scans of the bunny");
    check_bounds("scans", &scans, [-0.09475, 0.0340917, -0.0748457], [0.09475, 0.18794, 0.100634]);
}

#[test]
fn particulars_of_real_files() {
    let Some(folder) = shared_data() else { return };
    let people = load(&folder, "scans/five_people.pcd");
    let holes = people.positions().iter().filter(|point| point.iter().any(|value| !value.is_finite())).count();
    assert_eq!((holes, people.axes()), (68_125, Some(Axes::Camera)), "an image of a depth camera, with holes");

    let range = |cloud: &PointCloud, name: &str| {
        let values = &cloud.field(name).unwrap_or_else(|| panic!("no field {name}")).values;
        (0..cloud.len())
            .map(|i| values.get(i))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    };
    let brightest = |cloud: &PointCloud| cloud.colors().unwrap().iter().flatten().copied().max();
    let simple = load(&folder, "scans/simple_1065.las");
    assert_eq!((range(&simple, "Intensity").1, range(&simple, "Classification")), (254.0, (1.0, 2.0)), "values");
    assert_eq!(brightest(&simple), Some(249), "8-bit colours in 16 bits stay as they are");
    let forest = load(&folder, "scans/ign_lambert93_extrabytes.laz");
    assert_eq!((range(&forest, "Intensity").1, range(&forest, "Classification")), (3004.0, (1.0, 65.0)), "values");
    assert_eq!(brightest(&forest), Some((65_024 >> 8) as u8), "true 16-bit colours");

    // The same points, written and compressed by another program, and in a third format in other coordinates.
    let compressed = load(&folder, "malformed/laz_two_padding_bytes.laz");
    assert_eq!((compressed.positions(), compressed.origin()), (simple.positions(), simple.origin()), "LAZ and LAS");
    assert_eq!((compressed.colors(), compressed.fields()), (simple.colors(), simple.fields()), "LAZ and LAS");
    let doubles = load(&folder, "scans/autzen_utm_f64.pcd");
    assert_eq!((doubles.len(), doubles.colors()), (1065, simple.colors()), "PCD and LAS");
    for name in ["Intensity", "ReturnNumber", "GpsTime", "PointSourceId"] {
        assert_eq!(doubles.field(name), simple.field(name), "PCD and LAS: {name}");
    }
    let utm = load(&folder, "malformed/xyz_7_columns_utm.xyz");
    assert_eq!((utm.len(), utm.colors().unwrap()[0]), (101, [117, 73, 49]), "text with colours and alpha");
    let first = DVec3::new(665_187.522_077, 5_648_349.895_035, 241.767_693);
    assert!((utm.world_position(0) - first).abs().max_element() < 1e-5, "text keeps survey coordinates");
}

#[test]
fn meshes_have_the_triangles_that_others_say() {
    let Some(folder) = shared_data() else { return };
    let mesh = |file: &str| {
        read_mesh(&folder.join(file), &ReadOptions::default(), &()).unwrap_or_else(|error| panic!("{error}"))
    };
    for (file, faces) in [
        ("models/bunny.ply", 69_451),
        ("models/camelhead.off", 22_704),
        ("models/armadillo_normals.ply", 0),
        ("animation/horse_gallop/frame_000.ply", 16_843),
        ("animation/samba/frame_000.ply", 19_938),
    ] {
        let mesh = mesh(file);
        assert_eq!(mesh.triangles.len(), faces, "{file}");
        let described = describe(&folder.join(file), &ReadOptions::default()).unwrap();
        assert_eq!(described.faces, Some(faces as u64), "{file}: described");
        assert_eq!(described.points, Some(mesh.cloud.len() as u64), "{file}: described");
    }
    // A closed surface of V points has 2 V - 4 triangles. Two triangles share each edge, in opposite directions.
    let igea = mesh("models/igea.ply");
    assert_eq!(igea.triangles.len(), 2 * 134_345 - 4, "the strips of a closed surface");
    let mut edges: Vec<[u32; 2]> = igea.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    edges.sort_unstable();
    let count = edges.len();
    edges.dedup();
    assert_eq!(edges.len(), count, "no edge twice in the same sense");
    assert!(edges.iter().all(|&[a, b]| edges.binary_search(&[b, a]).is_ok()), "each edge in the other sense too");
    // Its bytes that were not UTF-8 are U+FFFD, as in the malformed files.
    let stork = folder.join("animation/stork_morph.glb");
    assert!(read(&stork, &()).is_err_and(|error| error.to_string().contains("UTF-8")), "the stork is destroyed");
    // Two faces have an index beyond all vertices, or no index.
    let cube = mesh("malformed/obj_malformed.obj");
    assert_eq!((cube.cloud.len(), cube.triangles.len()), (8, 8), "four of six squares");
}

#[test]
fn malformed_files_are_told_or_read() {
    let Some(folder) = shared_data() else { return };
    let folder = folder.join("malformed");
    // The number of certain points, or words that the error must contain.
    let expected: &[(&str, Result<usize, &str>)] = &[
        ("copc_fake.copc.laz", Err("header")),
        ("e57_corrupt_crc.e57", Err("checksum of page")),
        ("e57_empty.e57", Ok(0)),
        ("e57_invalid_cv_header.e57", Ok(0)),
        ("e57_read_error.e57", Ok(2651)),
        ("las_bad_vlr_count.las", Ok(10)),
        ("las_gps_time_nan.las", Ok(1)),
        ("las_lots_of_vlr.las", Ok(1)),
        ("las_no_points.las", Ok(0)),
        ("laz_four_bytes.laz", Err("byte 4: the header")),
        ("laz_two_padding_bytes.laz", Ok(1065)),
        ("obj_malformed.obj", Ok(8)),
        ("off_out_of_memory.off", Err("line 2: 353535235358 vertices cannot be in a file of 309 bytes")),
        ("pcd_comma_separated.pcd", Ok(10)),
        ("pcd_missing_header.pcd", Ok(10)),
        ("pcd_utf8_destroyed.pcd", Err("UTF-8")),
        ("ply_crash_fuzz.ply", Err("line 7")),
        ("ply_crlf_header_binary.ply", Ok(8)),
        ("ply_empty.ply", Err("empty")),
        ("ply_header_only.ply", Err("no element 'vertex'")),
        ("ply_no_vertex.ply", Err("no element 'vertex'")),
        ("ply_points_with_lists.ply", Ok(5)),
        ("ply_utf8_destroyed.ply", Err("UTF-8")),
        ("ply_wrong_format_short_row.ply", Err("line 13")),
        ("xyz_7_columns_utm.xyz", Ok(101)),
    ];
    let mut checked = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        let result = read(&path, &());
        let Some((_, expected)) = expected.iter().find(|(file, _)| *file == name) else {
            assert_eq!(name, "mcap_lfs_pointer.mcap", "every other file is expected here");
            let message = result.unwrap_err().to_string();
            assert!(message.contains("Git LFS") && message.contains("pull"), "{message}");
            continue;
        };
        checked += 1;
        match (result, expected) {
            (Ok(cloud), Ok(count)) => assert_eq!(cloud.len(), *count, "{name}"),
            (Err(error), Err(words)) => {
                let message = error.to_string();
                assert!(message.contains(words) && message.contains(name), "{message} should contain '{words}'");
                assert!(!message.contains(char::is_control), "{message:?} is one line of plain text");
            }
            (Ok(cloud), Err(_)) => panic!("{name} was read: {} points", cloud.len()),
            (Err(error), Ok(_)) => panic!("{error}"),
        }
    }
    assert_eq!(checked, expected.len(), "all files are there");
}

#[test]
fn sensors_stand_where_it_is_sure() {
    let Some(folder) = shared_data() else { return };
    let at_the_origin = [
        "scans/pump_room.e57",
        "scans/spherical.e57",
        "scans/five_people.pcd",
        "scans/kitti_000008_fov.bin",
        "scans/nuscenes_n015.pcd.bin",
        "sequences/rgbd_kinect/depth_1.pgm",
    ];
    for file in at_the_origin {
        let cloud = load(&folder, file);
        let found: Vec<_> = cloud.scans().iter().map(|scan| (scan.position(), scan.points.clone())).collect();
        assert_eq!(found, [(DVec3::ZERO, 0..cloud.len())], "{file}");
    }
    // Models, merged clouds, and points moved into the coordinates of a survey.
    let unknown = [
        "scans/bunny_float.e57",
        "scans/rgb_float.e57",
        "scans/two_scans.e57",
        "scans/color.ptx",
        "scans/two_scans.ptx",
        "scans/livingroom_fragment.pcd",
        "scans/autzen_utm_f64.pcd",
        "scans/autzen_trim.laz",
        "sequences/kitti_drive_pcd/000000.pcd",
        "models/bunny.ply",
    ];
    for file in unknown {
        assert_eq!(load(&folder, file).scans(), [], "{file}");
    }
}
