//! Tests of octrees of Potree.

use std::path::Path;

use autosplats_cloud::{Error, Key, Node};
use autosplats_formats::{Part, describe_tree, open_tree, read_bytes, read_part};

use crate::common::{
    las_files::{EXACT, Notes},
    trees::{Sample, decoded, everything, keys, laz, nodes, rows, write_potree},
};

const ENCODINGS: [&str; 2] = ["DEFAULT", "BROTLI"];

fn message(folder: &Path) -> String {
    let outcome = open_tree(folder, &())
        .and_then(|tree| read_part(&*tree.expect("Potree"), &Part::default(), &everything(false), &()));
    let message = outcome.map_or_else(|error| error.to_string(), |cloud| format!("{} points", cloud.len()));
    assert!(!message.contains(char::is_control), "{message}");
    message
}

#[test]
fn nodes_of_both_encodings_are_the_points() {
    let mut made = nodes(20_000);
    // Some tree has an inner node without points.
    made.get_mut(&Key::ROOT).unwrap().clear();
    let all: Vec<Sample> = made.values().flatten().cloned().collect();
    let whole = read_bytes("a.laz".as_ref(), &laz(&all), &EXACT, &()).unwrap();
    let fields = ["Intensity", "Classification"].map(String::from);
    for encoding in ENCODINGS {
        let folder = tempfile::tempdir().unwrap();
        write_potree(folder.path(), &made, encoding);
        for path in [folder.path().to_owned(), folder.path().join("metadata.json")] {
            let tree = open_tree(&path, &()).unwrap().expect("Potree");
            assert_eq!(tree.node(Key::new(1, [0; 3]).unwrap()), Node::Unknown, "{encoding}: pages are loaded later");
            let notes = Notes::default();
            let cloud = read_part(&*tree, &Part::default(), &everything(true), &notes).unwrap();
            assert!(
                rows(std::slice::from_ref(&cloud), &fields) == rows(std::slice::from_ref(&whole), &fields),
                "{encoding}"
            );
            assert_eq!(notes.notes.into_inner().unwrap(), Vec::<String>::new(), "{encoding}");
            assert_eq!((cloud.crs().epsg, tree.info().spacing), (Some(32_632), 4.0), "{encoding}");
            assert_eq!(keys(&*tree), made.keys().copied().collect::<Vec<_>>(), "{encoding}");
            for (&key, points) in &made {
                assert_eq!(decoded(&*tree, key, &everything(false)).len(), points.len(), "{encoding} {key}");
            }
            let described = describe_tree(&*tree);
            assert_eq!(described.points, Some(all.len() as u64), "{encoding}");
            assert_eq!(described.attributes.len(), 8, "{encoding}");
            assert!(tree.traffic().bytes > 0 && tree.traffic().requests > 3, "{encoding}");
        }
    }
}

#[test]
fn broken_folders_are_told_in_one_line() {
    let made = nodes(3000);
    for encoding in ENCODINGS {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let fresh = || write_potree(folder.path(), &made, encoding);
        fresh();
        assert_eq!(message(folder.path()), "3000 points");
        for name in ["hierarchy.bin", "octree.bin"] {
            fresh();
            std::fs::remove_file(at(name)).unwrap();
            assert!(message(folder.path()).contains(&format!("{name}: ")), "{encoding}: no such file");
            fresh();
            let bytes = std::fs::read(at(name)).unwrap();
            std::fs::write(at(name), &bytes[..bytes.len() / 2]).unwrap();
            let told = message(folder.path());
            assert!(told.contains("copy the"), "{encoding}: {told}");
        }
        fresh();
        let mut data = std::fs::read(at("octree.bin")).unwrap();
        data.iter_mut().step_by(3).for_each(|byte| *byte ^= 0x5a);
        std::fs::write(at("octree.bin"), data).unwrap();
        let told = message(folder.path());
        if encoding == "BROTLI" {
            assert!(told.contains("octree.bin: byte 0: node 0-0-0-0: "), "{told}");
        }
        fresh();
        let text = std::fs::read_to_string(at("metadata.json")).unwrap();
        for (from, to, words) in [
            ("\"firstChunkSize\":", "\"firstChunkSize\":1", "firstChunkSize: a page of"),
            ("\"2.0\"", "\"3.0\"", "version '3.0' of Potree is not read"),
            (encoding, "zip", "nodes of encoding 'zip' are not read"),
        ] {
            std::fs::write(at("metadata.json"), text.replace(from, to)).unwrap();
            let told = message(folder.path());
            assert!(told.contains(words), "{encoding}: {told} should contain {words}");
        }
    }
}

#[test]
fn other_metadata_are_no_octree() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("metadata.json"), "{\"hierarchy\":1}").unwrap();
    assert!(open_tree(folder.path(), &()).unwrap().is_none());
    assert!(open_tree(&folder.path().join("metadata.json"), &()).unwrap().is_none());
    let text = "{\"hierarchy\":{},\"boundingBox\":1,\"encoding\":1}";
    std::fs::write(folder.path().join("metadata.json"), text).unwrap();
    let told = open_tree(folder.path(), &()).unwrap_err();
    assert!(matches!(told, Error::Malformed { .. }), "{told}");
}
