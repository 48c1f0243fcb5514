//! Tests of COPC files that are read node by node.

use std::{path::PathBuf, sync::Arc};

use autosplats_cloud::{FileRanges, Key, MemoryRanges, Node, PointCloud, PointFilter, Ranges as _, Tree, Wanted};
use autosplats_formats::{ReadOptions, open_tree, open_tree_in, read_with};

use crate::common::{las_files::Notes, shared_data};

/// Number of points, and nodes by level.
const FILES: [(&str, u64, &[usize]); 2] =
    [("lone_star.copc.laz", 518_862, &[1, 4, 10]), ("lion_takanawa.copc.laz", 341_989, &[1, 8])];

fn path(name: &str) -> Option<PathBuf> {
    Some(shared_data()?.join("scans").join(name))
}

fn everything(exact: bool) -> Wanted {
    Wanted { colors: true, exact, ..Wanted::default() }
}

/// Keys of all nodes, whose pages are loaded.
fn keys(tree: &dyn Tree) -> Vec<Key> {
    let (mut all, mut level) = (Vec::new(), vec![Key::ROOT]);
    while !level.is_empty() {
        tree.load_pages(&level, &()).unwrap();
        level.retain(|&key| tree.node(key) != Node::Absent);
        all.extend(&level);
        level = level.iter().flat_map(|key| key.children()).collect();
    }
    all
}

fn decoded(tree: &dyn Tree, key: Key, wanted: &Wanted) -> PointCloud {
    let bytes = tree.fetch(&[key], &()).unwrap().concat();
    tree.decode(key, &bytes, wanted).unwrap_or_else(|error| panic!("{error}"))
}

/// All values of each point, in the order of their coordinates.
fn rows(clouds: &[PointCloud], fields: &[String]) -> Vec<Vec<i64>> {
    let mut rows = Vec::new();
    for cloud in clouds {
        let fields: Vec<_> = fields.iter().map(|name| cloud.field(name)).collect();
        for i in 0..cloud.len() {
            let grid = cloud.world_position(i) / cloud.resolution().unwrap();
            let mut row: Vec<i64> = grid.to_array().map(|value| value.round() as i64).into();
            row.extend(cloud.colors().map_or([0; 3], |colors| colors[i]).map(i64::from));
            row.extend(fields.iter().map(|field| field.map_or(0, |field| field.values.get(i).to_bits() as i64)));
            rows.push(row);
        }
    }
    rows.sort_unstable();
    rows
}

#[test]
fn nodes_together_are_the_whole_file() {
    for (name, points, levels) in FILES {
        let Some(path) = path(name) else { return };
        let tree = open_tree(&path, &()).unwrap().expect("it is COPC");
        let info = tree.info();
        assert_eq!((info.points, &info.notes), (points, &Vec::new()), "{name}");
        assert!(tree.traffic().requests <= 3, "{name}: {:?}", tree.traffic());
        let keys = keys(&*tree);
        for (level, count) in levels.iter().enumerate() {
            assert_eq!(keys.iter().filter(|key| key.level == level as u32).count(), *count, "{name}, level {level}");
        }
        let options = ReadOptions { exact: true, keep_no_returns: true, ..ReadOptions::default() };
        let whole = read_with(&path, &options, &()).unwrap();
        let nodes: Vec<_> = keys.iter().map(|&key| decoded(&*tree, key, &everything(true))).collect();
        let names: Vec<String> = whole.fields().iter().map(|field| field.name.clone()).collect();
        assert_eq!(nodes.iter().map(PointCloud::len).sum::<usize>() as u64, points);
        assert!(rows(&nodes, &names) == rows(std::slice::from_ref(&whole), &names), "{name}: the same points");
        for (cloud, &key) in nodes.iter().zip(&keys) {
            let [low, high] = key.cube(info.cube);
            assert_eq!(cloud.origin(), low.midpoint(high), "{name} {key}");
            assert_eq!((cloud.crs(), cloud.axes()), (whole.crs(), whole.axes()), "{name} {key}");
            assert!(cloud.byte_len() <= cloud.len() * tree.point_bytes(&everything(true)), "{name} {key}");
        }
        println!("{name}: {:?}", tree.take_notes());
    }
}

#[test]
fn what_is_selected_has_the_values_of_everything() {
    for (name, _, _) in FILES {
        let Some(path) = path(name) else { return };
        let tree = open_tree(&path, &()).unwrap().expect("it is COPC");
        for key in keys(&*tree) {
            let all = decoded(&*tree, key, &everything(false));
            let some = |colors, fields: &[&str]| {
                let fields = Some(fields.iter().map(|&field| field.to_owned()).collect());
                decoded(&*tree, key, &Wanted { colors, fields, ..Wanted::default() })
            };
            let bare = some(false, &[]);
            assert_eq!((bare.positions(), bare.colors(), bare.fields()), (all.positions(), None, &[][..]), "{key}");
            let colored = some(true, &[]);
            assert_eq!((colored.positions(), colored.colors()), (all.positions(), all.colors()), "{key}");
            for field in all.fields() {
                let one = some(false, &[&field.name.to_lowercase()]);
                assert_eq!(one.fields(), std::slice::from_ref(field), "{name} {key}");
                assert!(one.colors().is_none(), "{name} {key}");
            }
        }
    }
}

#[test]
fn a_filter_needs_no_wanted_fields() {
    let Some(path) = path("lone_star.copc.laz") else { return };
    let tree = open_tree(&path, &()).unwrap().expect("it is COPC");
    let all = decoded(&*tree, Key::ROOT, &everything(false));
    let returns = all.field("ReturnNumber").expect("returns differ");
    let expected = (0..all.len()).filter(|&i| returns.values.get(i) == 1.0).count();
    let keep: PointFilter = "first".parse().unwrap();
    let wanted = Wanted { fields: Some(Vec::new()), keep: Some(keep), ..Wanted::default() };
    let kept = decoded(&*tree, Key::ROOT, &wanted);
    assert_eq!((kept.len(), kept.fields()), (expected, &[][..]));
}

#[test]
fn other_files_are_no_trees() {
    let Some(folder) = shared_data() else { return };
    for name in ["malformed/copc_fake.copc.laz", "scans/autzen_trim.laz", "scans/simple_1065.las", "models/bunny.ply"] {
        assert!(open_tree(&folder.join(name), &()).unwrap().is_none(), "{name}");
    }
    assert!(open_tree(&folder.join("none.copc.laz"), &()).is_err(), "no such file");
    // A file that is cut off has no hierarchy, but points.
    let path = folder.join("scans/lion_takanawa.copc.laz");
    let bytes = std::fs::read(&path).unwrap();
    let cut = tempfile::tempdir().unwrap();
    let cut = cut.path().join("cut.copc.laz");
    std::fs::write(&cut, &bytes[..2_000_000]).unwrap();
    let notes = Notes::default();
    assert!(open_tree(&cut, &notes).unwrap().is_none());
    let notes = notes.notes.into_inner().unwrap();
    assert!(
        notes.len() == 1 && notes[0].contains("read whole") && notes[0].contains("copy the file again"),
        "{notes:?}"
    );
    let told = open_tree_in(Arc::new(MemoryRanges::new("cut", bytes[..2_000_000].to_vec())), &()).unwrap_err();
    assert!(told.to_string().starts_with("cut: byte 469: hierarchy: a page"), "{told}");
    let file = FileRanges::open(&path).unwrap();
    assert_eq!(file.size(), bytes.len() as u64);
}
