//! Files cut anywhere, with changed bytes, or with false headers. Reading quickly gives an error or points, without
//! panic.

use std::time::{Duration, Instant};

use crate::common::{error, las_bytes, pcd_bytes, ptx_bytes, read_bytes, rich_cloud};
use autosplats_cloud::{PointCloud, Random};
use autosplats_formats::{ReadOptions, describe, read, read_mesh, write};
use base64::Engine as _;

/// Far above the time for any of these small files, and far below that of a loop over a claimed count.
const LIMIT: Duration = Duration::from_secs(5);

const POINTS: usize = 300;

/// One small file of every format and encoding.
fn samples() -> Vec<(&'static str, Vec<u8>)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    write(&rich_cloud(POINTS), &path, &()).unwrap();
    let scanned = folder.path().join("a.e57");
    write(&rich_cloud(POINTS), &scanned, &()).unwrap();
    let rows: String = rich_cloud(POINTS).positions().iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
    let header =
        "element vertex 300\nproperty float x\nproperty float y\nproperty float z\nelement face 0\nend_header\n";
    let mut lists = b"ply\nformat binary_big_endian 1.0\nelement vertex 300\nproperty list uint uchar ids\n".to_vec();
    lists.extend(b"property float x\nproperty float y\nproperty float z\nend_header\n");
    for i in 0..POINTS as u32 {
        lists.extend((i % 4).to_be_bytes());
        lists.extend(vec![7; i as usize % 4]);
        lists.extend([i as f32, 0.5, 1.0].map(f32::to_be_bytes).as_flattened());
    }
    vec![
        ("a.ply", std::fs::read(&path).unwrap()),
        ("b.ply", format!("ply\nformat ascii 1.0\n{header}{rows}").into_bytes()),
        ("c.ply", lists),
        ("a.las", las_bytes((1, 2), 3, false, POINTS)),
        ("b.las", las_bytes((1, 4), 7, false, POINTS)),
        ("a.laz", las_bytes((1, 2), 3, true, POINTS)),
        ("b.laz", las_bytes((1, 4), 8, true, POINTS)),
        ("a.pcd", pcd_bytes("ascii", POINTS)),
        ("b.pcd", pcd_bytes("binary", POINTS)),
        ("c.pcd", pcd_bytes("binary_compressed", POINTS)),
        ("a.e57", std::fs::read(&scanned).unwrap()),
        ("a.ptx", ptx_bytes(POINTS)),
        ("a.xyz", rows.clone().into_bytes()),
        ("a.pts", format!("{POINTS}\n{rows}").into_bytes()),
        ("a.csv", format!("x,y,z\n{}", rows.replace(' ', ",")).into_bytes()),
        ("a.obj", rows.lines().map(|row| format!("v {row}\n")).chain(faces("f", 1)).collect::<String>().into_bytes()),
        ("a.off", format!("OFF\n{POINTS} 298 0\n{rows}{}", faces("3", 0).collect::<String>()).into_bytes()),
        ("a.stl", stl(false)),
        ("b.stl", stl(true)),
        ("a.glb", glb()),
        ("d.ply", mesh_ply()),
    ]
}

/// A triangle from every three consecutive points.
fn faces(word: &str, first: usize) -> impl Iterator<Item = String> {
    (first..first + POINTS - 2).map(move |i| format!("{word} {i} {} {}\n", i + 1, i + 2))
}

/// A hundred triangles without shared corners.
fn stl(text: bool) -> Vec<u8> {
    let positions = rich_cloud(POINTS).positions().to_vec();
    if text {
        let facet = |corners: &[[f32; 3]]| {
            let vertex = |[x, y, z]: &[f32; 3]| format!("vertex {x} {y} {z}\n");
            let vertices: String = corners.iter().map(vertex).collect();
            format!("facet normal 0 0 1\nouter loop\n{vertices}endloop\nendfacet\n")
        };
        let facets: String = positions.chunks(3).map(facet).collect();
        return format!("solid\n{facets}endsolid\n").into_bytes();
    }
    let mut bytes = vec![b' '; 80];
    bytes.extend((POINTS as u32 / 3).to_le_bytes());
    for corners in positions.chunks(3) {
        bytes.extend([0; 12]);
        corners.as_flattened().iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// A triangle from every three consecutive points, in the mesh of a child node.
fn glb() -> Vec<u8> {
    let positions =
        rich_cloud(POINTS).positions().as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
    let indices = (0..POINTS as u16).flat_map(u16::to_le_bytes).collect::<Vec<_>>();
    let json = format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"scene\":0,\"scenes\":[{{\"nodes\":[0]}}],\"nodes\":[{{\"children\":[1]}},\
         {{\"mesh\":0,\"scale\":[1,2,3]}}],\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}},\"indices\":1}}]}}],\
         \"accessors\":[{{\"bufferView\":0,\"componentType\":5126,\"count\":{POINTS},\"type\":\"VEC3\"}},{{\"bufferView\":1,\
         \"componentType\":5123,\"count\":{POINTS},\"type\":\"SCALAR\"}}],\"bufferViews\":[{{\"buffer\":0,\"byteLength\":{0}}},\
         {{\"buffer\":0,\"byteOffset\":{0},\"byteLength\":{1}}}],\"buffers\":[{{\"byteLength\":{2}}}]}}",
        positions.len(),
        indices.len(),
        positions.len() + indices.len()
    );
    let padding = json.len().next_multiple_of(4) - json.len();
    let len = |len: usize| (len as u32).to_le_bytes();
    let json = json + &"   "[..padding];
    let data = [positions, indices].concat();
    let total = len(28 + json.len() + data.len());
    let header = [&b"glTF\x02\0\0\0"[..], &total, &len(json.len()), b"JSON"].concat();
    [&header[..], json.as_bytes(), &len(data.len()), b"BIN\0", &data].concat()
}

/// Faces after the vertices, and a strip.
fn mesh_ply() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement face 298\nproperty list uchar int vertex_indices\n\
        element tristrips 1\nproperty list int int vertex_indices\nelement vertex 300\nproperty float x\n\
        property float y\nproperty float z\nend_header\n"
        .to_vec();
    for i in 0..POINTS as i32 - 2 {
        bytes.push(3);
        bytes.extend([i, i + 1, i + 2].map(i32::to_le_bytes).as_flattened());
    }
    bytes.extend(7_i32.to_le_bytes());
    bytes.extend([0, 1, 2, -1, 3, 4, 5].map(i32::to_le_bytes).as_flattened());
    bytes.extend(rich_cloud(POINTS).positions().as_flattened().iter().flat_map(|value| value.to_le_bytes()));
    bytes
}

/// Reads a possibly broken file and checks time and plausibility. A panic fails the test by itself.
fn survive(name: &str, what: &str, bytes: &[u8]) -> Option<PointCloud> {
    let start = Instant::now();
    let result = read_bytes(name, bytes);
    if ["ply", "obj", "off", "stl", "glb"].iter().any(|extension| name.ends_with(extension)) {
        survive_as_mesh(name, what, bytes, result.is_ok());
    }
    assert!(start.elapsed() < LIMIT, "{name}, {what}: took {:?}", start.elapsed());
    match result {
        Ok(cloud) => {
            assert!(cloud.len() <= bytes.len(), "{name}, {what}: more points than bytes");
            Some(cloud)
        }
        Err(error) => {
            let message = error.to_string();
            assert!(!message.contains(char::is_control), "{name}, {what}: one line of plain text: {message:?}");
            None
        }
    }
}

/// Reads the same bytes with triangles, and describes the file. A file without readable points must give no mesh.
fn survive_as_mesh(name: &str, what: &str, bytes: &[u8], points: bool) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    match read_mesh(&path, &ReadOptions::default(), &()) {
        Ok(mesh) => {
            assert!(points, "{name}, {what}: a mesh, but no points");
            assert!(mesh.triangles.len() <= bytes.len(), "{name}, {what}: more triangles than bytes");
            let exist = mesh.triangles.as_flattened().iter().all(|&corner| (corner as usize) < mesh.cloud.len());
            assert!(exist, "{name}, {what}: a corner that does not exist");
        }
        Err(error) => assert!(!error.to_string().contains(char::is_control), "{name}, {what}: one line of plain text"),
    }
    if let Ok(description) = describe(&path, &ReadOptions::default()) {
        assert!(!description.format.contains(char::is_control), "{name}, {what}: one line of plain text");
    }
}

#[test]
fn whole_samples_are_read() {
    for (name, bytes) in samples() {
        assert_eq!(survive(name, "whole", &bytes).map(|cloud| cloud.len()), Some(POINTS), "{name}");
    }
}

#[test]
fn files_cut_anywhere() {
    for (name, bytes) in samples() {
        let header = 0..bytes.len().min(400);
        let body = (0..60).map(|i| bytes.len() * i / 60);
        for len in header.chain(body).chain(bytes.len() - 8..bytes.len()) {
            let cloud = survive(name, &format!("cut after {len} bytes"), &bytes[..len]);
            // Bare rows do not state their number; every other format does. Losing the last line feed, what follows the
            // points in LAZ, or a digit of the last number is harmless. LAS, PLY and PCD keep the complete points,
            // and E57 the scans that are described.
            let bare = matches!(name, "a.xyz" | "a.csv" | "a.obj");
            // Faces follow the points. Text of triangles is complete after any of them.
            let faces = matches!(name, "a.off" | "b.stl");
            let kept = [".la", ".ply", ".pcd", ".e57"].iter().any(|kind| name.contains(kind));
            let counted = !bare && !faces && !kept && len + 20 < bytes.len();
            assert!(!counted || cloud.is_none(), "{name}, cut after {len} of {} bytes: was read", bytes.len());
        }
    }
}

#[test]
fn files_with_changed_bytes() {
    let mut random = Random::from_state(5);
    for (name, bytes) in samples() {
        for round in 0..400 {
            let mut changed = bytes.clone();
            // Headers and the ends of files, where tables are, deserve more tries than coordinates.
            let range = [bytes.len(), bytes.len().min(400), 60][round % 3];
            for _ in 0..=random.modulo(4) {
                let at = if round % 3 == 2 { bytes.len() - 1 - random.modulo(range) } else { random.modulo(range) };
                changed[at] = [random.bits() as u8, 0, 0xff, changed[at] ^ 1 << random.modulo(8)][random.modulo(4)];
            }
            survive(name, &format!("change {round}"), &changed);
        }
    }
}

#[test]
fn every_byte_of_binary_headers_at_its_extremes() {
    for (name, bytes) in samples().into_iter().filter(|(name, _)| name.contains(".la")) {
        for at in 0..480 {
            for value in [0, 0x7f, 0x80, 0xff] {
                let mut changed = bytes.clone();
                changed[at] = value;
                survive(name, &format!("byte {at} is {value}"), &changed);
            }
        }
    }
}

#[test]
fn headers_that_lie_allocate_nothing() {
    let vertex = "property float x\nproperty float y\nproperty float z\n";
    for count in ["4000000000", "18446744073709551615", "1537228672809129302"] {
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            // The one point that there is may be read.
            let text = format!("ply\nformat {format} 1.0\nelement vertex {count}\n{vertex}end_header\n1 2 3\n");
            survive("a.ply", "a false count", text.as_bytes());
            let list = format!("ply\nformat {format} 1.0\nelement face {count}\nproperty list uint double ids\n");
            error("b.ply", format!("{list}element vertex 1\n{vertex}end_header\n1 2 3\n").as_bytes());
            let list = format!("ply\nformat {format} 1.0\nelement vertex {count}\nproperty list uint double ids\n");
            let text = format!("{list}{vertex}end_header\n9 9 9 9 9 9 9 9 9 9 9 9 9 9 9 9");
            survive("c.ply", "a false count", text.as_bytes());
        }
        for data in ["ascii", "binary", "binary_compressed"] {
            let header = |count: &str, points: &str| {
                format!(
                    "VERSION .7\nFIELDS x y z h\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 {count}\nPOINTS {points}\n\
                     DATA {data}\n1 2 3 4 5 6 7 8 9\n"
                )
            };
            survive("a.pcd", "a false count", header("1", count).as_bytes());
            error("b.pcd", header(count, "1").as_bytes());
        }
        error("a.pts", format!("{count}\n1 2 3\n").as_bytes());
    }
    let many: String = (0..200_000).map(|i| format!("property float p{i}\n")).collect();
    let start = Instant::now();
    error("d.ply", format!("ply\nformat ascii 1.0\nelement vertex 0\n{many}end_header\n").as_bytes());
    assert!(start.elapsed() < LIMIT, "a header of 200,000 properties is refused at once");
    let long = "1 ".repeat(1 << 20);
    error("e.ply", format!("ply\ncomment {long}").as_bytes());
    error("c.pcd", format!("VERSION .7\nFIELDS {long}\n").as_bytes());
    error("a.xyz", format!("{long}\n{long}\n").as_bytes());
    error("b.xyz", format!("x {long}\nx {long}\n").as_bytes());
}

#[test]
fn folders_and_missing_files_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    assert!(read(folder.path(), &()).is_err(), "a folder");
    assert!(read(&folder.path().join("missing.ply"), &()).is_err(), "a missing file");
}

/// A compressed and then damaged file whose GPS times switch between scanners forever.
const SWITCHING: &str = "\
    TEFTRgAAEAAAAAAAAAAAAAAAAAAAAAAAAQQAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA\
    AAAAAAAAAAAAAHcB4QEAAAEAAACHJQAYAAAAGAAAAAAAAAAAAAAAAAAAAAAAAAD8qfHSTWJQP/yp8dJNYlA//Knx0k1iUD8AAAAAAAAAAAAAAAAA\
    AAAAAAAAAAAAAAAAAAAAAAAnQAAAAAAAAAAAAAAAAAAAEEAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAABgAAAAA\
    AAAAGAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA\
    AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAABsYXN6aXAgZW5jb2RlZAAAvFY0AGh0dHBzOi8vbGFzemlwLm9yZwAAAAAA\
    AAAAAAAAAAAAAwAAAAICAAAAAAAAUMMAAP////////////////////8DAAoAHgADAAsABgADAA4AAQADAIIDAAAAAAAAAAAAAAAAAAAAAAAAAAAh\
    AAAAAAAAAAAAAAAAAAAAAAAsAQcAARgAAABTAAAAEwAAAAAAAAAAAAAADAAAAAAAAAAAAAAAAAAAAKMAAAAvAAAAAAAAACCaiuvVJSXoc4V7LHr2\
    pvAGO8wTsXQ1bYxM6sFGYbGeeAAAAAAAAAAAAAAAAGxhc3ppcCBlbmNvZGVkAAC8VigAaHR0cHM6Ly9sYXN6aXAub3JnAAAAAAAAAAAAAAAAAAAC\
    AAAAAgIAAAAAAABQwwAA/////////////////////wEABgAUAAIAzQEAAAAAAAAAAAAAAAAAAGNgkoAAAYaFK/zgAAHJVWNBYAACBnN04EAABMA+\
    JfMAAAshC11fgAAclu0hSAAAYXwH2PYAAStRMK3AAANzvdWmwAAKEQzWtAAAG/ZK/s4AANfE5OKAAAU2NJhtgAAZ2VGVcgABycrI9YAAHUTX8pUA\
    Agc3wXUAAAEAAACCAsJFBooNFBooNFBooNFBooNFBooNFBooNFBooNFBooNFBooNFBooNFBoYAAAAAAAAAABAAAAS/8AAAA=";

#[test]
fn a_time_that_belongs_to_no_scanner() {
    let bytes = base64::prelude::BASE64_STANDARD.decode(SWITCHING).unwrap();
    survive("a.laz", "switching", &bytes);
    let damaged = error("a.laz", &bytes);
    assert!(damaged.contains("the compressed data are damaged (a GPS time belongs to no sequence)"), "{damaged}");
}
