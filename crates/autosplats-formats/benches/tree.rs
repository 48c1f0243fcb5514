//! Points per CPU second from the nodes of COPC files, beside the bare codec of the `laz` crate: `cargo bench -p
//! autosplats-formats --bench tree -- FILE...` (Linux).
//!
//! Every node is decoded on one thread, five times. The best round is printed, since other rounds include other work of
//! the computer.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run should say so and stop")]

use std::{io::Cursor, path::Path};

use autosplats_cloud::{Key, Node, Tree, Wanted};
use autosplats_formats::open_tree;
use laz::{
    DecompressionSelection as Selection, LazVlr,
    record::{LayeredPointRecordDecompressor, RecordDecompressor as _},
};

const ROUNDS: usize = 5;

/// Name, whether there are colours, whether there are fields.
const KINDS: [(&str, bool, bool); 3] = [("all", true, true), ("xyz rgb", true, false), ("xyz", false, false)];

fn main() {
    // Cargo adds `--bench`.
    let files: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    if files.is_empty() {
        println!("which files? cargo bench -p autosplats-formats --bench tree -- FILE...");
    }
    println!("| file | values | M points/CPU s | bare codec | ratio |\n|---|---|--:|--:|--:|");
    for file in files {
        let path = Path::new(&file);
        let tree = open_tree(path, &()).unwrap().expect("a COPC file");
        let compression = compression(&std::fs::read(path).unwrap());
        let nodes = nodes(&*tree);
        let points: usize = nodes.iter().map(|(_, points, _)| points).sum();
        for (what, colors, fields) in KINDS {
            let wanted = Wanted { colors, fields: (!fields).then(Vec::new), ..Wanted::default() };
            let rate = |seconds: f64| points as f64 / seconds / 1e6;
            let ours =
                rate(best(|| nodes.iter().for_each(|(key, _, bytes)| _ = tree.decode(*key, bytes, &wanted).unwrap())));
            let z = Selection::xy_returns_channel().decompress_z();
            let selection = match (fields, colors) {
                (true, _) => Selection::all(),
                (false, true) => z.decompress_rgb(),
                (false, false) => z,
            };
            let bare = rate(best(|| {
                for (_, points, bytes) in &nodes {
                    let mut codec = LayeredPointRecordDecompressor::new(Cursor::new(&**bytes));
                    codec.set_fields_from(compression.items()).unwrap();
                    codec.set_selection(selection);
                    codec.decompress_many(&mut vec![0; points * codec.record_size()]).unwrap();
                }
            }));
            let name = path.file_name().unwrap().display();
            println!("| {name} | {what} | {ours:.2} | {bare:.2} | {:.2} |", ours / bare);
        }
    }
}

/// Key, number of points and bytes of all nodes with points.
fn nodes(tree: &dyn Tree) -> Vec<(Key, usize, Vec<u8>)> {
    let (mut all, mut level) = (Vec::new(), vec![Key::ROOT]);
    while !level.is_empty() {
        tree.load_pages(&level, &()).unwrap();
        level.retain(|&key| tree.node(key) != Node::Absent);
        for &key in &level {
            if let Node::Known { points: points @ 1.., .. } = tree.node(key) {
                all.push((key, points as usize, tree.fetch(&[key], &()).unwrap().concat()));
            }
        }
        level = level.iter().flat_map(|key| key.children()).collect();
    }
    all
}

/// The compression record of a LAZ file.
fn compression(file: &[u8]) -> LazVlr {
    let (user, id) = (LazVlr::USER_ID.as_bytes(), LazVlr::RECORD_ID.to_le_bytes());
    let at = file.windows(user.len()).position(|bytes| bytes == user).unwrap();
    assert_eq!(file[at + 16..at + 18], id, "the record of this user");
    LazVlr::from_buffer(&file[at + 52..]).unwrap()
}

/// CPU seconds of this thread in the best of some rounds.
fn best(work: impl Fn()) -> f64 {
    let spent = || {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
        text.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9
    };
    let round = |_| {
        let before = spent();
        work();
        spent() - before
    };
    (0..ROUNDS).map(round).fold(f64::INFINITY, f64::min)
}
