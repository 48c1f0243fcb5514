//! Tests of PTX: scans with poses, and files that are not PTX.

use std::{path::Path, sync::Mutex};

use crate::common::error;
use autosplats_cloud::{
    Axes, FieldValues, PointCloud, Progress,
    glam::{DMat3, DVec3},
};
use autosplats_formats::{ReadOptions, describe_bytes, read_bytes};

/// Stores the notes and the early points.
#[derive(Default)]
struct Told {
    notes: Mutex<Vec<String>>,
    chunks: Mutex<Vec<PointCloud>>,
}

impl Progress for Told {
    fn report(&self, _fraction: f32) {}

    fn note(&self, note: &str) {
        self.notes.lock().unwrap().push(note.into());
    }

    fn wants_chunks(&self) -> bool {
        true
    }

    fn chunk(&self, points: PointCloud) {
        self.chunks.lock().unwrap().push(points);
    }
}

fn load(text: &str, options: &ReadOptions) -> (PointCloud, Told) {
    let told = Told::default();
    let cloud = read_bytes(Path::new("a.ptx"), text.as_bytes(), options, &told);
    (cloud.unwrap_or_else(|error| panic!("{error}")), told)
}

/// A quarter turn about z, and an origin in survey coordinates.
const TURNED: &str =
    "500000.5 5400000.25 100\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n500000.5 5400000.25 100 1\n";
const PLAIN: &str = "1 2 3\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";

#[test]
fn scans_are_placed_turned_and_coloured() {
    let text = format!(
        "2\n2\n{TURNED}1 0 0 0.25 1 2 3\n0 0 0 0.5 0 0 0\n0 2 0.125 0.75 4 5 6\n0 0 0 0.5 0 0 0\n\
         1\n1\n{TURNED}0 0 -1 1 255 254 253\n"
    );
    for text in [text.clone(), text.replace('\n', "\r\n"), text.trim_end().into()] {
        let (cloud, told) = load(&text, &ReadOptions { exact: true, ..ReadOptions::default() });
        let world: Vec<_> = (0..cloud.len()).map(|i| cloud.world_position(i)).collect();
        let expected =
            [(500_000.5, 5_400_001.25, 100.0), (499_998.5, 5_400_000.25, 100.125), (500_000.5, 5_400_000.25, 99.0)];
        assert_eq!(world, expected.map(DVec3::from), "turned, then moved, in double precision");
        assert_eq!(cloud.colors().unwrap(), [[1, 2, 3], [4, 5, 6], [255, 254, 253]], "colours");
        assert_eq!(cloud.fields()[0].values, FieldValues::F32(vec![0.25, 0.75, 1.0]), "intensity");
        assert_eq!(cloud.axes(), Some(Axes::ZUp), "scanners stand upright");
        let scans = cloud.scans();
        assert_eq!([&scans[0].points, &scans[1].points], [&(0..2), &(2..3)], "which points are whose");
        assert_eq!(scans[0].position(), DVec3::new(500_000.5, 5_400_000.25, 100.0), "where the scanner stood");
        let x = DMat3::from_mat4(scans[0].world_from_sensor).x_axis;
        assert_eq!(x, DVec3::Y, "its x axis is the world's y axis");
        let notes = told.notes.into_inner().unwrap();
        assert!(notes.len() == 1 && notes[0].starts_with("2 of 5 points are at (0, 0, 0)"), "{notes:?}");
        let seen: usize = told.chunks.into_inner().unwrap().iter().map(PointCloud::len).sum();
        assert_eq!(seen, 3, "the preview has all points");
        let options = ReadOptions { keep_no_returns: true, ..ReadOptions::default() };
        assert_eq!(load(&text, &options).0.len(), 5, "kept if wanted");
    }
}

#[test]
fn nobody_stands_where_no_number_reaches() {
    let points = "1 0 0\n2 0 1\n";
    for (x, known) in [("5", true), ("1e300", false), ("-3e19", false)] {
        // Only the position of the scanner is changed; the transform of the points is separate.
        let (cloud, told) = load(&format!("1\n2\n{}{points}", PLAIN.replacen('1', x, 1)), &ReadOptions::default());
        assert_eq!((cloud.len(), cloud.scans().len()), (2, usize::from(known)), "{x}");
        assert_eq!(told.notes.lock().unwrap().is_empty(), known, "{x}: told");
    }
    let huge = PLAIN.replace("0 0 0 1\n", "1e300 0 0 1\n");
    let (cloud, _) = load(&format!("1\n2\n{huge}{points}"), &ReadOptions::default());
    let places: Vec<_> = cloud.scans().iter().map(|scan| scan.position() - cloud.origin()).collect();
    assert!(places.iter().all(|place| place.abs().max_element() <= 1e18), "computed with: {places:?}");
    let broken = format!("1\n2\n{}{points}", PLAIN.replacen('1', "nan", 1));
    assert!(read_bytes(Path::new("a.ptx"), broken.as_bytes(), &ReadOptions::default(), &()).is_err(), "no number");
}

#[test]
fn scans_of_unlike_lines() {
    let text =
        format!("1\n2\n{PLAIN}1 0 0\n2 0 0\n\n1\n1\n{PLAIN}3 0 0 0.5 9 8 7\n1\n1\n{PLAIN}4 0 0 1 2 3\n0\n5\n{PLAIN}");
    let (cloud, told) = load(&text, &ReadOptions::default());
    assert_eq!(cloud.positions(), [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [4.0, 0.0, 0.0]], "all points");
    assert_eq!(cloud.colors().unwrap(), [[200; 3], [200; 3], [9, 8, 7], [1, 2, 3]], "grey without colours");
    let FieldValues::F32(intensity) = &cloud.field("Intensity").unwrap().values else { panic!("no floats") };
    assert!(intensity[0].is_nan() && intensity[2] == 0.5 && intensity[3].is_nan(), "NaN without: {intensity:?}");
    assert!(told.notes.lock().unwrap()[0].contains("only some scans have Intensity"), "and told");
    assert_eq!(
        cloud.scans()[0].position(),
        DVec3::new(1.0, 2.0, 3.0),
        "points in world coordinates: the first lines say"
    );
    assert_eq!(cloud.scans().len(), 4, "an empty scan is one");

    let description = describe_bytes(Path::new("a.txt"), text.as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!((description.points, description.scans.len()), (Some(4), 4), "counted");
    assert_eq!((description.attributes.len(), &*description.format), (7, "PTX, text"), "recognised by content");
    assert_eq!(description.details[0], ("scan 1".into(), "1 columns, 2 rows".into()), "its size");
}

#[test]
fn lines_without_a_colour_among_others() {
    let scan = |points: &[&str]| format!("1\n{}\n{PLAIN}{}\n", points.len(), points.join("\n"));
    for (points, colors) in [
        (["1 0 0 0.5 9 8 7", "2 0 0 0.25", "0 0 0 0.5"], [[9, 8, 7], [200; 3]]),
        (["0 0 0 0.5", "1 0 0 0.5", "2 0 0 0.25 9 8 7"], [[200; 3], [9, 8, 7]]),
        (["1 0 0", "2 0 0 9 8 7", "0 0 0"], [[200; 3], [9, 8, 7]]),
    ] {
        let (cloud, told) = load(&scan(&points), &ReadOptions::default());
        assert_eq!(cloud.positions(), [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], "{points:?}");
        assert_eq!(cloud.colors().unwrap(), colors, "{points:?}");
        assert!(told.notes.lock().unwrap()[0].contains("2 lines have no colour"), "told");
    }
    // The first colour comes after the lines that are looked at.
    let mut points = vec!["1 0 0 0.5"; 5000];
    points[4000] = "2 0 0 0.5 9 8 7";
    assert_eq!(load(&scan(&points), &ReadOptions::default()).0.colors().unwrap()[4000], [9, 8, 7], "late");
    points[4500] = "1 2";
    assert!(error("a.ptx", scan(&points).as_bytes()).contains("line 4011: more values"), "the first line that is odd");
}

#[test]
fn matrices_for_column_vectors_are_turned_over() {
    let places = "500000.5 5400000.25 100\n0 1 0\n-1 0 0\n0 0 1\n";
    let column = format!("{places}0 -1 0 500000.5\n1 0 0 5400000.25\n0 0 1 100\n0 0 0 1\n");
    let points = "1 0 0\n0 2 0.125\n";
    let (usual, _) = load(&format!("1\n2\n{TURNED}{points}"), &ReadOptions::default());
    let (cloud, told) = load(&format!("1\n2\n{column}{points}"), &ReadOptions::default());
    assert_eq!((cloud.positions(), cloud.origin()), (usual.positions(), usual.origin()), "the same points");
    assert_eq!(cloud.scans(), usual.scans(), "and the same sensor");
    assert!(told.notes.lock().unwrap()[0].contains("1 of 1 scans have a matrix for column vectors"), "told");
    let both = column.replace("0 0 0 1\n", "5 5 5 1\n");
    let message = error("a.ptx", format!("1\n2\n{both}{points}").as_bytes());
    assert!(message.contains("neither the last column nor the last row"), "{message}");
}

#[test]
fn faults_are_told_by_line() {
    let scan = |points: &str| format!("1\n2\n{PLAIN}{points}");
    let cases = [
        (scan("1 2 3.000000 0.5\n"), "line 12", "ends after 1 of 2 points of scan 1; copy it again"),
        (scan("1 2 3 0.5\n1 2 x 0.5\n"), "line 12", "'x' is not a number"),
        (scan("1 2 3 0.5\n1 2 3\n"), "line 12", "3 values where a point has 4"),
        (scan("1 2 3 0.5 1\n1 2 3 0.5 1\n"), "line 11", "5 values"),
        (format!("{}7 7 7 0\n", scan("1 2 3 0.5\n4 5 6 0.5\n")), "line 13", "line 1 of a header"),
        (format!("4000000000\n4000000000\n{PLAIN}1 2 3 4\n"), "line 1", "cannot be in the 8 bytes"),
        (format!("18446744073709551615\n9\n{PLAIN}1 2 3 4\n"), "line 1", "copy the file again"),
        ("1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0\n".into(), "line 7", "'1 0 0' is not the 4 numbers"),
        ("1\n1\n0 0 nan\n".into(), "line 3", "not the 3 numbers"),
        ("1\n1\n".into(), "line 3", "the file ends"),
        (String::new(), "byte 0", "empty"),
    ];
    for (text, place, what) in cases {
        let message = error("a.ptx", text.as_bytes());
        assert!(message.contains(&format!("{place}:")) && message.contains(what), "{message}: not {place}, {what}");
    }
}

#[test]
fn counts_before_points_are_no_ptx() {
    let pts = crate::common::read_bytes("a.pts", b"2\n1 2 3\n4 5 6\n").unwrap();
    assert_eq!((pts.len(), pts.scans().len()), (2, 0), "PTS has one count and no header");
    let pts = crate::common::read_bytes("a.pts", b"1\n1 2 3\n1\n4 5 6\n").unwrap();
    assert_eq!(pts.len(), 2, "nor has one of several parts");
}
