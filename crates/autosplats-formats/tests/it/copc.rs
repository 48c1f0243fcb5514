//! Tests of COPC files that are read node by node.

use std::{path::PathBuf, sync::Arc};

use autosplats_cloud::{Error, Key, MemoryRanges, Node, PointCloud, PointFilter, Tree, Wanted};
use autosplats_formats::{ReadOptions, describe_tree, open_tree, open_tree_in, read_bytes, read_with};

use crate::common::{
    las_files::{EXACT, Notes},
    shared_data,
    trees::{Entry, copc, decoded, everything, keys, nodes, rows, with_page},
};

/// Number of points, and nodes by level.
const FILES: [(&str, u64, &[usize]); 2] =
    [("lone_star.copc.laz", 518_862, &[1, 4, 10]), ("lion_takanawa.copc.laz", 341_989, &[1, 8])];

fn path(name: &str) -> Option<PathBuf> {
    Some(shared_data()?.join("scans").join(name))
}

#[test]
fn nodes_together_are_the_whole_file() {
    for (name, points, levels) in FILES {
        let Some(path) = path(name) else { return };
        let tree = open_tree(&path, &()).unwrap().expect("it is COPC");
        let info = tree.info();
        assert_eq!(info.points, points, "{name}");
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
        assert_eq!(tree.take_notes(), Vec::<String>::new(), "{name}");
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
}

fn in_memory(bytes: &[u8]) -> Result<Arc<dyn Tree>, Error> {
    Ok(open_tree_in(Arc::new(MemoryRanges::new("a.copc.laz", bytes.to_vec())), &())?.expect("it is COPC"))
}

#[test]
fn a_made_file_is_read_as_others_read_it() {
    let made = nodes(20_000);
    let (bytes, entries) = copc(&made);
    let tree = in_memory(&bytes).unwrap();
    assert!(tree.info().notes.is_empty() && tree.info().spacing == 4.0, "{:?}", tree.info());
    assert_eq!(keys(&*tree), made.keys().copied().collect::<Vec<_>>());
    let whole = read_bytes("a.laz".as_ref(), &bytes, &EXACT, &()).unwrap();
    let names: Vec<String> = whole.fields().iter().map(|field| field.name.clone()).collect();
    let all: Vec<_> = made.keys().map(|&key| decoded(&*tree, key, &everything(true))).collect();
    assert!(rows(&all, &names) == rows(&[whole], &names), "the same points");
    assert_eq!(tree.take_notes(), Vec::<String>::new());
    let mut other = las::CopcReader::new(std::io::Cursor::new(bytes)).unwrap();
    for (cloud, Entry { key: [l, x, y, z], points, .. }) in all.iter().zip(entries) {
        let entry = other.hierarchy_entry(&las::copc::VoxelKey { l, x, y, z }).unwrap();
        let theirs = other.read_entry(&entry).unwrap();
        assert_eq!((theirs.len(), cloud.len()), (points as usize, points as usize));
        for (i, (x, y)) in theirs.x().zip(theirs.y()).enumerate() {
            let own = cloud.world_position(i);
            assert!((own.x - x).abs() < 1e-6 && (own.y - y).abs() < 1e-6, "{own} is not {x}, {y}");
        }
    }
}

#[test]
fn pages_are_loaded_when_they_are_asked_for() {
    let (mut bytes, entries) = copc(&nodes(20_000));
    // The deepest two levels below the first child are on a page, and the deepest of them on another.
    let below = |entry: &Entry, key: [i32; 4]| {
        entry.key[0] >= key[0] && (1..4).all(|axis| entry.key[axis] >> (entry.key[0] - key[0]) == key[axis])
    };
    let inner = entries.iter().find(|entry| entry.key[0] == 2).unwrap().key;
    let outer = [1, inner[1] / 2, inner[2] / 2, inner[3] / 2];
    let page = |key, (offset, len)| Entry { key, offset, bytes: len, points: -1 };
    let (last, rest): (Vec<_>, Vec<_>) = entries.iter().partition(|entry| below(entry, inner));
    let last = with_page(&mut bytes, &last);
    let (mut middle, mut first): (Vec<_>, Vec<_>) = rest.into_iter().partition(|entry| below(entry, outer));
    middle.push(page(inner, last));
    first.push(page(outer, with_page(&mut bytes, &middle)));
    with_page(&mut bytes, &first);
    let tree = in_memory(&bytes).unwrap();
    let [inner, outer] =
        [inner, outer].map(|[level, at @ ..]| Key::new(level.cast_unsigned(), at.map(i32::cast_unsigned)).unwrap());
    assert_eq!([inner, outer].map(|key| tree.node(key)), [Node::Unknown; 2]);
    let described = describe_tree(&*tree);
    let detail = |name: &str| described.details.iter().find(|(own, _)| own == name).map(|(_, value)| value.clone());
    assert!(detail("nodes").unwrap().ends_with("1 page that is not loaded"), "{described:?}");
    assert!(detail("level 0").unwrap().ends_with("in 1 node"), "{described:?}");
    let before = tree.traffic().requests;
    tree.load_pages(&[inner], &()).unwrap();
    assert_eq!(tree.traffic().requests, before + 2, "one page tells of the other");
    assert!(matches!(tree.node(inner), Node::Known { points: 1.., .. }));
    tree.load_pages(&[inner, outer, Key::ROOT], &()).unwrap();
    assert_eq!(tree.traffic().requests, before + 2, "known keys cost nothing");
    assert_eq!(keys(&*tree).len(), entries.len());
}

#[test]
fn hostile_hierarchies_are_refused_in_one_line() {
    type Change<'a> = &'a dyn Fn(&mut Vec<Entry>);
    let (sound, entries) = copc(&nodes(5000));
    let (root, child) = (entries[0], entries[1]);
    let size = sound.len() as u64;
    let case = |change: Change<'_>| {
        let (mut list, mut bytes) = (entries.clone(), sound.clone());
        change(&mut list);
        with_page(&mut bytes, &list);
        match in_memory(&bytes).and_then(|tree| tree.load_pages(&[Key::ROOT, Key::new(1, [1, 1, 1]).unwrap()], &())) {
            Ok(()) => "accepted".to_owned(),
            Err(error) => error.to_string(),
        }
    };
    let page = |key: [i32; 4], offset: u64, bytes: i32| Entry { key, offset, bytes, points: -1 };
    let cases: &[(&str, Change<'_>)] = &[
        ("accepted", &|_| ()),
        ("accepted", &|list| list[0] = Entry { points: 0, offset: u64::MAX, bytes: -7, ..root }),
        ("is not made of entries", &|list| list.clear()),
        ("does not tell of its own node", &|list| _ = list.remove(0)),
        ("does not tell of its own node", &|list| list[0] = page(root.key, size, 32)),
        ("twice", &|list| list.push(child)),
        ("has no parent", &|list| list.push(Entry { key: [9, 1, 2, 3], ..child })),
        ("no place 1-2-0-0", &|list| list[1].key = [1, 2, 0, 0]),
        ("no place 31-0-0-0", &|list| list[1].key = [31, 0, 0, 0]),
        ("no place -1-0-0-0", &|list| list[1].key = [-1, 0, 0, 0]),
        ("has -2 points", &|list| list[1].points = -2),
        ("has -5 bytes", &|list| list[1].bytes = -5),
        ("are not among the points", &|list| list[1].offset = 0),
        ("are not among the points", &|list| list[1].offset = u64::MAX - 3),
        ("are not among the points", &|list| list[1].offset = size + (1 << 40)),
        ("are not among the points", &|list| list[1].bytes = i32::MAX),
        ("cannot be in 3 bytes", &|list| list[1].bytes = 3),
        ("cannot be in", &|list| list[1].points = i32::MAX),
        ("reaches beyond the end", &|list| list.push(page([1, 1, 1, 1], size, i32::MAX))),
        ("is not made of entries", &|list| list.push(page([1, 1, 1, 1], size, 33))),
        ("is not made of entries", &|list| list.push(page([1, 1, 1, 1], size, 0))),
        // The page of the root is no page of a child, so that no page comes again.
        ("does not tell of its own node", &|list| *list = vec![root, page([1, 1, 1, 1], size, 64)]),
    ];
    for (index, (words, change)) in cases.iter().enumerate() {
        let told = case(*change);
        assert!(told.contains(words), "case {index}: {told} should contain {words}");
        assert!(told == "accepted" || told.starts_with("a.copc.laz: byte "), "{told}");
        assert!(!told.contains(char::is_control) && told.len() < 250, "{told}");
    }
    for (at, value, words) in [
        (429, f64::NAN.to_le_bytes(), "the root's cube is 64 wide about NaN"),
        (429, 1e300_f64.to_le_bytes(), "where no coordinates can be"),
        (453, (-1.0_f64).to_le_bytes(), "the root's cube is -2 wide"),
        (453, 1e300_f64.to_le_bytes(), "where no coordinates can be"),
        (461, 0_f64.to_le_bytes(), "the spacing is 0"),
        (469, u64::MAX.to_le_bytes(), "reaches beyond the end"),
        (477, (1_u64 << 40).to_le_bytes(), "reaches beyond the end"),
        (235, u64::MAX.to_le_bytes(), "accepted"),
        (96, [255; 8], "cannot begin at byte 4294967295"),
    ] {
        let mut bytes = sound.clone();
        bytes[at..at + 8].copy_from_slice(&value);
        let told = in_memory(&bytes).map_or_else(|error| error.to_string(), |_| "accepted".into());
        assert!(told.contains(words), "byte {at}: {told} should contain {words}");
    }
}

#[test]
fn many_claims_of_a_sparse_file_are_taken_in() {
    let (mut bytes, entries) = copc(&nodes(5000));
    let mut list = Vec::new();
    for level in 0..6 {
        let side = 1 << level;
        for at in 0..side * side * side {
            list.push(Entry { key: [level, at % side, at / side % side, at / side / side], ..entries[0] });
        }
    }
    with_page(&mut bytes, &list);
    let tree = in_memory(&bytes).unwrap();
    let described = describe_tree(&*tree);
    assert!(described.details.iter().any(|(name, value)| name == "level 5" && value.contains("in 32768 nodes")));
}

#[test]
fn colours_have_one_scale_everywhere() {
    // All of the root has 8 bits.
    let mut made = nodes(20_000);
    made.values_mut().flatten().for_each(|point| point.color = point.color.map(|channel| channel >> 8));
    let other = *made.keys().find(|key| key.level == 2).unwrap();
    made.get_mut(&other).unwrap().iter_mut().for_each(|point| point.color = [40_000; 3]);
    let tree = in_memory(&copc(&made).0).unwrap();
    let last = *made.keys().last().unwrap();
    for key in [last, other, Key::ROOT] {
        let cloud = decoded(&*tree, key, &everything(false));
        let expected = made[&key].iter().map(|point| point.color.map(|channel| channel.min(255) as u8));
        assert!(cloud.colors().unwrap().iter().copied().eq(expected), "node {key}");
    }
    let notes = tree.take_notes();
    assert_eq!(notes.len(), 2, "{notes:?}");
    assert!(notes[0].contains("read as 8 bits") && notes[1].contains(&format!("of node {other} look like 16 bits")));
    assert!(tree.take_notes().is_empty(), "told once");
}

#[test]
fn what_is_odd_about_nodes_is_told() {
    let (mut bytes, _) = copc(&nodes(20_000));
    bytes[461..469].copy_from_slice(&16.0_f64.to_le_bytes());
    bytes[429..437].copy_from_slice(&(5e5 + 64.0_f64).to_le_bytes());
    let tree = in_memory(&bytes).unwrap();
    assert!(
        tree.info().notes.iter().any(|note| note.contains("not inside the root's cube")),
        "{:?}",
        tree.info().notes
    );
    decoded(&*tree, Key::ROOT, &everything(false));
    let notes = tree.take_notes().concat();
    assert!(notes.contains("spacing of 16 is more than twice") && notes.contains("outside its cube"), "{notes}");
}
