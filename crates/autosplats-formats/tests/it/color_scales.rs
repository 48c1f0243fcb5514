//! The scale of colours in LAS and glTF; that of other formats is tested with their other oddities.

use crate::common::{colors, las_bytes, positions};
use crate::oddities::load;

/// A LAS file of format 2 with these colours, also as LAZ.
fn las_files(colors: &[[u16; 3]]) -> [Vec<u8>; 2] {
    let mut bytes = las_bytes((1, 2), 2, false, colors.len());
    let start = bytes.len() - 26 * colors.len();
    for (record, color) in bytes[start..].chunks_exact_mut(26).zip(colors) {
        let color: Vec<u8> = color.iter().flat_map(|channel| channel.to_le_bytes()).collect();
        record[20..].copy_from_slice(&color);
    }
    let mut reader = las::Reader::new(std::io::Cursor::new(bytes.clone())).unwrap();
    let mut header = las::Builder::from(reader.header().clone());
    header.point_format.is_compressed = true;
    let mut writer = las::Writer::new(std::io::Cursor::new(Vec::new()), header.into_header().unwrap()).unwrap();
    writer.write_points(&reader.read_all().unwrap()).unwrap();
    writer.close().unwrap();
    [bytes, writer.into_inner().unwrap().into_inner()]
}

#[test]
fn colors_of_las_have_the_scale_of_nearly_all() {
    let count = 120_000;
    let narrow: Vec<[u16; 3]> = colors(count).iter().map(|color| color.map(u16::from)).collect();
    let wide: Vec<[u16; 3]> = colors(count).iter().map(|color| color.map(|channel| u16::from(channel) * 257)).collect();
    let eight = |i: usize| colors(count)[i];
    // At the start, in the middle and at the end; many more in a row; and wide colours after dark ones.
    let mut bright = narrow.clone();
    for i in [3, 70_000, count - 1] {
        bright[i] = [300, 40, 50];
    }
    let mut row = narrow.clone();
    row[60_000..63_000].fill([65535, 300, 20]);
    let mut dark = wide.clone();
    dark[..50_000].fill([9, 0, 255]);
    dark[4] = [512, 1, 2];
    for (what, given, told, check) in [
        ("8 bits", &narrow, "no colour value exceeds 255", [eight(3), eight(4), eight(60_000)]),
        ("16 bits", &wide, "", [eight(3), eight(4), eight(60_000)]),
        ("three bright", &bright, "3 of ", [[255, 40, 50], eight(4), eight(60_000)]),
        ("bright in a row", &row, "6000 of ", [eight(3), eight(4), [255, 255, 20]]),
        ("dark before", &dark, "", [[0, 0, 0], [2, 0, 0], eight(60_000)]),
    ] {
        for (name, bytes) in ["a.las", "a.laz"].iter().zip(las_files(given)) {
            let (cloud, notes) = load(name, &bytes);
            let found = [3, 4, 60_000].map(|i| cloud.colors().unwrap()[i]);
            assert_eq!(found, check, "{name}, {what}: {notes}");
            assert!(notes.contains(told) && (notes.is_empty() || !told.is_empty()), "{name}, {what}: {notes}");
        }
    }
}

#[test]
fn colors_of_gltf_may_be_bytes_without_saying_so() {
    let glb = |component: u32, colors: &[u8], normalized: bool| {
        let mut buffer: Vec<u8> = positions(2).into_iter().flatten().flat_map(f32::to_le_bytes).collect();
        buffer.extend(colors);
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{len}}}],
            "bufferViews":[{{"buffer":0,"byteLength":24}},{{"buffer":0,"byteOffset":24,"byteLength":{more}}}],
            "accessors":[{{"componentType":5126,"type":"VEC3","count":2,"bufferView":0}},
            {{"componentType":{component},"type":"VEC4","count":2,"bufferView":1,"normalized":{normalized}}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"COLOR_0":1}},"mode":0}}]}}],
            "nodes":[{{"mesh":0}}],"scenes":[{{"nodes":[0]}}],"scene":0}}"#,
            len = buffer.len(),
            more = colors.len(),
        );
        let mut json = json.into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let chunk = |kind: &[u8; 4], data: &[u8]| [&(data.len() as u32).to_le_bytes()[..], kind, data].concat();
        let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &buffer)].concat();
        [b"glTF\x02\0\0\0".as_slice(), &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
    };
    let bytes = [10, 100, 200, 255, 255, 0, 50, 255];
    let wide: Vec<u8> = bytes.iter().flat_map(|&byte: &u8| (u16::from(byte) * 257).to_le_bytes()).collect();
    let floats: Vec<u8> = bytes.iter().flat_map(|&byte| f32::from(byte).to_le_bytes()).collect();
    let (expected, notes) = load("a.glb", &glb(5121, &bytes, true));
    assert_eq!(notes, "", "as the format asks");
    for (component, colors) in [(5121, bytes.as_slice()), (5123, &wide), (5126, &floats)] {
        let (cloud, notes) = load("a.glb", &glb(component, colors, false));
        assert_eq!(cloud.colors(), expected.colors(), "{component}");
        assert!(notes.contains("not in 0 to 1"), "{component}: {notes}");
    }
}
