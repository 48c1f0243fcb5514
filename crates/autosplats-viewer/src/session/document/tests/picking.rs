//! Information on a picked point.

use std::{path::PathBuf, sync::Arc};

use autosplats::cloud::{
    FieldValues, PointCloud, Scan,
    glam::{DMat4, DVec3},
};
use autosplats_formats::ReadOptions;

use super::super::{Document, Layer};
use super::{FAR, cloud, document, edit, every};

#[test]
fn exact_values_of_the_point_that_is_shown() {
    let (mut document, [_, second]) = document();
    edit(&mut document, second, |layer| {
        layer.path = Some(PathBuf::from("second.las"));
        layer.edits.deleted = every(700, 2);
        layer.edits.moves = vec![(every(700, 3), DMat4::from_translation(DVec3::new(1e-7, 0.0, 0.0)))];
    });
    let shown = document.shown();
    let index = (0..shown.len()).find(|&index| shown.point(index) == Some((second, 9))).expect("it is shown");
    document.rename(second, "renamed");
    let picked = document.describe(&shown, index).expect("a point");
    assert_eq!((picked.layer, picked.point, &*picked.name), (second, 9, "renamed"), "of its layer");
    assert_eq!(picked.path, Some("second.las".into()), "and file");
    let layer = &document.layers[1];
    let file = DVec3::new(1.0 + f64::from(0.63_f32) + f64::from(1e-9_f32), 0.0, f64::from(0.59_f32));
    assert!((picked.file_position - file).abs().cmple(DVec3::new(1e-15, 1.0, 1e-15)).all(), "{}", picked.file_position);
    assert_eq!(picked.file_position, layer.cloud.world_position(9), "with its residual");
    let moved = layer.pose.transform_point3(picked.file_position + DVec3::new(1e-7, 0.0, 0.0));
    assert_eq!(picked.position, moved, "moved, then placed");
    assert_eq!(picked.color, Some([9, 0, 7]), "its own colour");
    assert_eq!(picked.fields, [("Id".to_owned(), "18446744073709551606".to_owned())], "beyond f64");
    assert_eq!(document.describe(&shown, shown.len()), None, "no such point");
    document.remove(second);
    assert_eq!(document.describe(&shown, index), None, "gone");
}

#[test]
fn values_have_their_own_digits() {
    let fields = [
        ("a", FieldValues::U8(vec![0, 255]), "255"),
        ("b", FieldValues::I8(vec![0, -128]), "-128"),
        ("c", FieldValues::U16(vec![0, 65535]), "65535"),
        ("d", FieldValues::I16(vec![0, -1]), "-1"),
        ("e", FieldValues::U32(vec![0, u32::MAX]), "4294967295"),
        ("f", FieldValues::I32(vec![0, i32::MIN]), "-2147483648"),
        ("g", FieldValues::U64(vec![0, (1 << 53) + 1]), "9007199254740993"),
        ("h", FieldValues::I64(vec![0, i64::MIN + 1]), "-9223372036854775807"),
        ("i", FieldValues::F32(vec![0.0, 0.1]), "0.1"),
        ("j", FieldValues::F64(vec![0.0, 0.1 + 0.2]), "0.30000000000000004"),
    ];
    let mut cloud = PointCloud::new(DVec3::ZERO, vec![[0.0; 3], [0.1, -2.5, 1e7]]);
    for (name, values, _) in fields.clone() {
        cloud = cloud.with_field(name, values).expect("two values");
    }
    let scan = Scan { name: Some("east".into()), world_from_sensor: DMat4::IDENTITY, points: 1..2 };
    let describe = |cloud: PointCloud| {
        let mut document = Document::default();
        document.add(Layer::new("only", None, Arc::new(cloud)));
        document.describe(&document.shown(), 1).expect("a point")
    };
    let picked = describe(cloud.clone().with_scans(vec![scan]));
    let texts: Vec<_> = picked.fields.iter().map(|(name, text)| (&**name, &**text)).collect();
    assert_eq!(texts, fields.each_ref().map(|(name, _, text)| (*name, *text)), "all digits and no more");
    assert_eq!(picked.scan.as_deref(), Some("east"), "seen from there");
    assert_eq!(picked.file_text, ["0.1", "-2.5", "10000000"], "digits of f32");
    let stepped = cloud.clone().with_resolution(DVec3::new(0.01, 0.00025, 1.0));
    assert_eq!(describe(stepped).file_text, ["0.10", "-2.50000", "10000000"], "digits of the file's steps");
    let odd = PointCloud::new(DVec3::splat(0.0625), vec![[0.0; 3]; 2]).with_resolution(DVec3::splat(0.01));
    assert_eq!(describe(odd).file_text, ["0.0625", "0.0625", "0.0625"], "steps from an odd place");
    let doubles = PointCloud::new(FAR, vec![[0.0; 3], [0.5, 0.25, 0.0]]);
    assert_eq!(describe(doubles).file_text, ["512000.5", "5400000.25", "300"], "digits of f64");
    let place = DVec3::new(512_000.0, 0.0, 0.0);
    let singles = PointCloud::new(place, vec![[0.0; 3], [512_000.1_f32 - 512_000.0, 0.1, -0.1]]);
    assert_eq!(describe(singles).file_text, ["512000.1", "0.1", "-0.1"], "digits of f32 about a place");
    assert_eq!(describe((*super::cloud(2, FAR)).clone()).color, cloud_color(), "its colour");
}

/// Coordinates are shown with the file's digits, however they are stored.
#[test]
fn coordinates_are_told_as_the_file_has_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let digits = |name: &str, content: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, content).expect("written");
        let options = ReadOptions { exact: true, ..ReadOptions::default() };
        let cloud = autosplats_formats::read_with(&path, &options, &()).expect("read");
        (0..cloud.len()).map(|point| super::super::pick::file_text(&cloud, point).to_vec()).collect::<Vec<_>>()
    };
    let head = |encoding: &str, kind: &str, count: usize| {
        let xyz = ["x", "y", "z"].map(|axis| format!("property {kind} {axis}\n")).concat();
        format!("ply\nformat {encoding} 1.0\nelement vertex {count}\n{xyz}end_header\n").into_bytes()
    };
    let mut single = head("binary_little_endian", "float", 2);
    let values = [[-0.032_292_2_f32, 0.1, 1e7], [0.3, -2.5e-9, 0.0]];
    values.as_flattened().iter().for_each(|value| single.extend(value.to_le_bytes()));
    assert_eq!(digits("f32.ply", &single)[0], ["-0.0322922", "0.1", "10000000"], "f32");
    let mut text = head("ascii", "float", 2);
    text.extend(b"-0.0322922 0.129176 0.00447467\n0.1 0.2 0.3\n");
    assert_eq!(digits("text.ply", &text)[0], ["-0.0322922", "0.129176", "0.00447467"], "text");
    let lines = "512345.678 5412345.12 -0.0322922\n512345.6781 5412345.3 0.0000001\n";
    let wanted: Vec<Vec<&str>> = lines.lines().map(|line| line.split(' ').collect()).collect();
    assert_eq!(digits("lost.xyz", lines.as_bytes()), wanted, "with what f32 loses");
    let coarse = PointCloud::new(DVec3::new(512_345.67, 0.0, 0.0), vec![[0.0; 3], [0.01, 0.1, -1.0]]);
    let path = folder.path().join("steps.las");
    autosplats_formats::write(&coarse.with_resolution(DVec3::splat(0.01)), &path, &()).expect("written");
    let steps = std::fs::read(&path).expect("read");
    assert_eq!(digits("again.las", &steps)[1], ["512345.68", "0.10", "-1.00"], "steps of a hundredth");
}

fn cloud_color() -> Option<[u8; 3]> {
    cloud(2, FAR).colors().map(|colors| colors[1])
}
