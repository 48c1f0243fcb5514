//! Small complete files of every format, with a variant for each path through its reader.

use std::{io::Write as _, path::Path};

use anyhow::{Context as _, Result};
use autosplats_cloud::glam::{DMat4, DQuat, DVec3};
use autosplats_cloud::{FieldValues, PointCloud, Scan};
use autosplats_formats::write;
use autosplats_sources::point_cloud2::Encoding;
use flate2::{Compression, write::GzEncoder};

use crate::{
    recording::{Message, POINTS as CLOUDS, Style, TRANSFORMS, Topic, bag, mcap},
    ros::{Cloud2, F32, transforms},
    target::BETWEEN,
    trees,
};

/// Files of one format.
pub(crate) struct Seeds {
    /// The extension of the files, without a dot.
    pub(crate) extension: &'static str,
    /// The contents of the files.
    pub(crate) files: Vec<Vec<u8>>,
    /// Number of files at the start of `files` that are generated, hence sound. Files of a corpus may be broken.
    pub(crate) own: usize,
}

/// Number of points in a seed. Few points make many inputs a second.
const POINTS: usize = 24;

/// Most bytes of a file of a corpus. Larger files only slow the run down.
const MAX_SEED: u64 = 64 << 10;

pub(crate) fn all() -> Result<Vec<Seeds>> {
    let seeds = |extension, files: Vec<Vec<u8>>| Seeds { extension, own: files.len(), files };
    let rows: String = (0..POINTS).map(|i| format!("{} {} {} {}\n", i, i * i % 7, 0.5 * i as f64, i * 10)).collect();
    let positions: String = (0..POINTS).map(|i| format!("{} {} {}\n", i, i * i % 7, 0.5 * i as f64)).collect();
    let faces = |word: &str, first: usize| -> String {
        (first..first + POINTS - 2).map(|i| format!("{word} {i} {} {}\n", i + 1, i + 2)).collect()
    };
    let vertices: String = positions.lines().map(|row| format!("v {row}\n")).collect();
    let number = |i: usize, columns: usize| 0.5 * (i / columns) as f32 + 20.0 * (i % columns) as f32;
    let sweep = |columns: usize| (0..POINTS * columns).flat_map(|i| number(i, columns).to_le_bytes()).collect();
    Ok(vec![
        seeds("ply", [written("ply")?, vec![ascii_ply(), list_ply(), mesh_ply()]].concat()),
        seeds("pcd", [written("pcd")?, vec![ascii_pcd(), compressed_pcd()]].concat()),
        seeds("las", [written("las")?, las(false)?].concat()),
        seeds("laz", [written("laz")?, las(true)?].concat()),
        seeds("copc", vec![trees::copc(&trees::nodes(300)).0]),
        seeds("ept", epts()?),
        seeds("potree", potrees()?),
        seeds("e57", written("e57")?),
        seeds("ptx", vec![ptx()]),
        seeds("xyz", [written("xyz")?, vec![rows.clone().into_bytes()]].concat()),
        seeds("pts", [written("pts")?, vec![format!("{POINTS}\n{rows}").into_bytes()]].concat()),
        seeds("csv", [written("csv")?, vec![odd_csv(), grouped_csv()]].concat()),
        seeds("xyz.gz", vec![gzip(rows.as_bytes())?, [gzip(rows.as_bytes())?, gzip(rows.as_bytes())?].concat()]),
        seeds("las.gz", las(false)?.iter().map(|file| gzip(file)).collect::<Result<_>>()?),
        seeds("grd", vec![grid()]),
        seeds("obj", vec![format!("# a\ng b\n{vertices}{}", faces("f", 1)).into_bytes(), odd_obj()]),
        seeds("off", vec![format!("OFF\n{POINTS} {} 0\n{positions}{}", POINTS - 2, faces("3", 0)).into_bytes()]),
        seeds("stl", vec![binary_stl(), text_stl()]),
        seeds("glb", vec![glb()]),
        seeds("gltf", vec![gltf()]),
        seeds("bin", vec![sweep(4)]),
        seeds("pcd.bin", vec![sweep(5)]),
        seeds("pgm", vec![pgm(), b"P2\n# a\n3 2\n65535\n0 1000 2000\n3000 65535 7\n".to_vec()]),
        seeds("png", vec![png()?]),
        seeds("pfm", vec![pfm()]),
        seeds("tif", vec![tiff()]),
        seeds("exr", vec![exr()?]),
        seeds("mcap", recordings("zstd", mcap)),
        seeds("bag", recordings("bz2", bag)),
        seeds("ros1", vec![cloud2().message(Encoding::Ros1, false)]),
        seeds("cdr", vec![cloud2().message(Encoding::Cdr, false), cloud2().message(Encoding::Cdr, true)]),
    ])
}

/// Adds the files of a folder and its subfolders to the seeds of the formats that their extensions name. Returns the
/// number of added files.
pub(crate) fn add_corpus(seeds: &mut [Seeds], folder: &Path) -> Result<usize> {
    let mut added = 0;
    let mut entries: Vec<_> = std::fs::read_dir(folder)
        .with_context(|| format!("corpus {}", folder.display()))?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<std::io::Result<_>>()?;
    entries.sort();
    for path in entries {
        if path.is_dir() {
            added += add_corpus(seeds, &path)?;
            continue;
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let ends = |seeds: &&mut Seeds| name.strip_suffix(seeds.extension).is_some_and(|stem| stem.ends_with('.'));
        // The longest extension counts: .pcd.bin is not .bin.
        let of = seeds.iter_mut().filter(|seeds| ends(seeds)).max_by_key(|seeds| seeds.extension.len());
        if let Some(seeds) = of
            && path.metadata()?.len() <= MAX_SEED
        {
            seeds.files.push(std::fs::read(&path)?);
            added += 1;
        }
    }
    Ok(added)
}

/// Files that the project writes: bare points, points with colours and fields, and scans far from the origin.
fn written(extension: &str) -> Result<Vec<Vec<u8>>> {
    let bare = PointCloud::new(DVec3::ZERO, (0..POINTS).map(|i| [i as f32, (i * i % 7) as f32, 0.5]).collect());
    let byte = |i: usize| i as u8;
    let colored = bare.clone().with_colors((0..POINTS).map(|i| [byte(i), 255, byte(i * i)]).collect())?;
    let rich = colored
        .with_field("Intensity", FieldValues::U16((0..POINTS).map(|i| (i * 1000) as u16).collect()))?
        .with_field("Classification", FieldValues::U8((0..POINTS).map(|i| byte(i % 6)).collect()))?
        .with_field("GpsTime", FieldValues::F64((0..POINTS).map(|i| 1e5 + i as f64).collect()))?
        .with_field("odd name", FieldValues::F32((0..POINTS).map(|i| i as f32 - 3.5).collect()))?;
    let far = PointCloud::new(DVec3::new(5e5, 5e6, 300.0), bare.positions().to_vec()).with_scans(vec![Scan {
        name: Some("a".into()),
        world_from_sensor: DMat4::from_rotation_translation(DQuat::from_rotation_z(0.5), DVec3::new(5e5, 5e6, 300.0)),
        points: 2..POINTS - 2,
    }]);
    let folder = tempfile::tempdir()?;
    let path = folder.path().join(format!("a.{extension}"));
    [bare, rich, far].iter().map(|cloud| file(cloud, &path)).collect()
}

fn file(cloud: &PointCloud, path: &Path) -> Result<Vec<u8>> {
    write(cloud, path, &()).with_context(|| format!("seed {}", path.display()))?;
    Ok(std::fs::read(path)?)
}

fn gzip(bytes: &[u8]) -> Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes)?;
    Ok(encoder.finish()?)
}

fn ascii_ply() -> Vec<u8> {
    b"ply\r\nformat ascii 1.0\r\ncomment a\r\nelement vertex 3\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n\
      property list uchar int ids\r\nelement face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n\
      0 0 0 0\r\n1 0 0 2 7 8\r\n0 1 0 1 9\r\n3 0 1 2\r\n"
        .to_vec()
}

fn list_ply() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement face 2\nproperty list uchar int vertex_indices\n\
                      element vertex 3\nproperty list uint uchar ids\nproperty double x\nproperty float y\n\
                      property short z\nproperty ushort red\nproperty ushort green\nproperty ushort blue\nend_header\n"
        .to_vec();
    for face in [[0_i32, 1, 2], [2, 1, 0]] {
        bytes.push(3);
        bytes.extend(face.map(i32::to_be_bytes).as_flattened());
    }
    for i in 0..3_u16 {
        bytes.extend([0, 0, 0, 1, 7]);
        bytes.extend(f64::from(i).to_be_bytes());
        bytes.extend(0.5_f32.to_be_bytes());
        bytes.extend([i, 300 * i, 40000, 7].map(u16::to_be_bytes).as_flattened());
    }
    bytes
}

fn ascii_pcd() -> Vec<u8> {
    b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb label\nSIZE 4 4 4 4 2\nTYPE F F F F U\nCOUNT 1 1 1 1 1\nWIDTH 2\n\
      HEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA ascii\n1 2 3 4.2e-38 1\nnan nan nan 0 2\n0 0 0 0 3\n4 5 6 255 4\n"
        .to_vec()
}

/// A compressed PCD file of literal runs, as a compressor writes that finds no repetition.
fn compressed_pcd() -> Vec<u8> {
    let mut bytes = b"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 8\nHEIGHT 1\n\
                      VIEWPOINT 1 2 3 1 0 0 0\nPOINTS 8\nDATA binary_compressed\n"
        .to_vec();
    let plain: Vec<u8> = (0..24).flat_map(|i| (i as f32).to_le_bytes()).collect();
    let mut compressed = Vec::new();
    for run in plain.chunks(32) {
        compressed.push(run.len() as u8 - 1);
        compressed.extend(run);
    }
    bytes.extend((compressed.len() as u32).to_le_bytes());
    bytes.extend((plain.len() as u32).to_le_bytes());
    bytes.extend(compressed);
    bytes
}

fn mesh_ply() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                      property float z\nelement face 2\nproperty list uchar int vertex_indices\nelement tristrips 1\n\
                      property list int int vertex_indices\nend_header\n"
        .to_vec();
    bytes.extend((0..12).flat_map(|i| (i as f32).to_le_bytes()));
    for face in [[0_i32, 1, 2], [2, 1, 3]] {
        bytes.push(3);
        bytes.extend(face.map(i32::to_le_bytes).as_flattened());
    }
    bytes.extend(7_i32.to_le_bytes());
    bytes.extend([0, 1, 2, -1, 1, 2, 3].map(i32::to_le_bytes).as_flattened());
    bytes
}

/// A LAS or LAZ file per point format, two of three with extra bytes. LAZ lacks the formats with waveforms.
fn las(compressed: bool) -> Result<Vec<Vec<u8>>> {
    let one = |format: u8| {
        let mut builder = las::Builder::from(if format < 6 { (1, 3) } else { (1, 4) });
        builder.point_format = las::point::Format::new(format)?;
        builder.point_format.is_compressed = compressed;
        builder.point_format.extra_bytes = u16::from(format % 3);
        let format = builder.point_format;
        let mut writer = las::Writer::new(std::io::Cursor::new(Vec::new()), builder.into_header()?)?;
        for i in 0..POINTS as u16 {
            writer.write_point(las::Point {
                x: f64::from(i) * 0.5,
                y: f64::from(i * i % 7),
                intensity: i,
                return_number: 1,
                number_of_returns: 2,
                gps_time: format.has_gps_time.then(|| f64::from(i)),
                color: format.has_color.then(|| las::Color::new(i, 300, 7)),
                nir: format.has_nir.then_some(i),
                waveform: format.has_waveform.then(Default::default),
                extra_bytes: vec![1; usize::from(format.extra_bytes)],
                ..Default::default()
            })?;
        }
        writer.close()?;
        Ok(writer.into_inner()?.into_inner())
    };
    (0..=10).filter(|format| !compressed || ![4, 5, 9, 10].contains(format)).map(one).collect()
}

/// The files of EPTs of one node, one EPT per type of node.
fn epts() -> Result<Vec<Vec<u8>>> {
    let mut nodes = trees::nodes(POINTS);
    nodes.retain(|key, _| key.level == 0);
    let one = |(kind, extension)| {
        let folder = tempfile::tempdir()?;
        trees::write_ept(folder.path(), &nodes, kind);
        let names = ["ept.json", "ept-hierarchy/0-0-0-0.json", &format!("ept-data/0-0-0-0.{extension}")];
        let files = names.map(|name| std::fs::read(folder.path().join(name)));
        Ok(files.into_iter().collect::<std::io::Result<Vec<_>>>()?.join(BETWEEN))
    };
    [("laszip", "laz"), ("binary", "bin"), ("zstandard", "zst")].into_iter().map(one).collect()
}

/// The files of octrees of Potree of one node, plain and compressed.
fn potrees() -> Result<Vec<Vec<u8>>> {
    let mut nodes = trees::nodes(POINTS);
    nodes.retain(|key, _| key.level == 0);
    let one = |encoding| {
        let folder = tempfile::tempdir()?;
        trees::write_potree(folder.path(), &nodes, encoding);
        let files =
            ["metadata.json", "hierarchy.bin", "octree.bin"].map(|name| std::fs::read(folder.path().join(name)));
        Ok(files.into_iter().collect::<std::io::Result<Vec<_>>>()?.join(BETWEEN))
    };
    ["DEFAULT", "BROTLI"].into_iter().map(one).collect()
}

fn ptx() -> Vec<u8> {
    b"2\n2\n10 20 30\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n10 20 30 1\n1 2 3 0.5\n0 0 0 0.5\n4 5 6 0.25\n\
      7 8 9 1\n1\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0.5 255 0 7\n4 5 6 0.5 1 2 3\n"
        .to_vec()
}

/// Words before and after the points, names in German, thousands, and a row without coordinates.
fn grouped_csv() -> Vec<u8> {
    let rows: String = (0..POINTS).map(|i| format!("P{i};5.401.233,{i};\"3 512 344,5\";{i},25\n")).collect();
    format!("Project: a\nPunkt;Hochwert;Rechtswert;Höhe\n-;;NULL;N/A\n{rows}END\n").into_bytes()
}

/// A grid of heights with cells without data, whose rows wrap.
fn grid() -> Vec<u8> {
    let heights: String = (0..POINTS).map(|i| if i % 5 == 0 { "-9999\n".into() } else { format!("{i}.5 ") }).collect();
    format!("ncols 6\nnrows 4\nXLLCENTER 10,5\nyllcorner 20\ndx 1\ndy 2\n{heights}").into_bytes()
}

fn odd_csv() -> Vec<u8> {
    "\u{feff}\"Easting [m]\";\"Northing\";\"Height\";\"R\";\"G\";\"B\"\r\n1,5;2,5;3,5;1;2;3\r\n4;5;6,25;;255;7;\r\n"
        .into()
}

fn odd_obj() -> Vec<u8> {
    b"v 1 2 3 0.5 0.5 1\r\nv 4 5 \\\n6 1 0 0\nv 7 8 9 0 1 0\nvt 0 0\nvn 0 0 1\nf -1/1/1 -2//1 -3/1\nf 1 2\nl 1 2\n"
        .to_vec()
}

fn binary_stl() -> Vec<u8> {
    let mut bytes = [&[b' '; 80][..], &4_u32.to_le_bytes()].concat();
    for facet in 0..4 {
        bytes.extend((0..12).flat_map(|i| ((facet + i) as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn text_stl() -> Vec<u8> {
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    format!("solid a\n{}endsolid a\n", facet.repeat(3)).into_bytes()
}

/// The JSON of a glTF triangle with colours, indices and sparse positions. `buffer` is the start of its buffer object.
fn scene(buffer: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"children":[1],"translation":[1,2,3]}},{{"mesh":0,"scale":[1,2,3]}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"COLOR_0":2}},"indices":1,"mode":4}}]}}],"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","sparse":{{"count":1,"indices":{{"bufferView":1,"componentType":5123}},"values":{{"bufferView":0}}}}}},{{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}},{{"bufferView":2,"componentType":5121,"normalized":true,"count":3,"type":"VEC4"}}],"bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":6}},{{"buffer":0,"byteOffset":44,"byteLength":12}}],"buffers":[{{{buffer}"byteLength":56}}]}}"#
    )
}

fn scene_bytes() -> Vec<u8> {
    let mut bytes: Vec<u8> = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes).concat();
    bytes.extend([0_u16, 1, 2, 0].map(u16::to_le_bytes).as_flattened());
    bytes.extend([255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 128]);
    bytes
}

fn glb() -> Vec<u8> {
    let mut json = scene("").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let data = scene_bytes();
    let len = |len: usize| (len as u32).to_le_bytes();
    [
        &b"glTF\x02\0\0\0"[..],
        &len(28 + json.len() + data.len()),
        &len(json.len()),
        b"JSON",
        &json,
        &len(data.len()),
        b"BIN\0",
        &data,
    ]
    .concat()
}

fn gltf() -> Vec<u8> {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for bytes in scene_bytes().chunks(3) {
        let bits = bytes.iter().enumerate().fold(0, |bits, (at, &byte)| bits | u32::from(byte) << (16 - 8 * at));
        for digit in 0..4 {
            let value = (bits >> (18 - 6 * digit) & 63) as usize;
            text.push(if digit <= bytes.len() { char::from(DIGITS[value]) } else { '=' });
        }
    }
    scene(&format!("\"uri\":\"data:application/octet-stream;base64,{text}\",")).into_bytes()
}

fn pgm() -> Vec<u8> {
    let values = (0..24_u16).flat_map(|i| (i * 500).to_be_bytes());
    b"P5\n6 4\n65535\n".iter().copied().chain(values).collect()
}

fn png() -> Result<Vec<u8>> {
    let depths = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(6, 4, |x, y| image::Luma([(x * y * 500) as u16]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    depths.write_to(&mut bytes, image::ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

/// Depths in metres of an image of 6 × 4 pixels, little-endian.
fn float_depths() -> Vec<u8> {
    (0..24).flat_map(|i| (0.25 * i as f32).to_le_bytes()).collect()
}

fn pfm() -> Vec<u8> {
    [b"Pf\n6 4\n-1.0\n".to_vec(), float_depths()].concat()
}

/// One strip of floats.
fn tiff() -> Vec<u8> {
    let (short, long) = (3_u16, 4_u16);
    // Size, bits, no compression, black is 0, the strip's place, channels, rows and bytes, floats.
    let entries = [
        (256_u16, short, 6_u32),
        (257, short, 4),
        (258, short, 32),
        (259, short, 1),
        (262, short, 1),
        (273, long, 134),
        (277, short, 1),
        (278, short, 4),
        (279, long, 96),
        (339, short, 3),
    ];
    let mut bytes = [b"II*\0".to_vec(), 8_u32.to_le_bytes().to_vec(), 10_u16.to_le_bytes().to_vec()].concat();
    for (tag, kind, value) in entries {
        bytes.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
        bytes.extend([1, value].map(u32::to_le_bytes).concat());
    }
    [bytes, vec![0; 4], float_depths()].concat()
}

fn exr() -> Result<Vec<u8>> {
    use exr::prelude::{Encoding, Image, SpecificChannels, WritableImage as _};
    let depth = |at: exr::prelude::Vec2<usize>| ((at.x() + at.y()) as f32,);
    let channels = SpecificChannels::build().with_channel::<f32>("Z").with_pixel_fn(depth);
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = Image::from_encoded_channels((6, 4), Encoding::SMALL_LOSSLESS, channels);
    image.write().non_parallel().to_buffered(&mut bytes)?;
    Ok(bytes.into_inner())
}

/// A `PointCloud2` message with intensities, colours, a field of two values and times.
fn cloud2() -> Cloud2 {
    let positions: Vec<[f32; 3]> = (0..POINTS).map(|i| [i as f32, (i * i % 7) as f32, 0.5]).collect();
    let mut message = Cloud2::xyz(&positions, 32);
    message.fields.extend([("intensity", 12, F32, 1), ("rgb", 16, F32, 1), ("pair", 20, 4, 2), ("t", 24, 8, 1)]);
    message
}

/// Recordings of two topics of points and one of transforms, for each compression, with and without an index.
fn recordings(compressed: &'static str, write: fn(&[Topic], &[Message], Style) -> Vec<u8>) -> Vec<Vec<u8>> {
    let encoding = Encoding::Ros1;
    let topics: [Topic; 3] = [("/a", CLOUDS, encoding), ("/b", CLOUDS, encoding), ("/tf", TRANSFORMS, encoding)];
    let turn = [0.0, 0.0, 0.6, 0.8];
    let pose = |stamp| transforms(encoding, &[(stamp, "map", "lidar", [1.0, 2.0, 3.0], turn)]);
    let cloud = cloud2().message(encoding, false);
    let messages: [Message; 5] =
        [(2, 1, pose(1)), (0, 2, cloud.clone()), (1, 3, cloud.clone()), (2, 4, pose(4)), (0, 5, cloud)];
    let styles = ["none", "lz4", compressed].into_iter().flat_map(|compression| {
        [true, false].map(|indexed| Style { indexed, closed: indexed, ..Style::of(compression) })
    });
    styles.map(|style| write(&topics, &messages, style)).collect()
}
