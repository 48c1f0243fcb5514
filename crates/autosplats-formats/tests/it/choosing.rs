//! Which points are kept, by class, flag and return, in all formats.

use std::path::Path;

use autosplats_cloud::{Error, FieldValues, PointCloud, PointFilter, glam::DVec3};
use autosplats_formats::{ReadOptions, read_bytes, read_marked, read_mesh_bytes, write};

use crate::common::{las_files::Notes, shared_data};

/// Classes, flags and returns of the points of a file: ground, building, low noise, a withheld building, high noise.
const POINTS: [(u8, bool, u8); 5] = [(2, false, 1), (6, false, 1), (7, false, 2), (6, true, 1), (18, false, 1)];

/// A LAS file of [`POINTS`], each at its index along x and as often as `times` says.
fn las(version: (u8, u8), format: u8, compressed: bool, times: usize) -> Vec<u8> {
    let mut builder = las::Builder::from(version);
    builder.point_format = las::point::Format::new(format).unwrap();
    builder.point_format.is_compressed = compressed;
    let format = builder.point_format;
    let mut writer = las::Writer::new(std::io::Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    for (x, &(class, is_withheld, number)) in POINTS.iter().enumerate().flat_map(|point| vec![point; times]) {
        let point = las::Point {
            x: x as f64,
            y: 1.0,
            z: 2.0,
            classification: las::point::Classification::new(class).unwrap(),
            is_withheld,
            return_number: number,
            number_of_returns: 2,
            gps_time: format.has_gps_time.then_some(1.0),
            color: format.has_color.then(Default::default),
            nir: format.has_nir.then_some(1),
            ..Default::default()
        };
        writer.write_point(point).unwrap();
    }
    writer.close().unwrap();
    writer.into_inner().unwrap().into_inner()
}

fn options(keep: &str) -> ReadOptions {
    let keep = Some(keep.parse().unwrap_or_else(|error| panic!("{keep}: {error}")));
    ReadOptions { keep, ..ReadOptions::default() }
}

/// The kept points by their x, and the notes.
fn kept(name: &str, bytes: &[u8], keep: &str) -> (Vec<usize>, Vec<String>) {
    let notes = Notes::default();
    let cloud = read_bytes(Path::new(name), bytes, &options(keep), &notes)
        .unwrap_or_else(|error| panic!("{name}, {keep}: {error}"));
    ((0..cloud.len()).map(|i| cloud.world_position(i).x as usize).collect(), notes.notes.into_inner().unwrap())
}

fn refused(name: &str, bytes: &[u8], keep: &str) -> Error {
    match read_bytes(Path::new(name), bytes, &options(keep), &()) {
        Ok(cloud) => panic!("{name}, {keep}: {} points", cloud.len()),
        Err(error) => error,
    }
}

/// The cloud of [`POINTS`] with a field of classes of this name.
fn cloud(classes: &str) -> PointCloud {
    let positions = (0..POINTS.len()).map(|x| [x as f32, 1.0, 2.0]).collect();
    let classified = FieldValues::U8(POINTS.iter().map(|point| point.0).collect());
    PointCloud::new(DVec3::ZERO, positions).with_field(classes, classified).unwrap()
}

fn written(cloud: &PointCloud, name: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    write(cloud, &folder.path().join(name), &()).unwrap_or_else(|error| panic!("{name}: {error}"));
    std::fs::read(folder.path().join(name)).unwrap()
}

#[test]
fn las_of_all_versions() {
    for (version, format) in [((1, 2), 0), ((1, 2), 1), ((1, 2), 3), ((1, 4), 1), ((1, 4), 6), ((1, 4), 7), ((1, 4), 8)]
    {
        for compressed in [false, true] {
            let name = format!("{version:?}_{format}_{compressed}.las");
            // Older formats keep classes in five bits beside the flags.
            let bytes = las(version, format, compressed, 1);
            let (points, notes) = kept(&name, &bytes, "usual");
            assert_eq!(points, [0, 1], "{name}");
            let said =
                "3 of 5 points: 1 low noise (class 7), 1 high noise (class 18), 1 withheld; --keep all keeps them";
            assert_eq!(notes, [format!("left out {said}")], "{name}");
            for (keep, expected) in [
                ("all", &[0, 1, 2, 3, 4][..]),
                ("building", &[1, 3]),
                ("6,-withheld", &[1]),
                ("noise", &[2, 4]),
                ("withheld", &[3]),
                ("last", &[2]),
                ("2..6,first", &[0, 1, 3]),
                ("-synthetic,-7", &[0, 1, 3, 4]),
            ] {
                assert_eq!(kept(&name, &bytes, keep).0, expected, "{name}, {keep}");
            }
            let error = refused(&name, &bytes, "road").to_string();
            let why = "--keep road leaves none of its 5 points; its classes: 2 ground, 6 building, 7 low point (noise)";
            assert!(error.contains(&name) && error.contains(why), "{error}");
        }
    }
}

#[test]
fn many_points_and_previews() {
    let bytes = las((1, 4), 6, true, 60_000);
    let notes = Notes { wants_chunks: true, ..Notes::default() };
    let all = read_bytes(Path::new("a.laz"), &bytes, &options("usual"), &notes).unwrap();
    assert_eq!(all.len(), 120_000, "ground and building");
    let chunks = notes.chunks.into_inner().unwrap();
    assert!(!chunks.is_empty(), "there are previews");
    let seen = chunks.iter().flat_map(|chunk| (0..chunk.len()).map(|i| chunk.world_position(i).x));
    assert!(seen.into_iter().all(|x| x < 1.5), "without noise");
}

#[test]
fn all_formats_with_classes_of_las() {
    for name in ["a.ply", "a.pcd", "a.e57", "a.csv", "a.xyz", "a.las", "a.laz"] {
        let bytes = written(&cloud("Classification"), name);
        assert_eq!(kept(name, &bytes, "usual").0, [0, 1, 3], "{name}: as of LAS");
        assert_eq!(kept(name, &bytes, "noise,ground").0, [0, 2, 4], "{name}");
        assert_eq!(kept(name, &bytes, "all").0.len(), 5, "{name}");
    }
    let ply = |name: &str, kind: &str| {
        let rows: String = POINTS.iter().enumerate().map(|(x, point)| format!("{x} 1 2 {}\n", point.0)).collect();
        format!(
            "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
             property {kind} {name}\nend_header\n{rows}"
        )
    };
    for (name, kind) in [("classification", "uchar"), ("scalar_Classification", "float"), ("Classification", "int")] {
        assert_eq!(kept("a.ply", ply(name, kind).as_bytes(), "usual").0, [0, 1, 3], "{name}");
    }
    // A label 7 of a data set may be a car.
    for name in ["class", "label", "scalar_Label", "scalar_class"] {
        let bytes = ply(name, "uchar");
        let (points, notes) = kept("a.ply", bytes.as_bytes(), "usual");
        assert_eq!((points.len(), notes.len()), (5, 0), "{name}: nothing goes by itself");
        assert_eq!(kept("a.ply", bytes.as_bytes(), "building").0, [1, 3], "{name}: but if asked for");
        assert_eq!(kept("a.ply", bytes.as_bytes(), "-18").0, [0, 1, 2, 3], "{name}");
    }
    let csv = "x,y,z,class,Withheld\n0,1,2,7,0\n1,1,2,2,1\n";
    assert_eq!(kept("a.csv", csv.as_bytes(), "-withheld").0, [0], "by name");
}

#[test]
fn what_a_file_lacks_is_told() {
    let csv = b"x,y,z,Intensity\n0,1,2,7\n1,1,2,2\n";
    for (keep, lacks) in [("ground", "Classification"), ("-withheld", "Withheld"), ("first", "ReturnNumber")] {
        let error = refused("a.csv", csv, keep).to_string();
        let said = format!("a.csv: --keep {keep}: its points have no field {lacks}; there are Intensity");
        assert_eq!(error, said);
    }
    assert!(refused("a.xyz", b"0 1 2\n3 4 5\n", "ground").to_string().contains("they have none"), "no fields");
    assert_eq!(kept("a.csv", csv, "usual"), (vec![0, 1], vec![]), "nothing is noise");
    // LAS has the fields even if they are 0 at every point.
    let zeros = written(&PointCloud::new(DVec3::ZERO, vec![[1.0; 3], [2.0; 3]]), "a.las");
    assert_eq!(kept("a.las", &zeros, "0,-withheld").0, [1, 2], "never classified");
    assert!(matches!(refused("a.las", &zeros, "ground"), Error::NothingKept { points: 2, .. }), "no ground");
}

#[test]
fn a_file_of_noise_is_seen() {
    let noise = PointCloud::new(DVec3::ZERO, vec![[1.0; 3], [2.0; 3]]);
    let noise = noise.with_field("Classification", FieldValues::U8(vec![7, 18])).unwrap();
    let (points, notes) = kept("a.las", &written(&noise, "a.las"), "usual");
    assert_eq!(points, [1, 2], "there is nothing else");
    assert_eq!(notes, ["all 2 points are noise or withheld, so they are kept"]);
}

#[test]
fn triangles_lose_corners_that_are_left_out() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
               property uchar label\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
               0 0 0 7\n1 0 0 2\n1 1 0 2\n0 1 0 2\n3 0 1 2\n3 1 2 3\n";
    let mesh = read_mesh_bytes(Path::new("a.ply"), ply.as_bytes(), &options("ground"), &()).unwrap();
    assert_eq!((mesh.cloud.len(), mesh.triangles), (3, vec![[0, 1, 2]]), "the second triangle");
}

#[test]
fn the_field_file_without_noise() {
    let Some(data) = shared_data() else { return };
    let path = data.join("../field/l17b_class7_noise.las");
    let (cloud, left) = read_marked(&path, &options("usual"), &()).unwrap();
    assert_eq!((cloud.len(), left.count()), (6000, 1500), "all points, of which some are marked");
    let bytes = std::fs::read(&path).unwrap();
    let shown = read_bytes(&path, &bytes, &options("usual"), &()).unwrap();
    let highest = (0..shown.len()).map(|i| shown.world_position(i).z).fold(0.0, f64::max);
    assert!(shown.len() == 4500 && highest < 2.0, "the noise is 30 high: {highest}");
    let mut filtered = cloud;
    assert_eq!(filtered.keep(&PointFilter::usual()), left, "the library does the same");
    assert_eq!(filtered.positions(), shown.positions());
}
