//! Files as people have them: widths of bare sweeps, scales of colours, odd headers, files that are cut off. Each kind
//! has the file of the shared set and others of the same kind.

use std::path::Path;

use crate::common::{colors, field_file, las_files::Notes, pcd_bytes, positions};
use autosplats_cloud::{Error, PointCloud, Random};
use autosplats_formats::{ReadOptions, read_bytes, read_mesh};

fn noted(name: &str, bytes: &[u8]) -> Result<(PointCloud, String), Error> {
    let notes = Notes::default();
    let cloud = read_bytes(Path::new(name), bytes, &ReadOptions::default(), &notes)?;
    Ok((cloud, notes.notes.into_inner().unwrap().join("\n")))
}

pub(crate) fn load(name: &str, bytes: &[u8]) -> (PointCloud, String) {
    noted(name, bytes).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn refused(name: &str, bytes: &[u8]) -> String {
    match noted(name, bytes) {
        Ok((cloud, _)) => panic!("{name} was read: {} points", cloud.len()),
        Err(error) => error.to_string(),
    }
}

fn load_field(name: &str) -> Option<(PointCloud, String)> {
    Some(load(name, &field_file(name)?))
}

fn names(cloud: &PointCloud) -> Vec<&str> {
    cloud.fields().iter().map(|field| field.name.as_str()).collect()
}

/// Points of a plate with a wall on it.
fn plate(count: usize) -> Vec<[f32; 3]> {
    let mut random = Random::from_state(7);
    let point = |_| {
        let [u, v, w] = [0; 3].map(|_: i32| random.unit() as f32);
        if w < 0.7 { [1.5 * u - 0.6, v - 0.5, -0.06] } else { [1.5 * u - 0.6, 0.2, v] }
    };
    (0..count).map(point).collect()
}

/// Points of a sensor that turns, whose 16 lasers fire in turn.
fn turning(count: usize) -> Vec<[f32; 3]> {
    let point = |i: usize| {
        let (angle, laser) = ((i / 16) as f32 * 0.01, (i % 16) as f32);
        let reach = 6.0 + laser + 3.0 * (2.0 * angle).sin();
        [reach * angle.cos(), reach * angle.sin(), 0.2 * laser - 1.7]
    };
    (0..count).map(point).collect()
}

fn bare(points: &[[f32; 3]], others: &[&dyn Fn(usize) -> f32]) -> Vec<u8> {
    let row = |(i, point): (usize, &[f32; 3])| -> Vec<f32> {
        point.iter().copied().chain(others.iter().map(|other| other(i))).collect()
    };
    points.iter().enumerate().flat_map(row).flat_map(f32::to_le_bytes).collect()
}

fn noise(i: usize) -> f32 {
    Random::from_state(i as u64 + 1).unit() as f32
}

#[test]
fn sweeps_tell_how_many_floats_a_point_has() {
    let intensity = |i: usize| 255.0 * noise(i);
    let ring = |i: usize| (i % 16) as f32;
    let elongation = |i: usize| 1.5 * noise(i + 9);
    let below_zero = |i: usize| 8.0 * noise(i + 5) - 4.0;
    let time = |i: usize| i as f32 * 1e-5;
    let bits = |i: usize| f32::from_bits((i % 16) as u32);
    let holes = |i: usize| if i.is_multiple_of(3) { f32::NAN } else { noise(i) };
    let nothing = |_: usize| f32::NAN;
    type Others<'a> = &'a [&'a dyn Fn(usize) -> f32];
    let cases: [(Others<'_>, &[&str]); 11] = [
        (&[], &[]),
        (&[&intensity], &["Intensity"]),
        (&[&holes], &["Intensity"]),
        (&[&below_zero], &["value_4"]),
        (&[&intensity, &ring], &["Intensity", "Ring"]),
        (&[&intensity, &bits], &["Intensity", "Ring"]),
        (&[&elongation, &elongation], &["Intensity", "value_5"]),
        (&[&intensity, &nothing], &["Intensity", "value_5"]),
        (&[&intensity, &ring, &time], &["Intensity", "Ring", "value_6"]),
        (&[&below_zero, &below_zero, &holes, &time], &["value_4", "value_5", "value_6", "value_7"]),
        (
            &[&intensity, &ring, &time, &elongation, &below_zero],
            &["Intensity", "Ring", "value_6", "value_7", "value_8"],
        ),
    ];
    for (others, expected) in cases {
        // Numbers of points with every kind of divisor.
        for count in [1001, 1680, 7919] {
            for (body, points) in [("plate", plate(count)), ("turning", turning(count))] {
                let width = 3 + others.len();
                let (cloud, notes) = load("a.bin", &bare(&points, others));
                let what = format!("{body} of {count} points of {width} floats");
                assert_eq!(cloud.len(), count, "{what}: {notes}");
                assert_eq!(cloud.positions(), points, "{what}");
                let found: Vec<_> = names(&cloud).iter().map(|name| (*name).to_owned()).collect();
                assert!(
                    found.iter().zip(expected).all(|(a, b)| a == b || *b == "value_5" && a == "Ring"),
                    "{what}: {found:?}"
                );
                assert!(notes.contains("--columns overrides"), "{what}: {notes}");
            }
        }
    }
    let (cloud, _) = load("a.bin", &bare(&plate(3000), &[&intensity, &bits]));
    assert_eq!(cloud.field("Ring").map(|ring| ring.values.get(21)), Some(5.0), "integers stored as such");
}

#[test]
fn what_sweeps_do_not_tell_is_asked_for() {
    // Points in a cube: any number of floats looks alike.
    let mut random = Random::from_state(3);
    let cube: Vec<u8> = (0..3 * 4 * 5 * 300).flat_map(|_| (2.0 * random.unit() as f32 - 1.0).to_le_bytes()).collect();
    let message = refused("a.bin", &cube);
    assert!(message.contains("3 or 4 or 5") && message.contains("--columns"), "{message}");
    let cut = bare(&plate(2000), &[&|i| noise(i)]);
    let message = refused("a.bin", &cut[..cut.len() - 8]);
    assert!(message.contains("points of 4 floats") && message.contains("ends inside a point"), "{message}");
}

#[test]
fn sweeps_of_the_field() {
    for (name, count, fields) in [
        ("kd5_ring.pcd.bin", 16_000, ["Intensity", "Ring"].as_slice()),
        ("ke5_ring_int.bin", 16_000, &["Intensity", "Ring"]),
        ("kd5_elong.bin", 16_000, &["Intensity", "value_5"]),
        ("kc2b_4col_posint_nan_few.bin", 3_000, &["Intensity"]),
    ] {
        let Some((cloud, notes)) = load_field(name) else { continue };
        assert_eq!((cloud.len(), names(&cloud)), (count, fields.to_vec()), "{name}: {notes}");
    }
}

/// Rows of positions and colours as text.
fn rows(points: &[[f32; 3]], colors: &[[f64; 3]], first: &str, last: &str) -> String {
    let row = |([x, y, z], [r, g, b]): (&[f32; 3], &[f64; 3])| format!("{first}{x} {y} {z} {r} {g} {b}{last}\n");
    points.iter().zip(colors).map(row).collect()
}

fn ply_header(count: usize, kind: &str, encoding: &str) -> String {
    let property = |name: &str| format!("property {kind} {name}\n");
    let xyz: String = ["x", "y", "z"].iter().map(|name| format!("property float {name}\n")).collect();
    let rgb: String = ["red", "green", "blue"].iter().map(|name| property(name)).collect();
    format!("ply\nformat {encoding} 1.0\nelement vertex {count}\n{xyz}{rgb}end_header\n")
}

#[test]
fn one_bright_value_does_not_darken_the_others() {
    let count = 400;
    let points = plate(count);
    let unit: Vec<[f64; 3]> =
        colors(count).iter().map(|color| color.map(|c| (f64::from(c) / 255.0 * 1e4).round() / 1e4)).collect();
    let byte: Vec<[f64; 3]> = colors(count).iter().map(|color| color.map(f64::from)).collect();
    for (scale, colors, bright) in [("0 to 1", unit, 1.6), ("0 to 255", byte, 300.0)] {
        let mut colors = colors;
        colors[7][1] = bright;
        let whole = bright > 2.0;
        let text = |first: &str, last: &str| rows(&points, &colors, first, last);
        let pcd = "FIELDS x y z r g b\nSIZE 4 4 4 4 4 4\nTYPE F F F F F F\nPOINTS 400\nDATA ascii\n";
        let ptx = "400\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        let mut files = vec![
            ("a.ply", ply_header(count, "float", "ascii") + &text("", "")),
            ("b.ply", ply_header(count, "double", "ascii") + &text("", "")),
            ("a.pcd", pcd.to_owned() + &text("", "")),
            ("a.xyz", "x y z red green blue\n".to_owned() + &text("", "")),
            ("a.obj", text("v ", "")),
            ("b.obj", text("v ", " 0.5")),
            ("a.off", format!("COFF\n{count} 0 0\n") + &text("", "")),
            ("a.ptx", ptx.to_owned() + &text("", "")),
        ];
        if whole {
            files.push(("c.ply", ply_header(count, "ushort", "ascii") + &text("", "")));
        }
        for (name, file) in files {
            let (cloud, notes) = load(name, file.as_bytes());
            let found = cloud.colors().unwrap();
            let expected = |i: usize| crate::common::colors(count)[i];
            assert_eq!(found[7][1], 255, "{name}, {scale}: the bright one is clipped");
            for i in [0, 6, 8, 300] {
                assert_eq!(found[i], expected(i), "{name}, {scale}: point {i}: {notes}");
            }
            assert!(notes.contains("1 of ") && notes.contains("clipped"), "{name}, {scale}: {notes}");
        }
    }
}

#[test]
fn colors_of_the_field_keep_their_brightness() {
    for (name, clipped) in [
        ("o1_ply_float_1.4.ply", "1230 of 18000"),
        ("o2_ply_float_one_1.6.ply", "1 of 18000"),
        ("o3_pcd_float_1.4.pcd", "1230 of 18000"),
        ("o4_text_1.4.xyz", "of 18000"),
        ("o5_ply_float255_one_256.5.ply", "1 of 18000"),
        ("o7_text_one300.xyz", "1 of 18000"),
        ("z8_e57_rgb16_8bit_one300.e57", "1 of 9000"),
    ] {
        let Some((cloud, notes)) = load_field(name) else { continue };
        let colors = cloud.colors().unwrap();
        let mean = colors.iter().flatten().map(|&value| f64::from(value)).sum::<f64>() / (3 * colors.len()) as f64;
        assert!((80.0..160.0).contains(&mean), "{name}: a mean of {mean}");
        assert!(notes.contains(clipped) && notes.contains("clipped"), "{name}: {notes}");
    }
}

#[test]
fn packed_colors_of_text_with_an_exponent_are_bits() {
    let file = |rgb: &str| {
        format!(
            "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nPOINTS 2\nDATA ascii\n1 2 3 {rgb}\n4 5 6 {rgb}\n"
        )
    };
    for (rgb, expected) in [
        ("4.2108e+06", [128, 128, 224]),
        ("4210800", [64, 64, 112]),
        ("4210800.0", [128, 128, 224]),
        ("2.3418052e-38", [255, 0, 0]),
        ("16711680", [255, 0, 0]),
        ("-1.7014118e38", [0, 0, 0]),
    ] {
        let (cloud, _) = load("a.pcd", file(rgb).as_bytes());
        let found = cloud.colors().unwrap()[1];
        assert!((0..3).all(|c| found[c].abs_diff(expected[c]) <= 1), "{rgb}: {found:?}, not {expected:?}");
        let ply = file(rgb);
        let rows = ply.split_once("ascii\n").unwrap().1;
        let header = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
                      property uint rgba\nend_header\n";
        assert_eq!(load("a.ply", format!("{header}{rows}").as_bytes()).0.colors().unwrap()[1], found, "{rgb} in PLY");
    }
    if let Some((cloud, _)) = load_field("d03c_tutorial.pcd") {
        assert_eq!(cloud.colors(), Some(&[[128, 128, 224]; 3][..]), "of the field");
    }
}

#[test]
fn weights_of_obj_are_told_from_colors() {
    for (rows, expected) in [
        ("v 1 2 3 0.2 0.4 0.6 1\nv 4 5 6 1 0 0 1\n", [[51, 102, 153], [255, 0, 0]]),
        ("v 1 2 3 1 0.2 0.4 0.6\nv 4 5 6 1 1 0 0\n", [[51, 102, 153], [255, 0, 0]]),
        ("v 1 2 3 51 102 153 255\nv 4 5 6 255 0 0 255\n", [[51, 102, 153], [255, 0, 0]]),
        ("v 1 2 3 51 102 153\nv 4 5 6\n", [[51, 102, 153], [255, 255, 255]]),
    ] {
        let (cloud, _) = load("a.obj", rows.as_bytes());
        assert_eq!(cloud.colors(), Some(&expected[..]), "{rows}");
    }
    assert_eq!(load("a.obj", b"v 1 2 3 0.5\nv 4 5 6 0.5\n").0.colors(), None, "a weight alone");
    if let Some((cloud, _)) = load_field("m05_obj_rgba.obj") {
        assert_eq!(cloud.colors().unwrap()[0], [70, 150, 80], "of the field");
    }
}

#[test]
fn packed_colors_of_ply() {
    let header = |kind: &str, name: &str| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\n\
             property float z\nproperty {kind} {name}\nend_header\n"
        )
    };
    for (kind, name, bits) in
        [("uint", "rgba", 0x80_0a_14_1e_u32), ("int", "RGB", 0x0a_14_1e), ("float", "rgb", 0x0a_14_1e)]
    {
        let mut bytes = header(kind, name).into_bytes();
        for point in [[1.0_f32, 2.0, 3.0], [4.0, 5.0, 6.0]] {
            point.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
            bytes.extend(bits.to_le_bytes());
        }
        assert_eq!(load("a.ply", &bytes).0.colors(), Some(&[[10, 20, 30]; 2][..]), "{kind} {name}");
    }
    if let Some((cloud, _)) = load_field("p20_rgba_uint.ply") {
        assert!(cloud.colors().is_some() && cloud.fields().is_empty(), "of the field");
    }
}

#[test]
fn gaussian_splats_show_their_base_colors() {
    let properties: String =
        ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"].iter().map(|name| format!("property float {name}\n")).collect();
    let file =
        format!("ply\nformat ascii 1.0\nelement vertex 2\n{properties}end_header\n1 2 3 0 9 -9\n4 5 6 1 -1 0.5\n");
    let (cloud, notes) = load("a.ply", file.as_bytes());
    assert_eq!(cloud.colors(), Some(&[[128, 255, 0], [199, 56, 163]][..]), "0.5 + 0.2820948 f_dc");
    assert!(notes.contains("Gaussian splats"), "{notes}");
    assert_eq!(cloud.fields().len(), 3, "the coefficients stay");
    if let Some((cloud, notes)) = load_field("p04_gs_mlsharp.ply") {
        let [low, high] = [0, 255].map(|end| cloud.colors().unwrap().iter().flatten().filter(|&&c| c == end).count());
        assert!(cloud.len() == 6000 && low + high < 100 && notes.contains("Gaussian"), "of the field: {notes}");
    }
    let packed = "ply\nformat binary_little_endian 1.0\nelement chunk 1\nproperty float min_x\nelement vertex 1\n\
                  property uint packed_position\nproperty uint packed_color\nend_header\n";
    assert!(refused("a.ply", packed.as_bytes()).contains("compressed 3D Gaussian splats"), "compressed ones");
}

#[test]
fn unknown_lines_of_a_ply_header_are_skipped() {
    let header = |line: &str, kind: &str| {
        let header = ply_header(3, "uchar", kind).replacen("element", &format!("{line}\nelement"), 1);
        header.into_bytes()
    };
    let rows = rows(&positions(3), &[[1.0, 2.0, 3.0]; 3], "", "");
    for line in ["Made by a program: of old", "author me", "obj_info x", "Kommentar"] {
        let (cloud, notes) = load("a.ply", &[&header(line, "ascii"), rows.as_bytes()].concat());
        assert_eq!((cloud.len(), notes.contains("line 3")), (3, !line.starts_with("obj_info")), "{line}: {notes}");
        let binary = [header(line, "binary_little_endian"), vec![7; 45]].concat();
        assert_eq!(load("a.ply", &binary).0.len(), 3, "{line} before numbers");
    }
    // A line that was meant as a property.
    let misspelt =
        ply_header(3, "uchar", "binary_little_endian").replacen("property uchar red", "proprety uchar red", 1);
    let message = refused("a.ply", &[misspelt.as_bytes(), &[7; 45]].concat());
    assert!(message.contains("unknown word 'proprety'"), "{message}");
    if let Some((cloud, notes)) = load_field("p40_header_line_without_keyword.ply") {
        assert!(cloud.len() == 2000 && notes.contains("'Made'"), "of the field: {notes}");
    }
}

#[test]
fn a_name_that_comes_twice_counts_once() {
    let file = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                property float x\nproperty float x\nend_header\n1 2 3 9 8\n";
    let (cloud, notes) = load("a.ply", file.as_bytes());
    assert_eq!(cloud.positions(), [[1.0, 2.0, 3.0]], "the first");
    assert_eq!(names(&cloud), ["x_2", "x_2_2"], "the others under other names");
    assert!(notes.contains("more than one x") && notes.len() < 200, "{notes}");
    let description = autosplats_formats::describe_bytes(Path::new("a.ply"), file.as_bytes(), &ReadOptions::default());
    let described: Vec<_> = description.unwrap().attributes.into_iter().map(|attribute| attribute.name).collect();
    assert_eq!(described, ["x", "y", "z", "x_2", "x_2_2"], "each described once");
}

#[test]
fn old_and_other_headers_of_pcd() {
    let row = "1 2 3 0.5\n4 5 6 0.75\n";
    let whole = |header: &str| format!("{header}{row}");
    for (header, told) in [
        ("VERSION .5\nCOLUMNS x y z i\nPOINTS 2\nDATA ascii\n", "SIZE and TYPE are missing"),
        ("VERSION .5\nFIELDS x y z i\nPOINTS 2\nDATA ascii\n", "SIZE and TYPE are missing"),
        (
            "VERSION .7\nTIMESTAMP 12.5\nFIELDS x y z i\nSIZE 4 4 4 4\nTYPE F F F F\nPOINTS 2\nDATA ascii\n",
            "'TIMESTAMP'",
        ),
        (
            "VERSION 3.0\nFIELDS x y z i\nSIZE 4 4 4 4\nTYPE F F F F\nPOINTS 2\nDATA ascii\nHEADER_EXT_START 2\nMODE 7\n\
             TIMESTAMP 3 4\nHEADER_EXT_END\n",
            "skipped",
        ),
    ] {
        let (cloud, notes) = load("a.pcd", whole(header).as_bytes());
        assert_eq!(cloud.positions(), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "{header}");
        assert!(notes.contains(told), "{header}: {notes}");
    }
    // Binary files have to be as long as the rest of the header says.
    let binary = |header: &str, len: usize| [header.as_bytes(), &vec![0x3f; len]].concat();
    let old = "VERSION .5\nCOLUMNS x y z\nPOINTS 2\nDATA binary\n";
    assert_eq!(load("a.pcd", &binary(old, 24)).0.len(), 2, "as old files are");
    assert!(refused("a.pcd", &binary(old, 48)).contains("not as long"), "of doubles");
    let misspelt = "VERSION .7\nFIELDS x y z d\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNTS 1 1 1 3\nPOINTS 2\nDATA binary\n";
    assert!(refused("a.pcd", &binary(misspelt, 48)).contains("'COUNTS'"), "misspelt");
    let block = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 2\nDATA binary\nHEADER_EXT_START\nA 1\nHEADER_EXT_END\n";
    assert_eq!(load("a.pcd", &binary(block, 24)).0.len(), 2, "a block before numbers");
    assert!(
        refused("a.pcd", b"FIELDS x y z\nSIZE 4 4 4\nPOINTS 1\nDATA ascii\n1 2 3\n").contains("lacks SIZE or TYPE")
    );
    for name in ["d01_header_ext.pcd", "d09_v05_columns.pcd"] {
        let Some((cloud, notes)) = load_field(name) else { continue };
        assert!(cloud.len() == 6000 && !notes.is_empty(), "{name}: {notes}");
    }
}

#[test]
fn what_is_whole_of_a_cut_file_is_read() {
    let count = 50;
    let points = positions(count);
    let body = rows(&points, &vec![[1.0, 2.0, 3.0]; count], "", "");
    let binary = |kind: &str| -> Vec<u8> {
        let big = kind.contains("big");
        let bytes = |value: &f32| if big { value.to_be_bytes() } else { value.to_le_bytes() };
        let point = |point: &[f32; 3]| point.iter().flat_map(bytes).chain([1, 2, 3]).collect::<Vec<u8>>();
        points.iter().flat_map(point).collect()
    };
    let listed = ply_header(count, "uchar", "binary_little_endian").replacen(
        "end_header",
        "property list uchar uchar more\nend_header",
        1,
    );
    let with_lists: Vec<u8> =
        binary("binary_little_endian").chunks(15).flat_map(|point| [point, &[2, 8, 9]].concat()).collect();
    let files = [
        ("a.ply", ply_header(count, "uchar", "ascii"), body.clone().into_bytes()),
        ("b.ply", ply_header(count, "uchar", "binary_little_endian"), binary("little")),
        ("c.ply", ply_header(count, "uchar", "binary_big_endian"), binary("big")),
        ("d.ply", listed, with_lists),
        ("a.pcd", String::new(), pcd_bytes("ascii", count)),
        ("b.pcd", String::new(), pcd_bytes("binary", count)),
    ];
    for (name, header, body) in files {
        let whole = [header.as_bytes(), &body].concat();
        let (all, notes) = load(name, &whole);
        assert!(all.len() == count && !notes.contains("cut off"), "{name}: {notes}");
        for part in [3, 20, body.len() / 4, body.len() / 2] {
            let (cloud, notes) = load(name, &whole[..whole.len() - part]);
            let (held, lost) = (cloud.len(), count - cloud.len());
            assert!(held < count && held > 10, "{name} without {part} bytes: {held}");
            assert_eq!(cloud.positions(), &all.positions()[..held], "{name} without {part} bytes");
            assert!(notes.contains(&format!("cut off: {lost} of {count} points are lost")), "{name}: {notes}");
        }
        let first =
            if header.is_empty() { body.windows(5).position(|w| w == b"DATA ").unwrap() + 14 } else { header.len() };
        let message = refused(name, &whole[..first + 4]);
        assert!(message.contains("before the first of 50 points") || message.contains("complete"), "{name}: {message}");
    }
    assert!(refused("a.pcd", &pcd_bytes("binary_compressed", 50)[..700]).contains("cut off"), "nothing is whole");
}

#[test]
fn whole_faces_of_a_cut_mesh_are_read() {
    let header = |kind: &str| {
        format!(
            "ply\nformat {kind} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             element face 2\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let text = header("ascii") + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";
    let mut binary = header("binary_little_endian").into_bytes();
    for point in [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]] {
        point.iter().for_each(|value| binary.extend(value.to_le_bytes()));
    }
    for face in [[0_i32, 1, 2], [0, 2, 3]] {
        binary.push(3);
        face.iter().for_each(|corner| binary.extend(corner.to_le_bytes()));
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in [("text", text.into_bytes()), ("binary", binary)] {
        for (cut, points, faces) in [(0, 4, 2), (3, 4, 1), if name == "text" { (18, 3, 0) } else { (40, 2, 0) }] {
            let path = folder.path().join("a.ply");
            std::fs::write(&path, &bytes[..bytes.len() - cut]).unwrap();
            let notes = Notes::default();
            let mesh = read_mesh(&path, &ReadOptions::default(), &notes).unwrap();
            let notes = notes.notes.into_inner().unwrap();
            assert_eq!(
                (mesh.cloud.len(), mesh.triangles.len()),
                (points, faces),
                "{name} without {cut} bytes: {notes:?}"
            );
            assert_eq!(notes.iter().any(|note| note.contains("cut off")), cut > 0, "{name}: {notes:?}");
        }
    }
}
