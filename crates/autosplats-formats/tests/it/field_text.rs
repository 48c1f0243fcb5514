//! Texts as people have them: columns of point numbers and words, gaps, thousands, names in many languages, grids,
//! byte order marks, compression. The files lie beside the shared data, in `field`; siblings are made here.

use std::{io::Write as _, path::Path};

use crate::common::{las_files::Notes, shared_data};
use autosplats_cloud::{Axes, Error, PointCloud, Unit, glam::DVec3};
use autosplats_formats::{ReadOptions, describe_bytes, read_bytes};

fn attempt(name: &str, bytes: &[u8], columns: Option<&str>) -> Result<(PointCloud, String), Error> {
    let columns = columns.map(|columns| columns.split(',').map(String::from).collect());
    let ear = Notes::default();
    let options = ReadOptions { columns, ..ReadOptions::default() };
    let cloud = read_bytes(Path::new(name), bytes, &options, &ear)?;
    Ok((cloud, ear.notes.into_inner().unwrap().join("\n")))
}

fn noted(name: &str, bytes: impl AsRef<[u8]>) -> (PointCloud, String) {
    let bytes = bytes.as_ref();
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]);
    attempt(name, bytes, None).unwrap_or_else(|error| panic!("{text:?}: {error}"))
}

fn refused(name: &str, bytes: impl AsRef<[u8]>, words: &[&str]) {
    let message = match attempt(name, bytes.as_ref(), None) {
        Ok((cloud, notes)) => panic!("{words:?}: read as {:?}, {notes}", world(&cloud)),
        Err(error) => error.to_string(),
    };
    assert!(words.iter().all(|word| message.contains(word)), "{message} should contain {words:?}");
    assert!(!message.contains(char::is_control), "one line: {message:?}");
}

fn world(cloud: &PointCloud) -> Vec<[f64; 3]> {
    (0..cloud.len()).map(|i| cloud.world_position(i).to_array()).collect()
}

fn lowest(cloud: &PointCloud) -> DVec3 {
    (0..cloud.len()).map(|i| cloud.world_position(i)).fold(DVec3::INFINITY, DVec3::min)
}

const POINTS: [[f64; 3]; 3] = [[1.5, 2.0, 3.0], [4.0, 5.25, 6.0], [7.0, 8.0, 9.125]];

/// Rows of 12 points that no rule can take for a count or a colour, each made by `row` of its number and coordinates.
fn rows(row: impl Fn(usize, [f64; 3]) -> String) -> (String, Vec<[f64; 3]>) {
    let points: Vec<[f64; 3]> =
        (0..12).map(f64::from).map(|i| [i * 0.25 % 1.0 + 10.5, 20.25 - i * i % 7.0, 30.125 + i * 0.5]).collect();
    (points.iter().enumerate().map(|(i, &point)| row(i, point)).collect(), points)
}

#[test]
fn the_field_files() {
    let Some(folder) = shared_data().map(|data| data.join("../field")) else { return };
    let plate = DVec3::new(-0.6, -0.5, -0.06);
    for (file, count, lowest_point, colored, words) in [
        ("t02b_nohdr_name_xyz.csv", 4000, DVec3::new(1000.0, 2000.0, 50.0) + plate, false, "column 1 holds words"),
        ("t02c_num_id_xyz_code.txt", 4000, DVec3::new(350_000.0, 5_600_000.0, 50.0) + plate, false, "column 1 counts"),
        ("t02d_num_id_xyz.txt", 4000, plate, false, "column 1 counts the points; left out"),
        ("t10_id_xyz_rgb.xyz", 4000, plate, true, "column 1 counts"),
        ("t24_ru.csv", 4000, DVec3::new(412_300.0, 6_123_400.0, 120.0) + plate, false, ""),
        ("t24c_es.csv", 4000, DVec3::new(412_300.0, 4_123_400.0, 120.0) + plate, true, ""),
        ("t04_points3D.txt", 4000, plate, true, "a list; left out"),
        ("u04_points3D_hdronly.txt", 4000, plate, true, "a list; left out"),
        ("t05_dem.asc", 4740, DVec3::new(340_622.5, 3_917_732.5, 120.0), false, "60 of 4800 cells have no data"),
        ("t05b_dem_dxdy.asc", 4740, DVec3::new(340_620.0, 3_917_730.0, 120.0), false, "60 of 4800"),
        ("t11_thousands_de.csv", 4000, DVec3::new(3_512_345.0, 5_401_234.0, 1250.0) + plate, false, ""),
        ("t11b_thousands_us.csv", 4000, DVec3::new(312_345.0, 5_401_234.0, 1250.0) + plate, false, ""),
        ("t11d_thousands_ch.csv", 4000, DVec3::new(2_612_345.0, 1_201_234.0, 1250.0) + plate, false, ""),
        ("u23b_preamble_kv.txt", 4000, plate, false, "4 lines of words, line 1 to line 4"),
        ("u23c_footer.txt", 4000, plate, false, "a line of words from line 4002 on"),
        ("u25_00.csv", 3920, plate, false, "80 of 4000 rows have no coordinates"),
        ("u25_01.csv", 3920, plate, false, "80 of 4000 rows"),
        ("u25_03.csv", 3920, plate, false, "80 of 4000 rows"),
        ("u25_04.csv", 3920, plate, false, "80 of 4000 rows"),
        ("u40_lvis_like.txt", 2000, DVec3::new(301.194, 78.299, 1950.0), false, ""),
        ("v17_names.csv", 400, DVec3::new(5_399_999.5, 499_999.4, 99.94), false, ""),
        ("v19_names.csv", 400, DVec3::new(5_399_999.5, 499_999.4, 99.94), false, ""),
    ] {
        let (cloud, notes) = noted(file, std::fs::read(folder.join(file)).unwrap());
        assert_eq!((cloud.len(), cloud.colors().is_some()), (count, colored), "{file}: {notes}");
        assert!(lowest(&cloud).distance(lowest_point) < 0.01, "{file}: {} is not {lowest_point}", lowest(&cloud));
        assert!(notes.contains(words) && (!words.is_empty() || notes.is_empty()), "{file}: {notes} without {words}");
        if colored {
            assert_eq!(cloud.colors().unwrap()[0], [70, 150, 80], "{file}");
        }
    }
    for file in ["t09_name_xy.csv", "t09b_xy.csv"] {
        refused(file, std::fs::read(folder.join(file)).unwrap(), &["z is missing"]);
    }
    let first = |file: &str, columns| attempt(file, &std::fs::read(folder.join(file)).unwrap(), Some(columns)).unwrap();
    assert_eq!(first("t02b_nohdr_name_xyz.csv", "-,x,y,z").0.len(), 4000, "as written");
    assert!(lowest(&first("t04_points3D.txt", "-,x,y,z,...").0).distance(plate) < 1e-6, "the rest is nothing");
    for (file, count) in [
        ("bom_cube.obj", 8),
        ("bom_obj.obj", 6000),
        ("bom_off.off", 6000),
        ("bom_pcd.pcd", 6000),
        ("p09_bom_start.ply", 6000),
    ] {
        let (cloud, _) = noted(file, std::fs::read(folder.join(file)).unwrap());
        assert_eq!(cloud.len(), count, "{file}");
    }
}

#[test]
fn point_numbers_are_no_coordinates() {
    for (start, step, separator) in [(1, 1, " "), (0, 1, ","), (1000, 10, ";"), (7, 3, "\t")] {
        let join = |cells: &[String]| cells.join(separator) + "\n";
        let number = |i: usize| (start + i * step).to_string();
        for tail in [vec![], vec!["CODE".to_owned()], vec!["9".into(), "8".into(), "255".into()]] {
            let (text, points) =
                rows(|i, p| join(&[vec![number(i)], p.map(|value| value.to_string()).to_vec(), tail.clone()].concat()));
            let (cloud, notes) = noted("a.txt", &text);
            assert_eq!(world(&cloud), points, "{text:?}");
            assert!(notes.contains("column 1 counts the points; left out"), "{notes}");
            assert_eq!(cloud.colors().is_some(), tail.len() == 3, "{notes}");
        }
    }
    // An unknown language.
    let (text, points) = rows(|i, [x, y, z]| format!("{i};{x};{y};{z}\n"));
    let (cloud, notes) = noted("a.csv", format!("wan;too;tree;fore\n{text}"));
    assert_eq!(world(&cloud), points, "{notes}");
    // A grid with intensities: its first column begins again.
    let grid: String = (0..400).map(|i| format!("{} {} 5.5 {}\n", i % 20, i / 20, i % 7)).collect();
    assert_eq!(noted("a.xyz", &grid).0.world_position(21), DVec3::new(1.0, 1.0, 5.5), "a coordinate");
    // A wide one: no row begins again among the first thousand.
    let grid: String = (0..60_000).map(|i| format!("{} {} 5.5 {}\n", i % 2000, i / 2000, i % 7)).collect();
    assert_eq!(noted("a.xyz", &grid).0.world_position(2001), DVec3::new(1.0, 1.0, 5.5), "a coordinate of a wide grid");
    let (text, points) = rows(|i, [x, y, _]| format!("{i} {x} {y}\n"));
    assert_eq!(noted("a.xyz", &text).0.world_position(1).y, points[1][0], "three columns are x, y and z");
}

#[test]
fn words_without_a_header_are_left_out() {
    for row in [
        (|i, [x, y, z]| format!("P{i},{x},{y},{z}\n")) as fn(usize, [f64; 3]) -> String,
        |i, [x, y, z]| format!("tree {x} {y} {z} {} CODE\n", i % 5),
        |i, [x, y, z]| format!("\"Station, {i}\";{x};{y};{z}\n"),
        |i, [x, y, z]| format!("{}\t{x}\t{y}\t{z}\n", if i % 3 == 0 { "12A" } else { "12" }),
    ] {
        let (text, points) = rows(row);
        let (cloud, notes) = noted("a.txt", &text);
        assert_eq!(world(&cloud), points, "{text:?}");
        assert!(notes.contains("column 1 holds words; left out"), "{notes}");
    }
    refused("a.csv", "1,2,3\n4,five,6\n7,8,9\n", &["line 2", "'five' is not a number"]);
}

#[test]
fn rows_with_tails() {
    let tail = |i: usize| " 9".repeat(i % 4);
    let (text, points) = rows(|i, [x, y, z]| format!("{} {x} {y} {z} 7 8 255{}\n", 5 * i % 17, tail(i)));
    let (cloud, notes) = noted("a.txt", format!("# ID X Y Z R G B TRACK[]\n{text}"));
    assert_eq!((world(&cloud), cloud.colors().unwrap()[0]), (points.clone(), [7, 8, 255]), "{notes}");
    let (cloud, notes) = noted("a.txt", format!("# ID X Y Z\n{text}"));
    assert!(world(&cloud) == points && notes.contains("first 4 columns"), "{notes}");
    refused("a.txt", &text, &["line 2", "'...'", "--columns"]);
    let (cloud, notes) = attempt("a.txt", text.as_bytes(), Some("-,x,y,z,...")).unwrap();
    assert!(world(&cloud) == points && notes.is_empty(), "{notes}");
    let message = attempt("a.txt", b"1 2 3\n4 5 6 7\n", Some("x,y,z,a,...")).unwrap_err().to_string();
    assert!(message.contains("4 columns before '...'"), "{message}");
    let message = attempt("a.bin", &[0; 48], Some("x,y,z,...")).unwrap_err().to_string();
    assert!(message.contains("name all columns"), "{message}");
    // Names of some columns only, and R's rows.
    let (cloud, notes) = noted("a.txt", "# x y z\n1.5 2 3 9 8 7\n4 5.25 6 255 0 1\n7 8 9.125 3 2 1\n");
    assert!(world(&cloud) == POINTS && cloud.colors().is_some(), "{notes}");
    let (text, points) = rows(|i, [x, y, z]| format!("\"{}\",{x},{y},{z}\n", i + 1));
    let (cloud, notes) = noted("a.csv", format!("\"x\",\"y\",\"z\"\n{text}"));
    assert!(world(&cloud) == points && notes.contains("counts the rows"), "{notes}");
    refused("a.csv", "x,y,z\n1,5,2,0,3,5\n4,5,5,1,6,5\n", &["line 1", "3 names, but 6 values", "decimal"]);
}

#[test]
fn thousands_of_every_kind() {
    let expected = [[3_512_344.625, 5_401_233.5, 1249.25], [999.5, 1000.0, 12.0]];
    for (separator, mark, group) in [
        (";", ",", "."),
        (";", ",", " "),
        (";", ",", "\u{a0}"),
        (";", ",", "\u{202f}"),
        (";", ".", ","),
        (";", ".", "'"),
        (";", ".", "\u{2019}"),
        ("\t", ",", "."),
        ("\t", ".", ","),
        ("\t", ",", " "),
        (" ", ".", "'"),
        (" ", ",", "."),
        (" ", ".", ","),
        (" ", ",", "\u{a0}"),
        (",", ".", "'"),
        (",", ".", " "),
        (",", ".", "\u{2009}"),
    ] {
        let number = |text: &str| text.replace('.', "#").replace('\'', group).replace('#', mark);
        let row = |cells: [&str; 3]| cells.map(number).join(separator) + "\n";
        let text = row(["3'512'344.625", "5'401'233.500", "1'249.250"]) + &row(["999.500", "1'000.0", "12"]);
        for name in ["a.csv", "a.txt"] {
            let (cloud, _) = noted(name, &text);
            assert_eq!(world(&cloud), expected, "{text:?}");
        }
        let quoted = |cells: [&str; 3]| cells.map(|cell| format!("\"{}\"", number(cell))).join(",") + "\n";
        let text = quoted(["3'512'344.625", "5'401'233.500", "1'249.250"]) + &quoted(["999.500", "1'000.0", "12"]);
        let (cloud, _) = noted("a.csv", format!("E,N,H\n{text}"));
        assert_eq!(world(&cloud), expected, "{text:?}");
    }
    // Whole numbers in groups show what the single group means.
    let (cloud, _) = noted("a.csv", "5.401.233;1.250;9\n5.401.234;1.251;8\n");
    assert_eq!(world(&cloud)[0], [5_401_233.0, 1250.0, 9.0], "thousands with points");
    let (cloud, _) = noted("a.csv", "1,250;500,5;9\n1,251;500,5;8\n");
    assert_eq!(world(&cloud)[0], [1.25, 500.5, 9.0], "decimal commas");
    for text in
        ["\"1,250\",\"2,500\",\"3,750\"\n", "1,5;2.5;3\n", "1,5;2.500;3\n", "1,250;1.250;3\n", "1,234,567;2,5;3\n"]
    {
        refused("a.csv", text, &["decimal commas"]);
    }
    let late = "1,5;2,5;3,5\n".repeat(5000) + "1.250;2,5;3,5\n";
    refused("a.csv", late, &["line 5001", "'1.250' has a point"]);
    let late = "1.5;2.5;3.5\n".repeat(5000) + "1,250;2.5;3.5\n";
    refused("a.csv", late, &["line 5001", "'1,250'"]);
}

#[test]
fn rows_without_coordinates_are_counted() {
    let gaps = ["NULL", "N/A", "n/a", "-", "", "nodata", "No Data", "empty", "none", "#N/A", "--", "NA", "\\N", "#NV"];
    for gap in gaps {
        for separator in [",", ";", "\t"] {
            let row = |cells: [&str; 4]| cells.join(separator) + "\n";
            let gap_row = row([gap, gap, gap, "5"]);
            let points = row(["1.5", "2", "3", "5"]) + &row(["4", "5.25", "6", "5"]) + &row(["7", "8", "9.125", "5"]);
            for text in [format!("{gap_row}{points}"), format!("{points}{gap_row}{}", row(["1", gap, "2", "3"]))] {
                let (cloud, notes) = noted("a.csv", row(["x", "y", "z", "i"]) + &text);
                assert_eq!(world(&cloud), POINTS, "{text:?}: {notes}");
                assert!(notes.contains("rows have no coordinates; skipped"), "{text:?}: {notes}");
            }
        }
    }
    let (cloud, notes) = noted("a.xyz", "1.5 2 3\nNULL NULL NULL\n4 5.25 6\n7 8 9.125\n");
    assert!(world(&cloud) == POINTS && notes.contains("1 of 4 rows have no coordinates; skipped, the first in line 2"));
    let most = format!("x,y,z\n{}1,2,3\n", "1,2,NULL\n".repeat(3));
    refused("a.csv", most, &["line 2", "z is missing, as in 3 of 4 rows", "--columns"]);
    // Models of heights mark places without a height by a value far below all others.
    let heights: String = (0..50).map(|i| format!("{i} 7 {}\n", if i % 10 == 3 { -9999 } else { 100 + i })).collect();
    let (cloud, notes) = noted("a.xyz", &heights);
    assert_eq!(cloud.len(), 45, "{notes}");
    assert!(notes.contains("5 of 50 points have the height -9999") && notes.contains("left out"), "{notes}");
    let deep: String = (0..50).map(|i| format!("{i} 7 {}\n", -9980 - i)).collect();
    assert_eq!(noted("a.xyz", &deep).0.len(), 50, "a depth among others is one");
}

#[test]
fn words_before_and_after_are_told() {
    let points = "1.5 2 3\n4 5.25 6\n7 8 9.125\n";
    for (before, after, told) in [
        ("Project: x\nScale: 1.5\nOffset: 500000 5400000 0\nBy: N.N.\n", "", "4 lines of words, line 1 to line 4"),
        ("A title\nx y z\n", "", "line 1 holds words"),
        ("x y z\n[m] [m] [m]\n", "END\n", "a line of words from line 6 on"),
        ("", "-----\nTotal points: 3\n\nEnd of file\n", "3 lines of words from line 4 on"),
    ] {
        let (cloud, notes) = noted("a.txt", format!("{before}{points}{after}"));
        assert_eq!(world(&cloud), POINTS, "{before:?} {after:?}: {notes}");
        assert!(notes.contains(told) && notes.contains("skipped"), "{notes} without {told}");
    }
    assert_eq!(noted("a.csv", "x;y;z\nm;m;m\n1;2;3\n4;5;6\n").0.crs().unit, Some(Unit::Metre), "a line of units");
    refused("a.txt", format!("{points}END\n{points}"), &["line 4", "'END' is not a number"]);
    refused("a.txt", format!("{points}1 2\n"), &["line 4", "2 values where a point has 3"]);
    refused("a.txt", "One upon a time\nthere were 3 points\nand no more\n", &["line 1", "no points", "'One'"]);
}

#[test]
fn names_of_many_languages() {
    for (names, order) in [
        ("Rechtswert;Hochwert;Höhe", [0, 1, 2]),
        ("Hochwert;Rechtswert;Hoehe", [1, 0, 2]),
        ("Ost;Nord;Höhe NN", [0, 1, 2]),
        ("Northing;Easting;Elevation", [1, 0, 2]),
        ("N;E;H", [1, 0, 2]),
        ("E;N;U", [0, 1, 2]),
        ("Est;Nord;Altitude", [0, 1, 2]),
        ("Este;Norte;Cota", [0, 1, 2]),
        ("Norte;Este;Elevación", [1, 0, 2]),
        ("Est;Nord;Quota", [0, 1, 2]),
        ("Oost;Noord;Hoogte", [0, 1, 2]),
        ("Północ;Wschód;Wysokość", [1, 0, 2]),
        ("Север;Восток;Высота", [1, 0, 2]),
        ("Norr;Öst;Höjd", [1, 0, 2]),
        ("Nord;Øst;Høyde", [1, 0, 2]),
        ("Sever;Východ;Výška", [1, 0, 2]),
        ("Kuzey;Doğu;Yükseklik", [1, 0, 2]),
        ("北坐标;东坐标;高程", [1, 0, 2]),
        ("緯度;経度;標高", [1, 0, 2]),
        ("Breite;Länge;Höhe", [1, 0, 2]),
        ("Latitud;Longitud;Altura", [1, 0, 2]),
        ("X (Norte);Y (Este);Z", [1, 0, 2]),
        ("Northing_X;Easting_Y;Height_Z", [1, 0, 2]),
        ("LAT_CENTROID;LON_CENTROID;ELEV_CENTROID", [1, 0, 2]),
        ("posZ;posY;posX", [2, 1, 0]),
        ("height_m;target_north;target_east", [2, 1, 0]),
    ] {
        let rows: String = POINTS
            .iter()
            .map(|point| {
                let mut cells = [0.0; 3];
                (0..3).for_each(|axis| cells[order[axis]] = point[axis]);
                cells.map(|cell| cell.to_string()).join(";") + "\n"
            })
            .collect();
        let text = format!("{names}\n{rows}");
        let (cloud, notes) = noted("a.csv", &text);
        assert_eq!(world(&cloud), POINTS, "{text}: {notes}");
        assert!(notes.is_empty(), "{names}: {notes}");
    }
    for colors in [
        "Rojo;Verde;Azul",
        "Rot;Grün;Blau",
        "rouge;vert;bleu",
        "Красный;Зелёный;Синий",
        "红;绿;蓝",
        "czerwony;zielony;niebieski",
    ] {
        let (cloud, notes) = noted("a.csv", format!("x;y;z;{colors};Intensität\n1;2;3;9;8;7;5\n4;5;6;255;0;1;6\n"));
        assert_eq!(cloud.colors().unwrap(), [[9, 8, 7], [255, 0, 1]], "{colors}: {notes}");
        assert!(cloud.field("Intensity").is_some(), "a known name");
    }
    let latin: Vec<u8> =
        "Hochwert;Rechtswert;H\u{f6}he\n2;1.5;3\n5.25;4;6\n8;7;9.125\n".chars().map(|c| c as u8).collect();
    assert_eq!(world(&noted("a.csv", latin).0), POINTS, "Western Windows");
    let cyrillic = |text: &str| -> Vec<u8> {
        text.chars().map(|c| if c.is_ascii() { c as u8 } else { (c as u32 - 0x410 + 0xc0) as u8 }).collect()
    };
    let text = cyrillic("Север;Восток;Высота\n2;1.5;3\n5.25;4;6\n8;7;9.125\n");
    assert_eq!(world(&noted("a.csv", text).0), POINTS, "Eastern Windows");
    let unit = |text: &str| noted("a.csv", text).0.crs().unit;
    assert_eq!(unit("Länge;Breite;Höhe\n8.5;47.25;400\n"), Some(Unit::Degree), "angles");
    assert_eq!(unit("Länge;Breite;Höhe\n1200;800;400\n"), None, "the size of a box");
    // Normals and speeds are no positions.
    let (cloud, notes) = noted("a.csv", "normal_x;normal_y;normal_z;a;b;c\n1;0;0;4;5;6\n0;1;0;7;8;9\n");
    assert!(cloud.len() == 2 && notes.contains("names no x, y and z"), "{notes}");
    for text in
        ["id;x;y;code\n1;2;3;4\n2;3;4;5\n", "x;y;red\n1;2;3\n4;5;6\n", "Norte;Este\n1;2\n", "Name;E;N\nA;1;2\nB;3;4\n"]
    {
        refused("a.csv", text, &["z is missing"]);
    }
}

#[test]
fn grids_of_heights() {
    let values = "1 2 -9999\n4 5 6\n";
    let expected = [[10.5, 21.5, 1.0], [11.5, 21.5, 2.0], [10.5, 20.5, 4.0], [11.5, 20.5, 5.0], [12.5, 20.5, 6.0]];
    for (header, values) in [
        ("ncols 3\nnrows 2\nxllcorner 10\nyllcorner 20\ncellsize 1\nNODATA_value -9999\n", values),
        ("NCOLS 3\r\nNROWS 2\r\nXLLCENTER 10.5\r\nYLLCENTER 20.5\r\nCELLSIZE 1\r\n", "1 2\r\n-9999 4\r\n5\r\n6"),
        ("\nncols 3\nnrows 2\ndx 1\ndy 1.0\nyllcorner 20\nxllcorner 10,0\nnodata_value 1e20\n", "1,0 2 1e20\n4 5 6\n"),
        ("ncols 3 nrows 2 xllcorner 10 yllcorner 20 cellsize 1 NODATA nan\n", "1 2 nan 4 5 6"),
    ] {
        for name in ["a.asc", "a.grd", "a.txt", "a"] {
            let (cloud, notes) = noted(name, format!("{header}{values}"));
            assert_eq!((world(&cloud), cloud.axes()), (expected.to_vec(), Some(Axes::ZUp)), "{header}");
            assert!(notes.contains("1 of 6 cells have no data; left out"), "{notes}");
        }
    }
    let head = "ncols 3\nnrows 2\nxllcorner 10\nyllcorner 20\ncellsize 1\n";
    let facts =
        describe_bytes(Path::new("a.asc"), format!("{head}{values}").as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!((&*facts.format, facts.points), ("ESRI grid, text", Some(6)), "described");
    for (text, words) in [
        (format!("{head}1.0 2.0 3.0 4.0 5.0\n"), ["line 7", "5 of 6 heights"]),
        (format!("{head}{values}7\n"), ["more heights", "3 × 2"]),
        (format!("{head}1 2 x 4 5 6\n"), ["line 6", "'x' is not a number"]),
        (head.replace("cellsize 1", "cellsize 0") + values, ["line 5", "above 0"]),
        (head.replace("cellsize 1\n", "") + values, ["line 5", "no cellsize"]),
        (head.replace("ncols 3", "ncols 99999999999") + values, ["line 6", "cannot be in"]),
        (head.replace("nrows 2", "nrows 2.5") + values, ["line 2", "a count"]),
    ] {
        refused("a.asc", text, &words);
    }
}

/// Text in UTF-16 with a byte order mark.
fn utf16(text: &str, big: bool) -> Vec<u8> {
    let bytes = |unit: u16| if big { unit.to_be_bytes() } else { unit.to_le_bytes() };
    std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(bytes).collect()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

const MAP: &str = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";

/// The same three points in every format of text.
fn texts() -> Vec<(&'static str, String)> {
    let rows = "1.5 2 3\n4 5.25 6\n7 8 9.125\n";
    let gltf = "{\"asset\": {\"version\": \"2.0\"}, \"scenes\": [{\"nodes\": [0]}], \"nodes\": [{\"mesh\": 0}], \
        \"meshes\": [{\"primitives\": [{\"mode\": 0, \"attributes\": {\"POSITION\": 0}}]}], \
        \"accessors\": [{\"bufferView\": 0, \"componentType\": 5126, \"count\": 3, \"type\": \"VEC3\"}], \
        \"bufferViews\": [{\"buffer\": 0, \"byteLength\": 36}], \"buffers\": [{\"byteLength\": 36, \
        \"uri\": \"data:application/octet-stream;base64,AADAPwAAAEAAAEBAAACAQAAAqEAAAMBAAADgQAAAAEEAABJB\"}]}";
    let solid = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 1.5 2 3\nvertex 4 5.25 6\nvertex 7 8 9.125\nendloop\n\
        endfacet\nendsolid a\n";
    vec![
        ("a.xyz", rows.into()),
        ("a.txt", format!("x y z\n{rows}")),
        ("a.csv", format!("x,y,z\n{}", rows.replace(' ', ","))),
        ("a.asc", format!("# x y z\n{rows}")),
        ("a.pts", format!("3\n{rows}")),
        ("a.ptx", format!("3\n1\n{MAP}{rows}")),
        (
            "a.ply",
            format!(
                "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n{rows}"
            ),
        ),
        (
            "a.pcd",
            format!(
                "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA ascii\n{rows}"
            ),
        ),
        ("a.obj", rows.lines().map(|row| format!("v {row}\n")).collect()),
        ("a.off", format!("OFF\n3 0 0\n{rows}")),
        ("a.stl", solid.into()),
        ("a.gltf", gltf.into()),
    ]
}

#[test]
fn byte_order_marks_are_skipped_in_every_text() {
    for (name, text) in texts() {
        assert_eq!(world(&noted(name, &text).0), POINTS, "{name}");
        for marked in [
            format!("\u{feff}{text}").into_bytes(),
            format!("\u{feff}\u{feff}{text}").into_bytes(),
            format!("\u{feff}{}", text.replace('\n', "\r\n")).into_bytes(),
            utf16(&text, false),
            utf16(&text, true),
        ] {
            assert_eq!(world(&noted(name, &marked).0), POINTS, "{name}");
            let facts = describe_bytes(Path::new(name), &marked, &ReadOptions::default()).unwrap();
            let encoding = facts.details.iter().find(|(name, _)| name == "encoding");
            assert!(encoding.is_some_and(|(_, value)| value.contains("UTF")), "{name}: {:?}", facts.details);
        }
    }
    // Parts of joined files begin with marks of their own.
    for (name, text) in [
        ("a.xyz", "1.5 2 3\n\u{feff}4 5.25 6\n7 8 9.125\n"),
        ("a.obj", "v 1.5 2 3\n\u{feff}v 4 5.25 6\nv 7 8 9.125\n"),
        ("a.off", "OFF\n3 0 0\n\u{feff}1.5 2 3\n4 5.25 6\n7 8 9.125\n"),
    ] {
        assert_eq!(world(&noted(name, text).0), POINTS, "{name}");
    }
    let plain: Vec<u8> = utf16("1.5 2 3\n", false).split_off(2);
    refused("a.xyz", plain, &["UTF-16"]);
}

#[test]
fn compressed_files_are_read_as_what_is_in_them() {
    for (name, text) in texts() {
        let name = format!("{name}.gz");
        for packed in [gzip(text.as_bytes()), gzip(format!("\u{feff}{text}").as_bytes()), gzip(&utf16(&text, false))] {
            assert_eq!(world(&noted(&name, &packed).0), POINTS, "{name}");
        }
        let facts = describe_bytes(Path::new(&name), &gzip(text.as_bytes()), &ReadOptions::default()).unwrap();
        assert_eq!(facts.details[0], ("compressed with".into(), "gzip".into()), "{name}");
        let whole = gzip(text.as_bytes());
        let (start, end) = text.as_bytes().split_at(text.len() / 2);
        let mut parts = [gzip(start), gzip(end)].concat();
        assert_eq!(world(&noted(&name, &parts).0), POINTS, "{name}: two members");
        parts.extend([0; 512]);
        assert!(noted(&name, &parts).1.is_empty(), "{name}: padding");
        parts.extend(b"more");
        assert!(noted(&name, &parts).1.contains("no gzip; left out"), "{name}: other bytes");
        refused(&name, &whole[..whole.len() - 9], &["byte", "cut off"]);
        let mut damaged = whole.clone();
        let checksum = whole.len() - 6;
        damaged[checksum] ^= 1;
        refused(&name, &damaged, &["damaged"]);
    }
    assert_eq!(world(&noted("whatever", gzip(b"1.5 2 3\n4 5.25 6\n7 8 9.125\n")).0), POINTS, "by content");
    refused("notes.gz", gzip(b"no points"), &["unknown format"]);
}
