//! Scans in octrees behind an address. They lie beside the repository in `../shared/data`, or where `AUTOSPLATS_DATA`
//! points; without them this checks nothing, and fails where `CI` is set.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use autosplats_cloud::{FileRanges, Key, Node, Tree, Wanted};
use autosplats_formats::open_tree_in;
use autosplats_serve::Server;

use crate::{open, quick};

fn scans() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let scans = std::env::var_os("AUTOSPLATS_DATA").map_or_else(beside, PathBuf::from).join("scans");
    assert!(scans.is_dir() || std::env::var_os("CI").is_none(), "{} is absent", scans.display());
    scans.is_dir().then_some(scans)
}

/// The nodes from the root down to the leaves.
fn nodes(tree: &dyn Tree) -> Vec<Key> {
    let (mut found, mut level) = (Vec::new(), vec![Key::ROOT]);
    while !level.is_empty() {
        tree.load_pages(&level, &()).unwrap();
        level.retain(|&key| matches!(tree.node(key), Node::Known { .. }));
        found.extend(&level);
        level = level.into_iter().flat_map(Key::children).collect();
    }
    found
}

#[test]
fn nodes_are_those_of_the_file_for_few_requests() {
    let Some(scans) = scans() else { return };
    let server = Server::start(&scans, Duration::ZERO).unwrap();
    for name in ["lone_star.copc.laz", "lion_takanawa.copc.laz"] {
        let file = open_tree_in(Arc::new(FileRanges::open(&scans.join(name)).unwrap()), &()).unwrap().unwrap();
        for path in [name.to_owned(), format!("~short:2-4/{name}")] {
            let ranges = open(&server.address(&path), &quick(), &()).unwrap();
            let (size, tree) = (ranges.size(), open_tree_in(ranges, &()).unwrap().unwrap());
            assert_eq!(tree.info(), file.info(), "{path}");
            let root = tree.fetch(&[Key::ROOT], &()).unwrap();
            let wanted = Wanted { colors: true, ..Wanted::default() };
            let drawn = tree.decode(Key::ROOT, &root[0], &wanted).unwrap();
            let first = tree.traffic();
            println!("{path}: {} points, {} requests, {} bytes", drawn.len(), first.requests, first.bytes);
            assert!(first.requests <= 6 && first.bytes < 1_000_000, "{path}: to the first picture {first:?}");
            let keys = nodes(&*tree);
            assert_eq!(keys, nodes(&*file), "{path}");
            assert!(tree.fetch(&keys, &()).unwrap() == file.fetch(&keys, &()).unwrap(), "{path}: the same bytes");
            let (all, limit) = (tree.traffic(), size as f64 * 1.15);
            println!("{path}: {} nodes, {} requests, {} of {size} bytes", keys.len(), all.requests, all.bytes);
            assert!((all.bytes as f64) < limit, "{path}: {all:?}");
            tree.fetch(&keys, &()).unwrap();
            assert_eq!(tree.traffic(), all, "{path}: from memory");
        }
    }
}
