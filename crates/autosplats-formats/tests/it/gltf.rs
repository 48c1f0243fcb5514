//! Hand-made glTF files of every kind.

use std::{path::Path, sync::Mutex};

use crate::common::{error, read_bytes};
use autosplats_cloud::{Axes, Contents, Progress, Unit, glam::DVec3};
use autosplats_formats::{ReadOptions, describe, read, read_mesh};

#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Progress for Notes {
    fn report(&self, _fraction: f32) {}
    fn note(&self, note: &str) {
        self.0.lock().unwrap().push(note.into());
    }
}

/// The square and the point above it.
const FIVE: [[f32; 3]; 5] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 1.0]];

/// Builds a glTF piece by piece: one buffer, with a view and an accessor for each array.
#[derive(Default)]
struct Builder {
    buffer: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Builder {
    fn view(&mut self, bytes: &[u8], more: &str) -> usize {
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        let (offset, len) = (self.buffer.len(), bytes.len());
        self.buffer.extend(bytes);
        self.views.push(format!("{{\"buffer\":0,\"byteOffset\":{offset},\"byteLength\":{len}{more}}}"));
        self.views.len() - 1
    }

    fn accessor(&mut self, kind: u32, shape: &str, count: usize, more: &str) -> usize {
        self.accessors.push(format!("{{\"componentType\":{kind},\"type\":\"{shape}\",\"count\":{count}{more}}}"));
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        let view = self.view(&bytes, "");
        self.accessor(5126, ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1], values.len(), &format!(",\"bufferView\":{view}"))
    }

    fn bytes(&mut self, kind: u32, shape: &str, count: usize, bytes: &[u8], more: &str) -> usize {
        let view = self.view(bytes, "");
        self.accessor(kind, shape, count, &format!(",\"bufferView\":{view}{more}"))
    }

    fn json(&self, uri: &str, rest: &str) -> String {
        format!(
            "{{\"asset\":{{\"version\":\"2.0\"}},\"buffers\":[{{{uri}\"byteLength\":{}}}],\"bufferViews\":[{}],\
             \"accessors\":[{}],{rest}}}",
            self.buffer.len(),
            self.views.join(","),
            self.accessors.join(",")
        )
    }

    fn glb(&self, rest: &str) -> Vec<u8> {
        glb(&self.json("", rest), &self.buffer)
    }
}

fn glb(json: &str, buffer: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut buffer = buffer.to_vec();
    buffer.resize(buffer.len().next_multiple_of(4), 0);
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + buffer.len() as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend((buffer.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(buffer);
    bytes
}

fn mesh_at(path: &Path) -> (Contents, String) {
    let notes = Notes::default();
    let mesh = read_mesh(path, &ReadOptions::default(), &notes).unwrap_or_else(|error| panic!("{error}"));
    let points = read(path, &()).unwrap();
    assert!(points == mesh.cloud, "the points do not depend on the triangles");
    (mesh, notes.0.into_inner().unwrap().join("\n"))
}

fn mesh(name: &str, bytes: &[u8]) -> (Contents, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    mesh_at(&path)
}

/// One mesh with one primitive, without a transform.
fn one(attributes: &str, more: &str) -> String {
    format!(
        "\"scene\":0,\"scenes\":[{{\"nodes\":[0]}}],\"nodes\":[{{\"mesh\":0}}],\
         \"meshes\":[{{\"primitives\":[{{\"attributes\":{{{attributes}}}{more}}}]}}]"
    )
}

#[test]
fn primitives_of_every_mode() {
    for (kind, width) in [(5121, 1), (5123, 2), (5125, 4)] {
        let mut builder = Builder::default();
        let position = builder.floats(&FIVE);
        let mut indices = |list: &[u32]| {
            let raw: Vec<u8> = list.iter().flat_map(|index| index.to_le_bytes()[..width].to_vec()).collect();
            builder.bytes(kind, "SCALAR", list.len(), &raw, "")
        };
        let list = indices(&[0, 1, 2, 0, 2, 3, 0, 1, 5, 9]);
        let strip = indices(&[3, 0, 2, 1, 1, 4]);
        let fan = indices(&[0, 1, 2, 3]);
        let read = |more: &str| mesh("a.glb", &builder.glb(&one(&format!("\"POSITION\":{position}"), more)));
        let indexed = |mode: u32, accessor: usize| read(&format!(",\"mode\":{mode},\"indices\":{accessor}"));
        let (listed, notes) = indexed(4, list);
        assert_eq!(listed.cloud.positions(), FIVE, "positions");
        assert_eq!(listed.triangles, [[0, 1, 2], [0, 2, 3]], "a list");
        assert!(notes.contains("1 faces have corners"), "{notes}");
        assert_eq!(indexed(5, strip).0.triangles, [[3, 0, 2], [2, 0, 1]], "a strip");
        assert_eq!(indexed(6, fan).0.triangles, [[0, 1, 2], [0, 2, 3]], "a fan");
        assert_eq!(read("").0.triangles, [[0, 1, 2]], "without indices: whole triangles of the points");
        assert_eq!(read(",\"mode\":5").0.triangles, [[0, 1, 2], [2, 1, 3], [2, 3, 4]], "a strip without");
        let points = read(",\"mode\":0").0;
        assert_eq!((points.cloud.len(), points.triangles.len()), (5, 0), "points");
        let (lines, notes) = read(",\"mode\":1");
        assert!(lines.cloud.is_empty() && notes.contains("1 primitives are lines"), "{notes}");
        let signed = read_bytes("a.glb", &builder.glb(&one("\"POSITION\":0", ""))).unwrap();
        assert_eq!((signed.axes(), signed.crs().unit), (Some(Axes::YUp), Some(Unit::Metre)), "what glTF says");
    }
}

#[test]
fn colours_become_srgb() {
    let mut builder = Builder::default();
    let position = builder.floats(&FIVE[..2]);
    // Linear 1, 0.5, 0 and 0.2140, 0.0021, 1, and their sRGB values by the formula of the standard.
    let expected = [[255, 188, 0], [127, 7, 255]];
    let linear = [[1.0_f32, 0.5, 0.0], [0.214, 0.0021, 1.0]];
    let scaled = |largest: f32| linear.as_flattened().iter().map(move |value| (value * largest).round());
    let floats = builder.floats(&linear);
    let wide: Vec<u8> = scaled(65535.0).flat_map(|value| (value as u16).to_le_bytes()).collect();
    let wide = builder.bytes(5123, "VEC3", 2, &wide, ",\"normalized\":true");
    let alpha: Vec<u8> = scaled(255.0).map(|value| value as u8).collect();
    let alpha = [&alpha[..3], &[9], &alpha[3..], &[9]].concat();
    let narrow = builder.bytes(5121, "VEC4", 2, &alpha, ",\"normalized\":true");
    for (accessor, tolerance) in [(floats, 0), (wide, 0), (narrow, 6)] {
        let attributes = format!("\"POSITION\":{position},\"COLOR_0\":{accessor}");
        let bytes = builder.glb(&one(&attributes, ",\"mode\":0"));
        let cloud = read_bytes("a.glb", &bytes).unwrap();
        for (found, expected) in cloud.colors().unwrap().as_flattened().iter().zip(expected.as_flattened()) {
            assert!(found.abs_diff(*expected) <= tolerance, "{found} is not {expected}");
        }
    }
    let material = ",\"material\":0}]}],\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorFactor\":[1,0.5,0,1]}}],\
                    \"x\":[{\"y\":[{\"z\":0";
    let cloud = read_bytes("a.glb", &builder.glb(&one(&format!("\"POSITION\":{position}"), material))).unwrap();
    assert_eq!(cloud.colors().unwrap(), [[255, 188, 0]; 2], "the material's colour");
}

#[test]
fn nodes_place_their_meshes() {
    let mut builder = Builder::default();
    let position = builder.floats(&FIVE);
    let normal = builder.floats(&[[0.0, 0.6, 0.8]; 5]);
    let meshes = format!(
        "\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":{position},\"NORMAL\":{normal}}},\"mode\":6}}]}}]"
    );
    // Scaled by 2 in y, rotated by 90° about z, and moved. Its child is mirrored by a matrix.
    let nodes = "\"nodes\":[{\"children\":[1]},\
        {\"mesh\":0,\"translation\":[500000,20,30],\"rotation\":[0,0,0.7071067811865476,0.7071067811865476],\
         \"scale\":[1,2,1],\"children\":[2]},\
        {\"mesh\":0,\"matrix\":[-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]},{\"mesh\":0}]";
    let file = |scene: &str| mesh("a.glb", &builder.glb(&format!("{scene}{nodes},{meshes}"))).0;
    let both = file("\"scene\":0,\"scenes\":[{\"nodes\":[0]},{\"nodes\":[3]}],");
    assert_eq!((both.cloud.len(), both.triangles.len()), (10, 6), "two places");
    for (i, [x, y, z]) in FIVE.into_iter().map(|position| position.map(f64::from)).enumerate() {
        for (index, x) in [(i, x), (i + 5, -x)] {
            let expected = DVec3::new(500_000.0 - 2.0 * y, 20.0 + x, 30.0 + z);
            let error = (both.cloud.world_position(index) - expected).abs().max_element();
            assert!(error < 1e-6, "point {index}: off by {error}");
        }
    }
    assert_eq!(both.triangles[..2], [[0, 1, 2], [0, 2, 3]], "as in the file");
    assert_eq!(both.triangles[3..5], [[5, 7, 6], [5, 8, 7]], "mirrored, so turned round");
    let component = |name: &str| both.cloud.field(name).unwrap().values.get(7);
    // (0, 0.6, 0.8) with y halved is (0, 0.3, 0.8), then rotated.
    let length = 0.3_f64.hypot(0.8);
    let expected = [-0.3 / length, 0.0, 0.8 / length];
    for (name, expected) in ["NormalX", "NormalY", "NormalZ"].into_iter().zip(expected) {
        assert!((component(name) - expected).abs() < 1e-6, "{name} is {}, not {expected}", component(name));
    }
    assert_eq!(file("\"scenes\":[{\"nodes\":[0]},{\"nodes\":[3,0]}],").cloud.len(), 15, "all scenes, each node once");
    assert_eq!(file("").cloud.len(), 15, "without scenes all that are nobody's children");
    let description = {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        let scene = "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],";
        std::fs::write(&path, builder.glb(&format!("{scene}{nodes},{meshes}"))).unwrap();
        describe(&path, &ReadOptions::default()).unwrap()
    };
    assert_eq!((description.points, description.faces), (Some(10), Some(6)), "counted without reading");
    assert_eq!(description.format, "glTF 2.0, binary", "named");
    assert_eq!(description.attributes.len(), 2, "position and normal");
    assert_eq!(description.attributes[0].stored, "float32 × 3", "with their types");
}

#[test]
fn quantized_sparse_and_strided_values() {
    let mut builder = Builder::default();
    let i16s: Vec<u8> = [0_i16, 32767, -32768, 16384, 0, 0].iter().flat_map(|value| value.to_le_bytes()).collect();
    let normalized = builder.bytes(5122, "VEC3", 2, &i16s, ",\"normalized\":true");
    let plain = builder.bytes(5122, "VEC3", 2, &i16s, "");
    let u8s = builder.bytes(5121, "VEC3", 2, &[0, 1, 2, 253, 254, 255], "");
    // Every second vector of a view with steps of 24 bytes, from its second number on.
    let strided: Vec<u8> = (0..24_u8).flat_map(|i| f32::from(i).to_le_bytes()).collect();
    let view = builder.view(&strided, ",\"byteStride\":24");
    let strided = builder.accessor(5126, "VEC3", 4, &format!(",\"bufferView\":{view},\"byteOffset\":4"));
    let indices = builder.view(&[1, 3], "");
    let values = builder.view(&[7_f32, 8.0, 9.0, -7.0, -8.0, -9.0].map(f32::to_le_bytes).concat(), "");
    let sparse = format!(
        ",\"sparse\":{{\"count\":2,\"indices\":{{\"bufferView\":{indices},\"componentType\":5121}},\
         \"values\":{{\"bufferView\":{values}}}}}"
    );
    let zeros = builder.accessor(5126, "VEC3", 4, &sparse);
    let patched = builder.accessor(5126, "VEC3", 4, &format!(",\"bufferView\":{view}{sparse}"));
    let positions = |accessor: usize| {
        let bytes = builder.glb(&one(&format!("\"POSITION\":{accessor}"), ",\"mode\":0"));
        let cloud = read_bytes("a.glb", &bytes).unwrap();
        (0..cloud.len()).map(|i| cloud.world_position(i).as_vec3().to_array()).collect::<Vec<_>>()
    };
    assert_eq!(positions(normalized), [[0.0, 1.0, -1.0], [16384.0 / 32767.0, 0.0, 0.0]], "of -1 to 1");
    assert_eq!(positions(plain), [[0.0, 32767.0, -32768.0], [16384.0, 0.0, 0.0]], "as they are");
    assert_eq!(positions(u8s), [[0.0, 1.0, 2.0], [253.0, 254.0, 255.0]], "bytes");
    assert_eq!(
        positions(strided),
        [[1.0, 2.0, 3.0], [7.0, 8.0, 9.0], [13.0, 14.0, 15.0], [19.0, 20.0, 21.0]],
        "strided"
    );
    assert_eq!(positions(zeros), [[0.0; 3], [7.0, 8.0, 9.0], [0.0; 3], [-7.0, -8.0, -9.0]], "zeros, but for two");
    assert_eq!(
        positions(patched),
        [[0.0, 1.0, 2.0], [7.0, 8.0, 9.0], [12.0, 13.0, 14.0], [-7.0, -8.0, -9.0]],
        "patched"
    );
}

#[test]
fn buffers_in_the_text_and_beside_it() {
    let mut builder = Builder::default();
    let position = builder.floats(&FIVE);
    let rest = one(&format!("\"POSITION\":{position}"), ",\"mode\":0");
    use base64::Engine as _;
    let encoded = base64::engine::general_purpose::STANDARD.encode(&builder.buffer);
    for encoded in [encoded.as_str(), encoded.trim_end_matches('=')] {
        let uri = format!("\"uri\":\"data:application/octet-stream;base64,{encoded}\",");
        let cloud = mesh("a.gltf", builder.json(&uri, &rest).as_bytes()).0.cloud;
        assert_eq!(cloud.positions(), FIVE, "base64");
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    std::fs::write(folder.path().join("outside.bin"), &builder.buffer).unwrap();
    std::fs::write(folder.path().join("sub/two words.bin"), &builder.buffer).unwrap();
    let read_with = |name: &str, uri: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, builder.json(&format!("\"uri\":\"{uri}\","), &rest)).unwrap();
        read(&path, &()).map(|cloud| cloud.positions().to_vec()).map_err(|error| error.to_string())
    };
    assert_eq!(read_with("a.gltf", "sub/two%20words.bin").unwrap(), FIVE, "a file in a folder below");
    assert_eq!(read_with("a.gltf", "./outside.bin").unwrap(), FIVE, "a file beside it");
    let absolute = folder.path().join("outside.bin");
    let outside = [
        "../outside.bin",
        "%2e%2e/outside.bin",
        "x/../../outside.bin",
        absolute.to_str().unwrap(),
        "file:///etc/passwd",
        "http://example.org/a.bin",
        "..\\\\outside.bin",
        "",
    ];
    for uri in outside {
        let message = read_with("sub/a.gltf", uri).unwrap_err();
        assert!(message.contains("buffer 0") && message.contains("only files beside this one"), "{uri}: {message}");
    }
    assert!(read_with("a.gltf", "sub").unwrap_err().contains("is not a file"), "a folder");
    assert!(read_with("a.gltf", "missing.bin").unwrap_err().contains("missing.bin"), "the missing file is named");
    std::fs::write(folder.path().join("short.bin"), &builder.buffer[..20]).unwrap();
    assert!(read_with("a.gltf", "short.bin").unwrap_err().contains("buffer 0: it has 20 of 60 bytes"), "cut off");
    let broken = builder.json("\"uri\":\"data:;base64,!!!\",", &rest);
    assert!(error("a.gltf", broken.as_bytes()).contains("not base64"), "broken base64");
}

#[test]
fn compressed_meshes_are_told() {
    let mut builder = Builder::default();
    builder.floats(&FIVE);
    let zeros = builder.accessor(5126, "VEC3", 5, "");
    let draco = ",\"extensions\":{\"KHR_draco_mesh_compression\":{\"bufferView\":0,\"attributes\":{\"POSITION\":0}}}";
    let message = error("a.glb", &builder.glb(&one(&format!("\"POSITION\":{zeros}"), draco)));
    assert!(message.contains("Draco") && message.contains("without compression"), "{message}");
    let fallback = read_bytes("a.glb", &builder.glb(&one("\"POSITION\":0", draco))).unwrap();
    assert_eq!(fallback.positions(), FIVE, "there are uncompressed ones as well");
    let required = format!("{},\"extensionsRequired\":[\"EXT_meshopt_compression\"]", one("\"POSITION\":0", ""));
    assert!(error("a.glb", &builder.glb(&required)).contains("meshopt"), "meshopt");
    let morph = builder.glb(&one("\"POSITION\":0", ",\"targets\":[{\"POSITION\":0}]"));
    assert!(mesh("a.glb", &morph).1.contains("morph targets; its base shape"), "morph targets");
}

#[test]
fn hostile_structures_are_refused() {
    let mut builder = Builder::default();
    let position = builder.floats(&FIVE);
    let attributes = format!("\"POSITION\":{position}");
    let meshes = format!("\"meshes\":[{{\"primitives\":[{{\"attributes\":{{{attributes}}}}}]}}]");
    let scene = "\"scene\":0,\"scenes\":[{\"nodes\":[0]}]";
    // A cycle, and a chain of a hundred thousand nodes.
    let cycle =
        builder.glb(&format!("{scene},\"nodes\":[{{\"mesh\":0,\"children\":[1]}},{{\"children\":[0]}}],{meshes}"));
    let (cycle, notes) = mesh("a.glb", &cycle);
    assert!(cycle.cloud.len() == 5 && notes.contains("which glTF forbids"), "{notes}");
    let chain: Vec<String> = (1..=100_000).map(|i| format!("{{\"children\":[{i}]}}")).collect();
    let chain = builder.glb(&format!("{scene},\"nodes\":[{},{{\"mesh\":0}}],{meshes}", chain.join(",")));
    assert_eq!(read_bytes("a.glb", &chain).unwrap().len(), 5, "a deep tree");
    // Every node is twice the child of the previous one: 2^1000 paths to one node.
    let twice: Vec<String> = (1..=1000).map(|i| format!("{{\"children\":[{i},{i}]}}")).collect();
    let twice = builder.glb(&format!("{scene},\"nodes\":[{},{{\"mesh\":0}}],{meshes}", twice.join(",")));
    assert_eq!(read_bytes("a.glb", &twice).unwrap().len(), 5, "an explosion of nodes");
    // Many nodes with one mesh of many points.
    let mut large = Builder::default();
    let position = large.floats(&[[0.0; 3]; 4000]);
    let primitive = format!("{{\"attributes\":{{\"POSITION\":{position}}}}}");
    let nodes = vec!["{\"mesh\":0}"; 4000].join(",");
    let shown = format!("\"nodes\":[{nodes}],\"meshes\":[{{\"primitives\":[{primitive}]}}]");
    let message = error("a.glb", &large.glb(&shown));
    assert!(message.contains("16000000 points") && message.contains("split it"), "{message}");
    // Points that are not in the file.
    for count in ["4000000000", "18446744073709551615"] {
        let mut zeros = Builder::default();
        zeros.view(&[0; 4], "");
        let count = count.parse().unwrap();
        zeros.accessor(5126, "VEC3", count, "");
        error("a.glb", &zeros.glb(&one("\"POSITION\":0", "")));
        zeros.accessors[0].insert_str(1, "\"bufferView\":0,");
        assert!(
            error("a.glb", &zeros.glb(&one("\"POSITION\":0", ""))).contains("too many for a file"),
            "claimed by an accessor"
        );
        zeros.views[0] = format!("{{\"buffer\":0,\"byteOffset\":{count},\"byteLength\":{count}}}");
        error("a.glb", &zeros.glb(&one("\"POSITION\":0", "")));
    }
    let deep = format!("{{\"asset\":{}{}", "[".repeat(1 << 20), "]".repeat(1 << 20));
    assert!(error("a.gltf", deep.as_bytes()).contains("line 1"), "deep JSON");
    let deep = format!("{{\"x\":{}{},\"asset\":{{\"version\":\"2.0\"}}}}", "[".repeat(1 << 20), "]".repeat(1 << 20));
    error("a.gltf", deep.replace("\"x\"", "\"nodes\"").as_bytes());
    for (what, words) in [
        ("\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":7}}]}]", "accessor 7"),
        ("\"nodes\":[{\"mesh\":7}]", "mesh 7"),
        ("\"scene\":7,\"nodes\":[{}]", "scene 7"),
        ("\"scene\":0,\"scenes\":[{\"nodes\":[7]}],\"nodes\":[{}]", "node 7"),
    ] {
        let message = error("a.glb", &builder.glb(what));
        assert!(message.contains(words) && message.contains("no such"), "{message}");
    }
    assert!(error("a.gltf", b"{\"a\":1}").contains("missing field `asset`"), "another JSON");
    assert!(error("a.gltf", b"{\"asset\":{\"version\":\"1.0\"}}").contains("version 1.0"), "an old version");
    let whole = builder.glb(&one(&attributes, ""));
    for len in 4..whole.len() {
        error("a.glb", &whole[..len]);
    }
}
