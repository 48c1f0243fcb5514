//! Hand-made meshes of every format, read back as points and as triangles.

use std::{path::Path, sync::Mutex};

use crate::common::{error, read_bytes};
use autosplats_cloud::{Contents, Progress, glam::DVec3};
use autosplats_formats::{Description, ReadOptions, describe, read_mesh};

/// Stores the notes for the user.
#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Progress for Notes {
    fn report(&self, _fraction: f32) {}
    fn note(&self, note: &str) {
        self.0.lock().unwrap().push(note.into());
    }
}

impl Notes {
    fn all(&self) -> String {
        self.0.lock().unwrap().join("\n")
    }
}

fn with_file<T>(name: &str, bytes: &[u8], use_it: impl FnOnce(&Path) -> T) -> T {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    use_it(&path)
}

/// The mesh in `bytes` and the notes for the user. Its points must equal those read without triangles.
fn mesh(name: &str, bytes: &[u8]) -> (Contents, String) {
    let notes = Notes::default();
    let mesh = with_file(name, bytes, |path| read_mesh(path, &ReadOptions::default(), &notes));
    let mesh = mesh.unwrap_or_else(|error| panic!("{error}"));
    let points = read_bytes(name, bytes).unwrap();
    assert_eq!(points.positions(), mesh.cloud.positions(), "{name}: the points do not depend on the triangles");
    (mesh, notes.all())
}

fn mesh_error(name: &str, bytes: &[u8]) -> String {
    with_file(name, bytes, |path| match read_mesh(path, &ReadOptions::default(), &()) {
        Ok(_) => panic!("{name} was read"),
        Err(error) => error.to_string(),
    })
}

fn described(name: &str, bytes: &[u8]) -> Description {
    with_file(name, bytes, |path| describe(path, &ReadOptions::default())).unwrap_or_else(|error| panic!("{error}"))
}

fn attributes(description: &Description) -> Vec<&str> {
    description.attributes.iter().map(|attribute| attribute.name.as_str()).collect()
}

/// Four corners of a square, and a point above.
const FIVE: [[f32; 3]; 5] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 1.0]];

/// The square and one face on it.
const SQUARE_AND_FACE: [[u32; 3]; 3] = [[0, 1, 2], [0, 2, 3], [0, 1, 4]];

/// Elements of a PLY file, in order.
#[derive(Clone, Copy, PartialEq)]
enum Order {
    VerticesFirst,
    FacesFirst,
    Strip,
}

fn ply(encoding: &str, order: Order) -> Vec<u8> {
    let vertices = "element vertex 5\nproperty float x\nproperty float y\nproperty float z\n";
    let faces = "element face 4\nproperty uchar flag\nproperty list uchar float texcoord\n\
                 property list uchar int vertex_indices\nproperty double quality\n";
    let strip = "element tristrips 1\nproperty list int int vertex_indices\n";
    let extra = "element extra 2\nproperty list uchar short things\n";
    let elements = match order {
        Order::VerticesFirst => [vertices, extra, faces].concat(),
        Order::FacesFirst => [extra, faces, vertices].concat(),
        Order::Strip => [vertices, extra, strip].concat(),
    };
    let mut bytes = format!("ply\nformat {encoding} 1.0\n{elements}end_header\n").into_bytes();
    let ascii = encoding == "ascii";
    let big = encoding == "binary_big_endian";
    let number = |bytes: &mut Vec<u8>, mut raw: Vec<u8>, text: String| {
        if ascii {
            bytes.extend(format!("{text} ").bytes());
        } else {
            if big {
                raw.reverse();
            }
            bytes.extend(raw);
        }
    };
    let int = |bytes: &mut Vec<u8>, value: i32| number(bytes, value.to_le_bytes().to_vec(), value.to_string());
    let float = |bytes: &mut Vec<u8>, value: f32| number(bytes, value.to_le_bytes().to_vec(), value.to_string());
    let byte = |bytes: &mut Vec<u8>, value: u8| number(bytes, vec![value], value.to_string());
    let end = |bytes: &mut Vec<u8>| {
        if ascii {
            bytes.push(b'\n');
        }
    };

    let put_vertices = |bytes: &mut Vec<u8>| {
        for position in FIVE {
            position.into_iter().for_each(|value| float(bytes, value));
            end(bytes);
        }
    };
    let put_extra = |bytes: &mut Vec<u8>| {
        for len in [2, 0] {
            byte(bytes, len);
            (0..len).for_each(|_| number(bytes, vec![7, 0], "7".into()));
            end(bytes);
        }
    };
    let put_faces = |bytes: &mut Vec<u8>| {
        // A square, an invalid face, a face with a missing corner, a triangle.
        for corners in [&[0, 1, 2, 3][..], &[0, 1], &[0, 1, 5], &[0, 1, 4]] {
            byte(bytes, 9);
            byte(bytes, 1);
            float(bytes, 0.5);
            byte(bytes, corners.len() as u8);
            corners.iter().for_each(|&corner| int(bytes, corner));
            number(bytes, 2_f64.to_le_bytes().to_vec(), "2".into());
            end(bytes);
        }
    };
    let put_strip = |bytes: &mut Vec<u8>| {
        // Two strips. The first repeats a point, which reverses its orientation.
        let corners = [3, 0, 2, 1, 1, 4, -1, 0, 1, 4];
        int(bytes, corners.len() as i32);
        corners.into_iter().for_each(|corner| int(bytes, corner));
        end(bytes);
    };
    match order {
        Order::VerticesFirst => {
            put_vertices(&mut bytes);
            put_extra(&mut bytes);
            put_faces(&mut bytes);
        }
        Order::FacesFirst => {
            put_extra(&mut bytes);
            put_faces(&mut bytes);
            put_vertices(&mut bytes);
        }
        Order::Strip => {
            put_vertices(&mut bytes);
            put_extra(&mut bytes);
            put_strip(&mut bytes);
        }
    }
    bytes
}

#[test]
fn ply_faces_of_every_encoding() {
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for order in [Order::VerticesFirst, Order::FacesFirst] {
            let bytes = ply(encoding, order);
            let (mesh, notes) = mesh("a.ply", &bytes);
            assert_eq!(mesh.cloud.positions(), FIVE, "{encoding}");
            assert_eq!(mesh.triangles, SQUARE_AND_FACE, "{encoding}");
            assert!(notes.contains("1 faces have corners that do not exist"), "{encoding}: {notes}");
            assert_eq!(described("a.ply", &bytes).faces, Some(4), "{encoding}");
        }
        let (mesh, _) = mesh("a.ply", &ply(encoding, Order::Strip));
        assert_eq!(
            mesh.triangles,
            [[3, 0, 2], [2, 0, 1], [0, 1, 4]],
            "{encoding}: every other triangle is turned round"
        );
    }
}

#[test]
fn ply_with_cut_faces_has_points_and_whole_faces() {
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for order in [Order::VerticesFirst, Order::Strip] {
            let whole = ply(encoding, order);
            let faces = if order == Order::Strip { 12 } else { 20 };
            let cut = &whole[..whole.len() - faces];
            assert_eq!(read_bytes("a.ply", cut).unwrap().positions(), FIVE, "{encoding}: points");
            let (all, part) = (mesh("a.ply", &whole).0, mesh("a.ply", cut));
            let left = part.0.triangles.len();
            assert!(left < all.triangles.len() && part.0.triangles == all.triangles[..left], "{encoding}: whole faces");
            assert!(part.1.contains("the file is cut off") && part.1.contains("faces are lost"), "{}", part.1);
        }
    }
    let lying = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
                 property float z\nelement face 18446744073709551615\nproperty list uint int vertex_index\nend_header\n";
    let mut bytes = lying.as_bytes().to_vec();
    bytes.extend([0; 12]);
    assert_eq!(read_bytes("a.ply", &bytes).unwrap().len(), 1, "the point is there");
    bytes.extend([0xff; 4]);
    let (mesh, notes) = mesh("a.ply", &bytes);
    assert!(mesh.triangles.is_empty() && notes.contains("18446744073709551615 faces are lost"), "{notes}");
}

const OBJ: &str = "# a comment\nmtllib some.mtl\no thing\ng group\ns off\n\
    v 0 0 0\nv 1 0 0 1.0\nv 1.0 1.0 0.0\nv 0 \\\n 1 \\\n 0\nv 5e-1 0.5 1\n\
    vt 0 0\nvn 0 0 1\nusemtl red\nf 1 2/1 3//1 4/1/1\np 1\nl 1 2\nf -5 \\\n -4 -1\nf 1 2 6\nf 1 2 x\nf 0 1 2\nf 1 2 -9\n";

#[test]
fn obj_of_every_kind() {
    for newline in ["\n", "\r\n"] {
        let text = OBJ.replace('\n', newline);
        let (mesh, notes) = mesh("a.obj", text.as_bytes());
        assert_eq!(mesh.cloud.positions(), FIVE, "positions");
        assert_eq!(mesh.triangles, SQUARE_AND_FACE, "faces");
        assert!(notes.contains("4 faces have corners that do not exist"), "{notes}");
        assert_eq!((mesh.cloud.colors(), mesh.cloud.fields().len()), (None, 0), "no colours, no fields");
        let description = described("a.obj", text.as_bytes());
        assert_eq!((description.points, description.faces), (Some(5), Some(6)), "counted");
        assert_eq!((&*description.format, attributes(&description)), ("OBJ", vec!["x", "y", "z"]), "named");
    }
    assert!(error("a.obj", b"v 1 2\n").contains("line 1: 2 values"), "too few");
    assert!(error("a.obj", b"v 1 2 3\nv 1 x 3\n").contains("line 2: 'x' is not a number"), "no number");
    assert!(error("a.obj", b"hello\n").contains("no vertex"), "other text");
    assert!(error("a.obj", b"v 1 2 3\n\0\0").contains("byte 8"), "no text");
}

#[test]
fn obj_colours() {
    let colors = |text: &str| read_bytes("a.obj", text.as_bytes()).unwrap().colors().map(<[_]>::to_vec);
    assert_eq!(colors("v 0 0 0 1 0.5 0\nv 0 0 1 0 0 1\n"), Some(vec![[255, 128, 0], [0, 0, 255]]), "0 to 1");
    assert_eq!(colors("v 0 0 0 255 128 0\nv 0 0 1 0 0 1\n"), Some(vec![[255, 128, 0], [0, 0, 1]]), "0 to 255");
    assert_eq!(colors("v 0 0 0 1 0 1 0\n"), Some(vec![[0, 255, 0]]), "after a weight");
    assert_eq!(colors("v 0 0 0 1\n"), None, "a weight is no colour");
    let mixed = "v 0 0 0\nv 1 0 0 0 0 0\nv 2 0 0\n";
    let (mesh, notes) = mesh("a.obj", mixed.as_bytes());
    assert_eq!(mesh.cloud.colors().unwrap(), [[255; 3], [0; 3], [255; 3]], "white where there is none");
    assert!(notes.contains("2 vertices have no colour"), "{notes}");
    assert_eq!(described("a.obj", mixed.as_bytes()).attributes.len(), 6, "colours are among the attributes");
}

#[test]
fn long_obj_is_read_in_pieces() {
    // Several blocks of half a megabyte. Relative corners cross their borders, a face precedes its vertices, and a
    // continued line may lie on a border.
    let mut text = String::from("f 1 2 120000\n");
    for i in 0..120_000 {
        text += &format!("v {i} \\\n{}.5 -{i}\n", i % 7);
        if i >= 2 {
            text += if i % 2 == 0 { "f -3 -2 \\\n -1\n" } else { "f -1 -2 -3\n" };
        }
    }
    assert!(text.len() > 2 << 20, "more than a few pieces");
    let threads = |count| rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
    let (mesh, notes) = threads(3).install(|| mesh("a.obj", text.as_bytes()));
    assert_eq!((mesh.cloud.len(), notes.as_str()), (120_000, ""), "all vertices, no fault");
    for i in [0, 1, 59_999, 119_999] {
        let expected = DVec3::new(f64::from(i), f64::from(i % 7) + 0.5, -f64::from(i));
        assert_eq!(mesh.cloud.world_position(i as usize), expected, "vertex {i}");
    }
    assert_eq!(mesh.triangles.len(), 119_999, "all faces");
    for (i, triangle) in mesh.triangles[..119_998].iter().enumerate() {
        let i = i as u32;
        assert_eq!(*triangle, if i.is_multiple_of(2) { [i, i + 1, i + 2] } else { [i + 2, i + 1, i] }, "face {i}");
    }
    assert_eq!(mesh.triangles[119_998], [0, 1, 119_999], "the one before its vertices comes last");
    let alone =
        threads(1).install(|| with_file("a.obj", text.as_bytes(), |p| read_mesh(p, &ReadOptions::default(), &())));
    assert!(alone.unwrap() == mesh, "threads change nothing");
}

#[test]
fn off_of_every_kind() {
    let faces = "4 0 1 2 3 255 0 0\n2 0 1\n# a comment\n3 0 1 4 # another\n3 0 1 5\n";
    let vertices = |more: &dyn Fn(usize) -> &'static str| -> String {
        FIVE.iter().enumerate().map(|(i, [x, y, z])| format!("{x} {y} {z} {}\n", more(i))).collect()
    };
    let even = |even, odd| move |i: usize| if i.is_multiple_of(2) { even } else { odd };
    let plain = vertices(&|_| "");
    let ints = vertices(&even("255 128 0 255", "1 0 0 255"));
    let floats = vertices(&even("1.0 0.5 0 1", "0 0 1 1.0"));
    let normals = vertices(&|_| "0 0 -1");
    let all = vertices(&|_| "0 1 0 10 20 30 255 0.25 0.75");
    let red = [[255, 128, 0], [1, 0, 0], [255, 128, 0], [1, 0, 0], [255, 128, 0]];
    let blue = [[255, 128, 0], [0, 0, 255], [255, 128, 0], [0, 0, 255], [255, 128, 0]];
    for (head, rows, colors, normal) in [
        ("OFF\n5 4 0\n", &plain, None, None),
        ("OFF 5 4 0\n", &plain, None, None),
        ("OFF # comment\n\n# comment\n5 4\n", &plain, None, None),
        ("5 4 0\n", &plain, None, None),
        ("COFF\n5 4 0\n", &ints, Some(&red), None),
        ("OFF\n5 4 0\n", &ints, Some(&red), None),
        ("COFF\n5 4 0\n", &floats, Some(&blue), None),
        ("NOFF\n5 4 0\n", &normals, None, Some(-1.0)),
        ("STCNOFF\n5 4 0\n", &all, Some(&[[10, 20, 30]; 5]), Some(0.0)),
    ] {
        for newline in ["\n", "\r\n"] {
            let text = format!("{head}{rows}{faces}").replace('\n', newline);
            let (mesh, notes) = mesh("a.off", text.as_bytes());
            assert_eq!(mesh.cloud.positions(), FIVE, "{head:?}");
            assert_eq!(mesh.triangles, SQUARE_AND_FACE, "{head:?}");
            assert!(notes.contains("1 faces"), "{head:?}: {notes}");
            assert_eq!(mesh.cloud.colors(), colors.map(|colors| &colors[..]), "{head:?}");
            let found = mesh.cloud.field("NormalZ").map(|field| field.values.get(2));
            assert_eq!(found, normal, "{head:?}");
            assert_eq!(mesh.cloud.fields().len(), if normal.is_some() { 3 } else { 0 }, "{head:?}: no other fields");
            let description = described("a.off", text.as_bytes());
            assert_eq!((description.points, description.faces), (Some(5), Some(4)), "{head:?}");
            let width = 3 + if colors.is_some() { 3 } else { 0 } + if normal.is_some() { 3 } else { 0 };
            assert_eq!(description.attributes.len(), width, "{head:?}: {description:?}");
        }
    }
    assert_eq!(read_bytes("a", format!("OFF\n5 4 0\n{plain}").as_bytes()).unwrap().len(), 5, "known by its first word");
    let cut = format!("OFF\n5 4 0\n{plain}3 0 1 2\n");
    assert_eq!(read_bytes("a.off", cut.as_bytes()).unwrap().len(), 5, "points of a file with cut faces");
    assert!(mesh_error("a.off", cut.as_bytes()).contains("after 1 of 4 faces"), "faces that are cut off");
    assert!(
        mesh_error("a.off", format!("OFF\n5 1 0\n{plain}3 0 1\n").as_bytes()).contains("line 8: a face of 3"),
        "short"
    );
    assert!(error("a.off", b"OFF BINARY\n").contains("save the mesh as"), "binary");
    assert!(error("a.off", b"4OFF\n1 0 0\n0 0 0 1\n").contains("three dimensions"), "four dimensions");
    assert!(error("a.off", b"OFF\n5 -4 0\n").contains("line 2: '-4' is not a count of faces"), "negative");
    assert!(error("a.off", b"hello\n").contains("line 1: an OFF file begins"), "another text");
    assert!(error("a.off", b"OFF\n9999 0 0\n0 0 0\n").contains("line 2: 9999 vertices cannot be"), "lying");
    assert!(error("a.off", b"OFF\n3 0 0\n0 0 0\n0.00 0.00 0.0\n").contains("the file ends after"), "cut off");
}

fn binary_stl(header: &str, count: u32, facets: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.resize(80, b' ');
    bytes.extend(count.to_le_bytes());
    for facet in facets {
        bytes.extend([0; 12]);
        facet.iter().flatten().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes.extend([0x12, 0x34]);
    }
    bytes
}

fn text_stl(facets: &[[[f32; 3]; 3]]) -> String {
    let vertex = |[x, y, z]: &[f32; 3]| format!("      vertex {x:e} {y:e} {z:e}\n");
    let facet = |facet: &[[f32; 3]; 3]| {
        let vertices: String = facet.iter().map(vertex).collect();
        format!("  facet normal 0 0 1\n    outer loop\n{vertices}    endloop\n  endfacet\n")
    };
    format!("solid some name\n{}endsolid some name\n", facets.iter().map(facet).collect::<String>())
}

/// The facets of the five points. The first corner has a zero with the opposite sign.
fn facets() -> Vec<[[f32; 3]; 3]> {
    let mut facets: Vec<_> =
        SQUARE_AND_FACE.iter().map(|corners| corners.map(|corner| FIVE[corner as usize])).collect();
    facets[2][0] = [-0.0, 0.0, -0.0];
    facets
}

#[test]
fn stl_corners_are_welded() {
    let facets = facets();
    let binary = binary_stl("solid though binary", 3, &facets);
    let text = text_stl(&facets);
    let upper = text.to_uppercase().replace('\n', "\r\n");
    for (what, bytes) in [("binary", &binary[..]), ("text", text.as_bytes()), ("capitals", upper.as_bytes())] {
        let (mesh, notes) = mesh("a.stl", bytes);
        assert_eq!(mesh.cloud.positions(), FIVE, "{what}: in the order of their first appearance");
        assert_eq!(mesh.triangles, SQUARE_AND_FACE, "{what}");
        assert_eq!(notes, "", "{what}");
        let description = described("a.stl", bytes);
        assert_eq!((description.faces, description.attributes.len()), (Some(3), 3), "{what}: {description:?}");
    }
    assert_eq!(read_bytes("a", &binary).unwrap().len(), 5, "a binary one is known by its size");
    let colored = binary_stl("COLOR=red", 3, &facets);
    assert_eq!(read_bytes("a.stl", &colored).unwrap().colors(), None, "colours of faces are left out");

    let (open, notes) = mesh("a.stl", text.strip_suffix("endsolid some name\n").unwrap().as_bytes());
    assert!(open.triangles.len() == 3 && notes.contains("may be cut off"), "{notes}");
    assert!(error("a.stl", &text.as_bytes()[..text.len() - 42]).contains("ends inside triangle 3"), "text cut off");
    assert!(error("a.stl", &binary[..200]).contains("after 2 of 3 triangles"), "binary cut off");
    assert!(error("a.stl", &binary[..50]).contains("before the first triangle"), "binary cut off early");
    assert!(error("a.stl", &[0; 50]).contains("inside the header"), "no text");
    assert!(
        error("a.stl", text.replace("vertex", "vortex").as_bytes()).contains("line 4: 'vortex' is not an STL keyword"),
        "typo"
    );
    let (longer, notes) = mesh("a.stl", &[&binary[..], b"junk"].concat());
    assert!(longer.triangles.len() == 3 && notes.contains("4 bytes after"), "{notes}");
    let (unknown, notes) = mesh("a.stl", &binary_stl("", 0, &facets));
    assert!(unknown.triangles.len() == 3 && notes.contains("states 0 triangles, but there are 3"), "{notes}");
    assert!(error("a.stl", &binary_stl("", 4_000_000_000, &facets)).contains("after 3 of 4000000000"), "lying");
}

#[test]
fn many_stl_corners_are_welded_in_order() {
    // A grid of squares with two triangles each, long enough for several threads.
    let size = 200;
    let at = |x: usize, y: usize| [x as f32, y as f32, ((x * y) % 5) as f32];
    let mut facets = Vec::new();
    for (x, y) in (0..size).flat_map(|y| (0..size).map(move |x| (x, y))) {
        facets.push([at(x, y), at(x + 1, y), at(x + 1, y + 1)]);
        facets.push([at(x, y), at(x + 1, y + 1), at(x, y + 1)]);
    }
    let threads = |count| rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
    let bytes = binary_stl("", facets.len() as u32, &facets);
    let (one, _) = threads(1).install(|| mesh("a.stl", &bytes));
    let (four, _) = threads(4).install(|| mesh("a.stl", &bytes));
    let (text, _) = threads(4).install(|| mesh("a.stl", text_stl(&facets).as_bytes()));
    assert!(one == four, "threads change nothing");
    assert!(one == text, "nor does the encoding");
    assert_eq!(one.cloud.len(), (size + 1) * (size + 1), "every corner once");
    for (facet, triangle) in facets.iter().zip(&one.triangles) {
        assert_eq!(
            triangle.map(|corner| one.cloud.positions()[corner as usize]),
            *facet,
            "the corners of each triangle"
        );
    }
    let firsts = one.triangles.as_flattened().iter().fold(0, |next, &corner| next + u32::from(corner == next));
    assert_eq!(firsts as usize, one.cloud.len(), "points are numbered as they appear first");
}
