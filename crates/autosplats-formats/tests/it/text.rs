//! Points in text files as programs write them: names, separators, decimal marks, gaps, and notes about guesses.

use std::{path::Path, sync::Mutex};

use crate::common::rich_cloud;
use autosplats_cloud::{Error, FieldValues, PointCloud, Progress, Unit, glam::DVec3};
use autosplats_formats::{ReadOptions, describe_bytes, read_bytes, read_with, write};

/// Keeps notes and counts chunks.
#[derive(Default)]
struct Ear {
    notes: Mutex<Vec<String>>,
    chunks: Mutex<Vec<PointCloud>>,
}

impl Progress for Ear {
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

fn read_noting(name: &str, text: &str, options: &ReadOptions) -> Result<(PointCloud, Vec<String>), Error> {
    let ear = Ear::default();
    let cloud = read_bytes(Path::new(name), text.as_bytes(), options, &ear)?;
    Ok((cloud, ear.notes.into_inner().unwrap()))
}

fn noted(name: &str, text: &str) -> (PointCloud, Vec<String>) {
    read_noting(name, text, &ReadOptions::default()).unwrap_or_else(|error| panic!("{text:?}: {error}"))
}

fn with_columns(text: &str, columns: &str) -> Result<PointCloud, Error> {
    let columns = Some(columns.split(' ').map(String::from).collect());
    let options = ReadOptions { columns, ..ReadOptions::default() };
    read_noting("a.txt", text, &options).map(|(cloud, notes)| {
        assert_eq!(notes, Vec::<String>::new(), "who names the columns is told nothing");
        cloud
    })
}

fn names(cloud: &PointCloud) -> Vec<&str> {
    cloud.fields().iter().map(|field| field.name.as_str()).collect()
}

fn values(cloud: &PointCloud, name: &str) -> Vec<f64> {
    let field = cloud.field(name).unwrap_or_else(|| panic!("no field {name} in {:?}", names(cloud)));
    (0..cloud.len()).map(|i| field.values.get(i)).collect()
}

fn world(cloud: &PointCloud) -> Vec<[f64; 3]> {
    (0..cloud.len()).map(|i| cloud.world_position(i).to_array()).collect()
}

#[test]
fn names_of_surveyors_and_programs() {
    let expected = [[1.5, 2.0, 3.0], [4.0, 5.0, 6.25]];
    for (text, unit) in [
        ("X(m),Y(m),Z(m)\n1.5,2,3\n4,5,6.25\n", Some(Unit::Metre)),
        ("x [m] y [m] z [m]\n1.5 2 3\n4 5 6.25\n", Some(Unit::Metre)),
        ("Easting;Northing;Elevation\n1.5;2;3\n4;5;6.25\n", None),
        ("\"Easting [ft]\"\t\"Northing [ft]\"\t\"Height [ft]\"\r\n1.5\t2\t3\r\n4\t5\t6.25\r\n", Some(Unit::Foot)),
        ("lat,lon,alt\n2,1.5,3\n5,4,6.25\n", Some(Unit::Degree)),
        ("Points:0,Points:1,Points:2\n1.5,2,3\n4,5,6.25\n", None),
        ("\u{feff}z,y,x,\n3,2,1.5,\n6.25,5,4,\n", None),
    ] {
        let (cloud, notes) = noted("a.csv", text);
        assert_eq!((world(&cloud), cloud.crs().unit), (expected.to_vec(), unit), "{text:?}");
        assert!(names(&cloud).is_empty() && notes.is_empty(), "{text:?}: {:?} {notes:?}", names(&cloud));
    }
    let (cloud, notes) = noted(
        "a.txt",
        "//X Y Z R G B Rf Gf Bf Scalar_field Nx Ny Nz class\n2\n\
        1 2 3 9 8 7 0.5 0.5 0.5 4 0 0 1 2\n4 5 6 255 0 1 0.5 0.5 0.5 5 0 1 0 6\n",
    );
    assert_eq!(cloud.colors(), Some(&[[9, 8, 7], [255, 0, 1]][..]), "the first of two colours");
    let expected = ["Rf", "Gf", "Bf", "Scalar_field", "NormalX", "NormalY", "NormalZ", "Classification"];
    assert_eq!((names(&cloud), notes), (expected.to_vec(), vec![]), "CloudCompare's columns");
    let (cloud, notes) = noted("a.csv", ",p,q,r\n0,1,2,3\n1,4,5,6\n");
    assert_eq!((world(&cloud)[1], notes.len()), ([1.0, 4.0, 5.0], 1), "names that say nothing: the first three");
    assert!(notes[0].contains("no x, y and z") && notes[0].contains("--columns"), "{notes:?}");
}

#[test]
fn guesses_are_told() {
    for (name, text, told) in [
        ("a.xyz", "1 2 3\n4 5 6\n", None),
        ("a.xyz", "1 2 3 4\n4 5 6 7\n", Some("x y z Intensity")),
        ("a.xyz", "1 2 3 9.0 8.0 7.0 255.0\n4 5 6 1 2 3 255\n", Some("x y z red green blue alpha")),
        ("a.xyz", "1 2 3 0 0.6 0.8\n4 5 6 -1 0 0\n", Some("x y z nx ny nz")),
        ("a.xyz", "1 2 3 0.25 -3\n4 5 6 7 8\n", Some("x y z column_4 column_5")),
        ("a.pts", "2\n1 2 3 -2048 9 8 7\n4 5 6 2047 255 0 1\n", None),
        ("a.csv", "x,y,z,i\n1,2,3,4\n", None),
    ] {
        let (_, notes) = noted(name, text);
        let expected: Vec<String> =
            told.iter().map(|columns| format!("columns taken for {columns}; --columns overrides")).collect();
        assert_eq!(notes, expected, "{text:?}");
    }
}

#[test]
fn columns_may_be_given() {
    let text = "7 1 2 3 0.5\n8 4 5 6 0.25\n";
    let cloud = with_columns(text, "- x y z weight").unwrap();
    assert_eq!((world(&cloud)[1], values(&cloud, "weight")), ([4.0, 5.0, 6.0], vec![0.5, 0.25]), "names in order");
    let cloud = with_columns(text, "nx z _ y x").unwrap();
    assert_eq!((world(&cloud)[0], values(&cloud, "NormalX")), ([0.5, 3.0, 1.0], vec![7.0, 8.0]), "any order");
    let cloud = with_columns("x,y,z\n1,2,3\n", "z x y").unwrap();
    assert_eq!(world(&cloud), [[2.0, 3.0, 1.0]], "against the header");
    let cloud = with_columns("1 2 3 255 0 9\n", "x y z red green blue").unwrap();
    assert_eq!(cloud.colors(), Some(&[[255, 0, 9]][..]), "a single row");
    for (columns, words) in [
        ("x y z", ["line 1", "5 values", "--columns names 3"]),
        ("x y z a b c", ["line 1", "5 values", "names 6"]),
        ("x y - - -", ["--columns", "z is named 0 times", "each of x, y and z"]),
        ("x y z x -", ["--columns", "x is named 2 times", "once"]),
    ] {
        let message = with_columns(text, columns).unwrap_err().to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message} should contain {words:?}");
    }
}

#[test]
fn decimal_commas_are_read_where_they_are_sure() {
    let expected = [[1.5, -2.25, 3.0], [4.0, 500_000.125, 6.0]];
    for text in [
        "1,5;-2,25;3\n4;500000,125;6\n",
        "x;y;z\n\"1,5\";\"-2,25\";\"3,0\"\n4;500000,125;6\n",
        "1,5\t-2,25\t3\n4\t500000,125\t6\n",
        "1,5 -2,25 3,0\n4,0 500000,125 6,0\n",
    ] {
        let (cloud, _) = noted("a.csv", text);
        assert_eq!(world(&cloud), expected, "{text:?}");
    }
    for text in ["1,5;2.5;3\n", "1.234;2,5;3\n"] {
        let message = read_noting("a.csv", text, &ReadOptions::default()).unwrap_err().to_string();
        assert!(message.contains("decimal commas"), "{text:?}: {message}");
    }
    let (cloud, _) = noted("a.txt", "1,2,3 9,8,7\n4,5,6 6,5,4\n");
    assert_eq!(cloud.colors(), Some(&[[9, 8, 7], [6, 5, 4]][..]), "commas between numbers and a blank");
}

#[test]
fn gaps_words_and_comments() {
    let (cloud, notes) = noted(
        "a.csv",
        "x,y,z,intensity,kind,\"c\"\n1,2,3,,Ground,\"7\"\n# a comment\n4,5,6,NA,,8\n\n7,8,9,0.5,Tree, 9 ,\n1,1,1,2,,\n",
    );
    assert_eq!((cloud.len(), names(&cloud)), (4, vec!["Intensity", "c"]), "words are left out");
    assert_eq!(notes, ["column 'kind' holds words; left out"], "and it is told");
    assert!(values(&cloud, "Intensity")[..2].iter().all(|value| value.is_nan()), "empty cells");
    assert_eq!(values(&cloud, "Intensity")[2..], [0.5, 2.0], "others");
    assert_eq!(values(&cloud, "c")[..3], [7.0, 8.0, 9.0], "quotes and blanks");
    let (cloud, _) = noted("a.txt", "x\ty\tz\ti\n1\t2\t3\t\n4\t5\t6\t7\n");
    assert!(
        values(&cloud, "Intensity")[0].is_nan() && values(&cloud, "Intensity")[1] == 7.0,
        "an empty cell at the end"
    );
    let (cloud, _) = noted("a.txt", "1\t\t2\t 3\n4\t\t5\t6\n");
    assert_eq!(world(&cloud)[0], [1.0, 2.0, 3.0], "tabs that align");
    let comments = "# one of many\n".repeat(5000);
    let (cloud, _) = noted("a.txt", &format!("{comments}1 2 3\n{comments}4 5 6\n"));
    assert_eq!(cloud.len(), 2, "thousands of comments");
    let (cloud, notes) = noted("a.pts", "2\n1 2 3 -2048\n4 5 6 2047\n1\n7 8 9 -1\n3\n0 1 1 5\n");
    assert_eq!((cloud.len(), values(&cloud, "Intensity")[0]), (4, -2048.0), "blocks are put together");
    assert!(notes[0].contains("add up to 6") && notes[0].contains("there are 4"), "{notes:?}");
}

#[test]
fn errors_have_places() {
    for (name, text, words) in [
        ("a.csv", "x,y,z,i\n1,2,3,4\n1,,3,4\n", ["line 3", "y is missing, as in 1 of 2 rows"]),
        ("a.csv", "x,y,z,i\n1,2,3,4\n1,2,3,four\n", ["line 3", "'four' is not a number"]),
        ("a.csv", "x,y,z\n1,2,3\n1,2\n", ["line 3", "2 values where a point has 3"]),
        ("a.csv", "x,y,z\n1,2,3\n1,2,3,4\n", ["line 3", "from '4' on"]),
        ("a.csv", "x,y,z\n1,two,3\n", ["line 2", "'two' is not a number"]),
        ("a.xyz", "1 2 3\n4 5 six\n", ["line 2", "'six' is not a number"]),
        ("a.xyz", "1 2 3\r4 5 6\r", ["carriage returns", "line feeds"]),
        ("a.pts", "99999999999999999999\n1 2 3\n", ["line 1", "too large"]),
    ] {
        let message = read_noting(name, text, &ReadOptions::default()).unwrap_err().to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message} should contain {words:?}");
    }
}

#[test]
fn rows_of_numbers_need_no_name() {
    for text in ["1 2 3\n4 5 6\n", "# c\nx,y,z\n1,2,3\n4,5,6\n", "2\n1 2 3\n4 5 6\n", "1 2 3 9\n"] {
        for name in ["points", "points.dat", "points.pcd"] {
            let (cloud, _) = noted(name, text);
            assert_eq!(world(&cloud)[0], [1.0, 2.0, 3.0], "{name}: {text:?}");
        }
    }
    assert!(noted("a.pcd", "1 2 3\n").1[0].contains("no PCD header"), "a wrong name is told");
    for text in ["1 2\n3 4\n", "1 2 3\nand words\n", "{\"a\": 1}", "", "1 2 3\0", "one two three\n1 2 3\n"] {
        let result = read_noting("points.dat", text, &ReadOptions::default());
        assert!(matches!(result, Err(Error::UnknownFormat { .. })), "{text:?} is no points");
    }
}

#[test]
fn colours_of_every_depth() {
    let eight = |text: &str| noted("a.xyz", text).0.colors().unwrap().to_vec();
    assert_eq!(eight("1 2 3 0.5 1 0\n1 2 3 1 0 0.25\n"), [[128, 255, 0], [255, 0, 64]], "0 to 1");
    assert_eq!(eight("1 2 3 65535 256 0\n1 2 3 9 0 32768\n"), [[255, 1, 0], [0, 0, 128]], "16 bits");
    // Late values above 255, after blocks that hold only bytes.
    let rows = "1 2 3 9 8 255\n".repeat(300_000) + &"1 2 3 65535 0 0\n".repeat(60_000);
    let colors = eight(&rows);
    assert_eq!((colors[0], colors[300_000]), ([0, 0, 0], [255, 0, 0]), "all values decide");
    let exact = ReadOptions { exact: true, ..ReadOptions::default() };
    let (cloud, _) = read_noting("a.xyz", "1 2 3 65535 256 0\n1 2 3 9 0 32768\n", &exact).unwrap();
    assert_eq!(
        cloud.field("Blue").unwrap().values,
        FieldValues::U16(vec![0, 32768]),
        "all digits where they are wanted"
    );
    assert!(read_noting("a.xyz", "1 2 3 255 0 9\n", &exact).unwrap().0.fields().is_empty(), "bytes lose nothing");
}

#[test]
fn wide_values_keep_their_digits() {
    let (cloud, _) = noted("a.csv", "x,y,z,gps_time,stamp,w\n1,2,3,0.1,1305031102160407,0.1\n");
    assert_eq!(
        (values(&cloud, "GpsTime"), values(&cloud, "stamp")),
        (vec![0.1], vec![1_305_031_102_160_407.0]),
        "wide"
    );
    assert_eq!(cloud.field("w").unwrap().values, FieldValues::F32(vec![0.1]), "others are floats");
    let exact = ReadOptions { exact: true, ..ReadOptions::default() };
    let (cloud, _) = read_noting("a.csv", "x,y,z,w\n512000.1234567,0,0,0.123456789012\n", &exact).unwrap();
    assert_eq!(values(&cloud, "w"), [0.123_456_789_012], "all digits where they are wanted");
    assert!((cloud.world_position(0).x - 512_000.123_456_7).abs() < 1e-10, "of coordinates too");
}

#[test]
fn long_text_comes_in_chunks_and_the_same_on_any_number_of_threads() {
    let rows: String =
        (0..700_000).map(|i| format!("{}.5 {} 5400000.25 {}\n", 500_000 + i % 1000, i / 1000, i % 256)).collect();
    let ear = Ear::default();
    let cloud = read_bytes(Path::new("a.xyz"), rows.as_bytes(), &ReadOptions::default(), &ear).unwrap();
    let chunks = ear.chunks.into_inner().unwrap();
    assert!(chunks.len() >= 2, "{} chunks", chunks.len());
    let pieces = chunks.iter().flat_map(|chunk| (0..chunk.len()).map(|i| chunk.world_position(i)));
    assert!(pieces.eq((0..cloud.len()).map(|i| cloud.world_position(i))), "chunks are the points in order");
    assert_eq!(cloud.world_position(123_456), DVec3::new(500_456.5, 123.0, 5_400_000.25), "in order");
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let again = pool.install(|| read_bytes(Path::new("a.xyz"), rows.as_bytes(), &ReadOptions::default(), &()));
        assert!(again.unwrap() == cloud, "{threads} threads");
    }
}

#[test]
fn descriptions() {
    let describe = |name: &str, text: &str| {
        describe_bytes(Path::new(name), text.as_bytes(), &ReadOptions::default())
            .unwrap_or_else(|error| panic!("{error}"))
    };
    let detail = |text: &str| describe("a.txt", text).details.into_iter().map(|(_, value)| value).collect::<Vec<_>>();
    assert_eq!(describe("a.pts", "7\n1 2 3 4 5 6 7\n").points, Some(7), "the count of PTS, nothing else is read");
    let csv = describe("a.csv", "X(m),Y(m),Z(m),kind\n1,2,3,tree\n");
    let names: Vec<&str> = csv.attributes.iter().map(|attribute| attribute.name.as_str()).collect();
    assert_eq!((names, csv.points, csv.crs.unit), (vec!["X", "Y", "Z", "-"], None, Some(Unit::Metre)), "columns");
    assert_eq!(detail("\u{feff}1,5;2;3\n"), ["UTF-8 with a byte order mark", "semicolons, decimal commas"], "details");
    assert_eq!(detail("1 2 3\n"), ["UTF-8 or ASCII", "blanks"], "details");
    assert!(describe("a.xyz", "1 2 3 4\n").notes[0].contains("--columns"), "guesses");
}

#[test]
fn written_text_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    for extension in ["xyz", "txt", "asc", "csv"] {
        let path = folder.path().join(format!("a.{extension}"));
        for count in [0, 1, 300_000] {
            let cloud = rich_cloud(count);
            write(&cloud, &path, &()).unwrap();
            let ear = Ear::default();
            let back = read_with(&path, &ReadOptions::default(), &ear).unwrap();
            assert!(ear.notes.into_inner().unwrap().is_empty(), "{extension}: nothing is guessed");
            if count == 0 {
                assert!(back.is_empty(), "{extension}: no points");
                continue;
            }
            assert_eq!((back.positions(), back.colors()), (cloud.positions(), cloud.colors()), "{extension}, {count}");
            assert_eq!(names(&back), names(&cloud), "{extension}");
            for field in cloud.fields() {
                // GpsTime is double precision; other fields come back as floats.
                let same = |i| back.field(&field.name).unwrap().values.get(i) == field.values.get(i);
                let wide = |i: usize| field.values.get(i).abs() > f64::from(1 << 24) && count == 1;
                assert!((0..count).all(|i| same(i) || wide(i)), "{extension}: {}", field.name);
            }
        }
    }
    let csv = std::fs::read_to_string(folder.path().join("a.csv")).unwrap();
    assert!(csv.starts_with("x,y,z,red,green,blue,Classification,ScanAngle,Intensity,"), "a header with commas");
}

#[test]
fn written_survey_coordinates_and_oddities_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.xyz");
    let text: String =
        (0..2000).map(|i| format!("{}.{:03} 5400000.{i:04} {}.125\n", 512_000 + i, i % 1000, i % 90)).collect();
    let options = ReadOptions { exact: true, ..ReadOptions::default() };
    let cloud = read_bytes(Path::new("b.xyz"), text.as_bytes(), &options, &()).unwrap();
    write(&cloud, &path, &()).unwrap();
    let written = std::fs::read_to_string(&path).unwrap();
    let number = |line: &str| line.split(' ').map(|word| word.parse().unwrap()).collect::<Vec<f64>>();
    assert!(written.lines().skip(1).map(number).eq(text.lines().map(number)), "the very decimals that were read");
    assert_eq!(read_with(&path, &options, &()).unwrap(), cloud, "and the very cloud");
    let rough = read_bytes(Path::new("b.xyz"), text.as_bytes(), &ReadOptions::default(), &()).unwrap();
    write(&rough, &path, &()).unwrap();
    assert_eq!(read_with(&path, &ReadOptions::default(), &()).unwrap(), rough, "floats about an origin");

    let mut odd = vec![[f32::NAN, 1.0, f32::INFINITY], [-0.0, 1e-30, 3e38], [0.1, -7.0, f32::NEG_INFINITY]];
    odd.extend([[0.5; 3]; 5]);
    write(&PointCloud::new(DVec3::ZERO, odd.clone()), &path, &()).unwrap();
    let back = read_with(&path, &ReadOptions::default(), &()).unwrap();
    let bits = |points: &[[f32; 3]]| points.iter().flatten().map(|value| value.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(back.positions()), bits(&odd), "every bit, not finite ones too");
}

#[test]
fn wide_colours_are_written_with_all_digits() {
    let folder = tempfile::tempdir().unwrap();
    let exact = ReadOptions { exact: true, ..ReadOptions::default() };
    let (cloud, _) = read_noting("a.xyz", "1 2 3 65535 256 7\n1 2 4 9 0 32768\n", &exact).unwrap();
    for name in ["b.xyz", "b.pcd"] {
        let path = folder.path().join(name);
        write(&cloud, &path, &()).unwrap();
        assert_eq!(read_with(&path, &exact, &()).unwrap().field("Blue"), cloud.field("Blue"), "{name}: 16 bits");
        assert_eq!(read_with(&path, &exact, &()).unwrap().colors(), cloud.colors(), "{name}: 8 bits");
    }
}

#[test]
fn pts_is_written_as_its_readers_want_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pts");
    let cloud = PointCloud::new(DVec3::ZERO, vec![[1.0, 2.5, -3.0]])
        .with_colors(vec![[9, 8, 7]])
        .unwrap()
        .with_field("Intensity", FieldValues::I16(vec![-2048]))
        .unwrap()
        .with_field("Ring", FieldValues::U8(vec![3]))
        .unwrap();
    let ear = Ear::default();
    write(&cloud, &path, &ear).unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "1\n1 2.5 -3 -2048 9 8 7\n", "Leica's order");
    let notes = ear.notes.into_inner().unwrap();
    assert_eq!(notes, ["PTS holds only intensities and colours; left out: Ring"], "what is lost is told");
}
