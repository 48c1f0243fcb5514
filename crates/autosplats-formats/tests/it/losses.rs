//! Tests of what writing, reading back and merging must keep, and of the notes about losses.

use std::{
    sync::Mutex,
    time::{Duration, Instant},
};

use crate::common::{error, positions, read_bytes};
use autosplats_cloud::{
    Axes, Crs, FieldValues, PointCloud, Progress, Scan,
    glam::{DMat4, DVec3},
};
use autosplats_formats::{ReadOptions, open_parts_of, read, read_with, write};

#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Progress for Notes {
    fn report(&self, _fraction: f32) {}
    fn note(&self, note: &str) {
        self.0.lock().unwrap().push(note.into());
    }
}

/// Keeps losses, but not notes.
#[derive(Default)]
struct Losses(Mutex<Vec<String>>);

impl Progress for Losses {
    fn report(&self, _fraction: f32) {}
    fn loss(&self, loss: &str) {
        self.0.lock().unwrap().push(loss.into());
    }
}

#[test]
fn what_is_cut_off_is_a_loss_or_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = PointCloud::new(DVec3::ZERO, positions(5000));
    for name in ["a.ply", "a.pcd", "a.las", "ascii.ply"] {
        let path = folder.path().join(name);
        write(&cloud, &path, &()).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        if name == "ascii.ply" {
            let rows = positions(5000).iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect::<String>();
            let names = "property float x\nproperty float y\nproperty float z\nend_header\n";
            bytes = format!("ply\nformat ascii 1.0\nelement vertex 5000\n{names}{rows}").into_bytes();
        }
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        let read = |whole: bool, losses: &Losses| {
            let options = ReadOptions { whole, ..ReadOptions::default() };
            let all = read_with(&path, &options, losses).map(|cloud| cloud.len());
            let parts = open_parts_of(&path, &options, 1 << 10, losses).map(|parts| parts.unwrap().points());
            [all, parts]
        };
        let losses = Losses::default();
        let [all, parts] = read(false, &losses).map(Result::unwrap);
        assert!(all == parts && (2000..3000).contains(&all), "{name}: {all} and {parts} points");
        let told = losses.0.into_inner().unwrap();
        let loss = format!("the file is cut off: {} of 5000 points are lost; copy it again", 5000 - all);
        assert_eq!(told, [&*loss, &*loss], "{name}");
        for error in read(true, &Losses::default()).map(Result::unwrap_err) {
            let error = error.to_string();
            let remedy = "points are lost; copy it again; --salvage takes what is left";
            assert!(error.contains(name) && error.ends_with(remedy), "{name}: {error}");
        }
    }
}

/// Writes a cloud, and returns the notes, the bytes, and the cloud read back with all digits.
fn through(name: &str, cloud: &PointCloud) -> (Vec<String>, Vec<u8>, PointCloud) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let notes = Notes::default();
    write(cloud, &path, &notes).unwrap();
    let options = ReadOptions { exact: true, ..ReadOptions::default() };
    let back = read_with(&path, &options, &()).unwrap();
    (notes.0.into_inner().unwrap(), std::fs::read(&path).unwrap(), back)
}

/// 16-bit colours that 8 bits cannot hold.
const WIDE: [[u16; 3]; 3] = [[65535, 0, 300], [1, 2, 3], [40000, 30000, 20000]];

fn wide_cloud() -> PointCloud {
    let bytes = WIDE.map(|color| color.map(|channel| (channel >> 8) as u8));
    let mut cloud = PointCloud::new(DVec3::ZERO, positions(3)).with_colors(bytes.to_vec()).unwrap();
    for (channel, name) in ["Red", "Green", "Blue"].into_iter().enumerate() {
        let values = WIDE.iter().map(|color| color[channel]).collect();
        cloud = cloud.with_field(name, FieldValues::U16(values)).unwrap();
    }
    cloud
}

#[test]
fn wide_colors_are_the_colors_of_a_file() {
    let cloud = wide_cloud();
    for name in ["a.ply", "a.pcd", "a.las", "a.e57", "a.xyz"] {
        let (_, bytes, back) = through(name, &cloud);
        assert_eq!(back.colors(), cloud.colors(), "{name}: 8 bits of them");
        for channel in ["Red", "Green", "Blue"] {
            assert_eq!(back.field(channel), cloud.field(channel), "{name}: and all of {channel}");
        }
        assert_eq!(back.fields().len(), 3, "{name}: nothing else");
        if name == "a.ply" {
            let header = String::from_utf8_lossy(&bytes);
            assert!(header.contains("property ushort red\n") && !header.contains("uchar"), "other programs see them");
        }
    }
}

#[test]
fn wide_colors_of_another_scale_are_no_colors() {
    // A cloud with only its dark points left, whose 16-bit values look like 8-bit ones.
    let mut cloud = wide_cloud();
    cloud.retain(|i| i == 1);
    for name in ["a.ply", "a.las", "a.e57", "a.xyz"] {
        let back = through(name, &cloud).2;
        // LAS leaves out values that are zero for all points.
        assert_eq!(back.colors().unwrap_or(&[[0; 3]]), [[0; 3]], "{name}: still black");
    }
}

#[test]
fn losses_are_told() {
    let scans = vec![Scan { name: None, world_from_sensor: DMat4::IDENTITY, points: 0..3 }];
    let cloud = PointCloud::new(DVec3::ZERO, positions(3)).with_scans(scans).with_axes(Axes::YUp);
    let cloud = cloud.with_crs(Crs { epsg: Some(32633), ..Crs::default() });
    let cloud = cloud.with_field("id", FieldValues::U64(vec![1, 2, u64::MAX])).unwrap();
    let notes = |name| through(name, &cloud).0.join("\n");
    assert_eq!(
        notes("a.ply"),
        "PLY does not hold the poses of the sensors, the coordinate system\nid: integers beyond 53 bits are rounded",
        "PLY"
    );
    assert_eq!(notes("a.xyz"), "text does not hold the poses of the sensors, the coordinate system, which axis is up");
    assert!(notes("a.las").contains("LAS does not store which axis is up"), "{}", notes("a.las"));
}

#[test]
fn a_mesh_keeps_the_corners_at_its_origin() {
    // A cube whose faces have their own corners, as with normals.
    let corners = "0 0 0\n1 0 0\n1 1 0\n0 0 0\n0 1 0\n0 1 1\n";
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let mesh = format!(
        "ply\nformat ascii 1.0\nelement vertex 6\n{xyz}element face 2\nproperty list uchar int vertex_indices\n\
         end_header\n{corners}3 0 1 2\n3 3 4 5\n"
    );
    assert_eq!(read_bytes("a.ply", mesh.as_bytes()).unwrap().len(), 6, "with faces");
    let scan = format!("ply\nformat ascii 1.0\nelement vertex 6\n{xyz}end_header\n{corners}");
    assert_eq!(read_bytes("a.ply", scan.as_bytes()).unwrap().len(), 4, "without any");
    let one = PointCloud::new(DVec3::ZERO, vec![[0.0; 3], [1.0, 0.0, 0.0]]);
    for name in ["a.ply", "a.xyz", "a.las", "a.e57"] {
        assert_eq!(through(name, &one).2.len(), 2, "{name}: a single point may be a real one");
    }
    assert_eq!(through("a.pcd", &one).2.len(), 1, "where PCD comes from, a sensor stands at the origin");
}

#[test]
fn fields_of_one_meaning_are_both_kept() {
    let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                property uchar intensity\nproperty float scalar_Intensity\nend_header\n1 2 3 4 0.5\n";
    let cloud = read_bytes("a.ply", text.as_bytes()).unwrap();
    let found: Vec<_> = cloud.fields().iter().map(|field| (&*field.name, field.values.get(0))).collect();
    assert_eq!(found, [("Intensity", 4.0), ("Intensity_", 0.5)], "neither replaces the other");
}

#[test]
fn intensities_of_white_points_stay_intensities() {
    let text = "2\n1 2 3 10 255 255 255\n4 5 6 20 255 255 255\n";
    let cloud = read_bytes("a.pts", text.as_bytes()).unwrap();
    assert_eq!(cloud.colors(), Some(&[[255; 3]; 2][..]), "white");
    assert_eq!(cloud.field("Intensity").map(|field| field.values.get(1)), Some(20.0), "and no alpha");
}

#[test]
fn normals_are_turned_with_their_points() {
    let axis = |name: &str, cloud: PointCloud, values: [f32; 2]| {
        cloud.with_field(name, FieldValues::F32(values.to_vec())).unwrap()
    };
    let mut cloud = PointCloud::new(DVec3::ZERO, vec![[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    for (name, values) in [("NormalX", [1.0, 0.0]), ("NormalY", [0.0, 0.0]), ("NormalZ", [0.0, 0.5])] {
        cloud = axis(name, cloud, values);
    }
    let turn = DMat4::from_rotation_z(std::f64::consts::FRAC_PI_2) * DMat4::from_scale(DVec3::splat(3.0));
    let merged = PointCloud::merge(vec![(cloud.clone(), DMat4::IDENTITY), (cloud, turn)]);
    let normal =
        |i: usize| DVec3::from(["NormalX", "NormalY", "NormalZ"].map(|name| merged.field(name).unwrap().values.get(i)));
    assert_eq!((normal(0), normal(1)), (DVec3::X, DVec3::Z * 0.5), "those of the part that stays");
    assert!(normal(2).abs_diff_eq(DVec3::Y, 1e-6), "turned, not stretched: {}", normal(2));
    assert!(normal(3).abs_diff_eq(DVec3::Z * 0.5, 1e-6), "as long as before: {}", normal(3));
}

/// Far above what these tests take, and far below a loop over all scans for each point.
const LIMIT: Duration = Duration::from_secs(5);

#[test]
fn as_many_scans_as_points() {
    let count = 200_000;
    let scan = |i: usize| Scan { name: None, world_from_sensor: DMat4::IDENTITY, points: i..i + 1 };
    let mut cloud = PointCloud::new(DVec3::ZERO, positions(count)).with_scans((0..count).map(scan).collect());
    let start = Instant::now();
    cloud.retain(|i| i % 2 == 1);
    assert!(start.elapsed() < LIMIT, "{:?}", start.elapsed());
    let ranges: Vec<_> = cloud.scans().iter().take(4).map(|scan| scan.points.clone()).collect();
    assert_eq!(ranges, [0..0, 0..1, 1..1, 1..2], "each keeps its own points");
    assert_eq!(cloud.scans()[count - 1].points, count / 2 - 1..count / 2, "up to the last");
}

#[test]
fn a_small_gltf_shows_no_more_than_it_could_list() {
    let start = Instant::now();
    let nodes = vec![r#"{"mesh":0}"#; 20_000].join(",");
    let primitives = vec![r#"{"attributes":{"POSITION":0}}"#; 20_000].join(",");
    let bomb = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{nodes}],"meshes":[{{"primitives":[{primitives}]}}],
        "accessors":[{{"componentType":5126,"type":"VEC3","count":0}}]}}"#
    );
    let message = error("bomb.gltf", bomb.as_bytes());
    assert!(message.contains("primitives, too many"), "{message}");

    let view = r#"{"bufferView":0,"componentType":5121}"#;
    let sparse = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"buffers":[{{"uri":"data:;base64,AAAA","byteLength":3}}],
        "bufferViews":[{{"buffer":0,"byteLength":3}}],"accessors":[{{"componentType":5126,"type":"VEC3","count":1,
        "sparse":{{"count":2,"indices":{view},"values":{{"bufferView":0}}}}}}]}}"#
    );
    let message = error("sparse.gltf", sparse.as_bytes());
    assert!(message.contains("2 sparse values for 1 elements"), "{message}");

    let named = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "buffers":[{"uri":"%1b[31m.bin","byteLength":12}],"bufferViews":[{"buffer":0,"byteLength":12}],
        "accessors":[{"componentType":5126,"type":"VEC3","count":1,"bufferView":0}]}"#;
    error("named.gltf", named.as_bytes());
    assert!(start.elapsed() < LIMIT, "{:?}", start.elapsed());
}

#[test]
fn colors_may_exceed_full_brightness_a_little() {
    let text = |white: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
             property float red\nproperty float green\nproperty float blue\nend_header\n1 2 3 {white} 0 0\n4 5 6 0 0 0\n"
        )
    };
    for white in ["1.000001", "255.25", "65535"] {
        let cloud = read_bytes("a.ply", text(white).as_bytes()).unwrap();
        assert_eq!(cloud.colors().unwrap()[0], [255, 0, 0], "{white} is full red");
    }
}

#[test]
fn notes_stay_few_and_short() {
    let fields = |word: &str, count: usize| vec![word; count].join(" ");
    let header = format!(
        "FIELDS x y z {}\nSIZE {s}\nTYPE {}\nCOUNT 1 1 1 {}\nPOINTS 0\nDATA binary\n",
        fields("long", 500),
        fields("F", 503),
        fields("99", 500),
        s = fields("4", 503),
    );
    let row = fields("1.5", 900);
    for (name, text) in [("a.pcd", header), ("a.xyz", format!("{row}\n{row}\n"))] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, &text).unwrap();
        let notes = Notes::default();
        read(&path, &notes).unwrap();
        let notes = notes.0.into_inner().unwrap();
        assert!(notes.len() <= 10 && notes.iter().all(|note| note.len() < 700), "{name}: {notes:?}");
    }
}
