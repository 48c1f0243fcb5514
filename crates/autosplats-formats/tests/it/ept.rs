//! Tests of EPT folders.

use std::path::Path;

use autosplats_cloud::{Error, Key, Node};
use autosplats_formats::{Part, describe_tree, open_tree, read_bytes, read_part};

use crate::common::{
    las_files::{EXACT, Notes},
    trees::{Sample, decoded, everything, keys, laz, nodes, rows, write_ept},
};

const KINDS: [(&str, &str); 3] = [("laszip", "laz"), ("binary", "bin"), ("zstandard", "zst")];

fn message(folder: &Path) -> String {
    let outcome = open_tree(folder, &()).and_then(|tree| {
        let tree = tree.expect("an EPT");
        tree.load_pages(&keys_of(&*tree), &())?;
        read_part(&*tree, &Part::default(), &everything(false), &())
    });
    let message = outcome.map_or_else(|error| error.to_string(), |cloud| format!("{} points", cloud.len()));
    assert!(!message.contains(char::is_control), "{message}");
    message
}

fn keys_of(tree: &dyn autosplats_cloud::Tree) -> Vec<Key> {
    Key::ROOT.children().filter(|&key| tree.node(key) != Node::Absent).collect()
}

#[test]
fn nodes_of_all_types_are_the_points() {
    let mut made = nodes(20_000);
    // Some tree has an inner node without points.
    made.get_mut(&Key::ROOT).unwrap().clear();
    let all: Vec<Sample> = made.values().flatten().cloned().collect();
    let whole = read_bytes("a.laz".as_ref(), &laz(&all), &EXACT, &()).unwrap();
    let fields = ["Intensity", "Classification"].map(String::from);
    for (kind, _) in KINDS {
        let folder = tempfile::tempdir().unwrap();
        write_ept(folder.path(), &made, kind);
        for path in [folder.path().to_owned(), folder.path().join("ept.json")] {
            let tree = open_tree(&path, &()).unwrap().expect("an EPT");
            assert_eq!(tree.node(Key::new(1, [0; 3]).unwrap()), Node::Unknown, "{kind}: pages are loaded later");
            let notes = Notes::default();
            let cloud = read_part(&*tree, &Part::default(), &everything(true), &notes).unwrap();
            assert!(
                rows(std::slice::from_ref(&cloud), &fields) == rows(std::slice::from_ref(&whole), &fields),
                "{kind}"
            );
            assert_eq!(notes.notes.into_inner().unwrap(), Vec::<String>::new(), "{kind}");
            assert_eq!((cloud.crs().epsg, tree.info().spacing), (Some(32_632), 4.0), "{kind}");
            assert_eq!(keys(&*tree), made.keys().copied().collect::<Vec<_>>(), "{kind}");
            for (&key, points) in &made {
                let node = decoded(&*tree, key, &everything(false));
                let [low, high] = key.cube(tree.info().cube);
                assert_eq!((node.len(), node.origin()), (points.len(), low.midpoint(high)), "{kind} {key}");
                assert!(node.byte_len() <= node.len() * tree.point_bytes(&everything(false)).max(30), "{kind} {key}");
            }
            let described = describe_tree(&*tree);
            assert_eq!(described.points, Some(20_000 - nodes(20_000)[&Key::ROOT].len() as u64), "{kind}");
            assert_eq!(described.attributes.len(), 8, "{kind}");
        }
    }
}

#[test]
fn eight_bit_colours_are_settled() {
    let mut made = nodes(3000);
    made.values_mut().flatten().for_each(|point| point.color = point.color.map(|channel| channel >> 8));
    for (kind, _) in KINDS {
        let folder = tempfile::tempdir().unwrap();
        write_ept(folder.path(), &made, kind);
        let notes = Notes::default();
        let tree = open_tree(folder.path(), &()).unwrap().expect("an EPT");
        let cloud = read_part(&*tree, &Part::default(), &everything(false), &notes).unwrap();
        assert!(cloud.colors().unwrap().iter().flatten().any(|&channel| channel > 100), "{kind}");
        let told = notes.notes.into_inner().unwrap();
        assert!(told.len() == 1 && told[0].contains("read as 8 bits"), "{told:?}");
    }
}

#[test]
fn broken_folders_are_told_in_one_line() {
    let made = nodes(3000);
    let last = *made.keys().last().unwrap();
    for (kind, extension) in KINDS {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let data = at(&format!("ept-data/{last}.{extension}"));
        let page = at("ept-hierarchy/0-0-0-0.json");
        let fresh = || write_ept(folder.path(), &made, kind);
        fresh();
        assert_eq!(message(folder.path()), "3000 points");
        std::fs::remove_file(&data).unwrap();
        assert!(message(folder.path()).contains(&format!("{last}.{extension}: ")), "{kind}: no such file");
        let node_file = std::fs::read(at(&format!("ept-data/0-0-0-0.{extension}"))).unwrap();
        std::fs::write(&data, node_file).unwrap();
        let tree = open_tree(folder.path(), &()).unwrap().expect("an EPT");
        tree.load_pages(&[last], &()).unwrap();
        let bytes = tree.fetch(&[last], &()).unwrap().concat();
        let told = tree.decode(last, &bytes, &everything(false)).unwrap_err().to_string();
        assert!(told.contains(&format!("{last}.{extension}: node {last}: ")), "{kind}: {told}");
        for (text, words) in [
            ("[1]", "expected an object"),
            ("{\"0-0-0-0\": 5, \"1-0-0\": 2}", "'1-0-0' is no place"),
            ("{\"0-0-0-0\": 5, \"1-0-0-2\": 2}", "'1-0-0-2' is no place"),
            ("{\"0-0-0-0\": 5, \"1-0-0-1\": -2}", "has -2 points"),
            ("{\"0-0-0-0\": 5, \"1-0-0-1\": 4294967296}", "has 4294967296 points"),
            ("{\"0-0-0-0\": -1}", "its own node"),
            ("{\"1-0-0-0\": 5}", "its own node"),
            ("{\"0-0-0-0\": 5, \"2-0-0-0\": 5}", "node 2-0-0-0 has no parent"),
            ("{\"0-0-0-0\": 5, \"0-0-0-0\": 5}", "twice"),
            ("{\"0-0-0-0\": 5", "EOF"),
        ] {
            fresh();
            std::fs::write(&page, text).unwrap();
            let told = message(folder.path());
            assert!(told.contains(words) && told.contains("0-0-0-0.json: "), "{kind}: {told} should contain {words}");
        }
        fresh();
        std::fs::write(&page, "{\"0-0-0-0\": 4000000000}").unwrap();
        let told = message(folder.path());
        assert!(told.contains("out of memory") || told.contains("of 4000000000 points"), "{kind}: {told}");
    }
}

#[test]
fn other_json_is_no_ept() {
    let folder = tempfile::tempdir().unwrap();
    assert!(open_tree(folder.path(), &()).unwrap().is_none(), "a folder without metadata");
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, "{\"asset\":{\"version\":\"2.0\"}}").unwrap();
    assert!(open_tree(&path, &()).unwrap().is_none());
    std::fs::write(folder.path().join("ept.json"), "{}").unwrap();
    let told = open_tree(folder.path(), &()).unwrap_err();
    assert!(matches!(&told, Error::Malformed { .. }) && told.to_string().contains("missing field"), "{told}");
}
