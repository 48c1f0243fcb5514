//! Tests of reading parts of trees as one cloud.

use std::sync::Arc;

use autosplats_cloud::{Error, MemoryRanges, PointCloud, PointFilter, Progress, Tree, glam::DVec3};
use autosplats_formats::{Part, ReadOptions, open_tree, open_tree_in, read_part, read_with};

use crate::common::{
    las_files::Notes,
    shared_data,
    trees::{CUBE, copc, everything, nodes, rows},
};

fn made() -> Arc<dyn Tree> {
    let bytes = copc(&nodes(20_000)).0;
    open_tree_in(Arc::new(MemoryRanges::new("a.copc.laz", bytes)), &()).unwrap().expect("it is COPC")
}

fn names(cloud: &PointCloud) -> Vec<String> {
    cloud.fields().iter().map(|field| field.name.clone()).collect()
}

fn threads<T: Send>(count: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap().install(work)
}

#[test]
fn everything_of_a_tree_is_the_file() {
    let Some(folder) = shared_data() else { return };
    for name in ["lone_star.copc.laz", "lion_takanawa.copc.laz"] {
        let path = folder.join("scans").join(name);
        for exact in [false, true] {
            let tree = open_tree(&path, &()).unwrap().expect("it is COPC");
            let notes = Notes::default();
            let all = read_part(&*tree, &Part::default(), &everything(exact), &notes).unwrap();
            let others = Notes::default();
            let whole = read_with(&path, &ReadOptions { exact, ..ReadOptions::default() }, &others).unwrap();
            let [notes, others] = [notes, others].map(|notes| {
                let mut notes = notes.notes.into_inner().unwrap();
                notes.sort_unstable();
                notes
            });
            assert_eq!(notes, others, "{name}");
            let (mut own, mut others) = (names(&all), names(&whole));
            own.sort_unstable();
            others.sort_unstable();
            assert_eq!(own, others, "{name}");
            assert_eq!((all.origin(), all.len()), (whole.origin(), whole.len()), "{name}");
            assert_eq!((all.crs(), all.axes(), all.resolution()), (whole.crs(), whole.axes(), whole.resolution()));
            assert_eq!(all.residuals().is_some(), whole.residuals().is_some(), "{name}");
            assert!(rows(&[all], &own) == rows(&[whole], &own), "{name}: the same points");
        }
    }
}

#[test]
fn a_part_is_what_cropping_leaves() {
    let tree = made();
    let all = read_part(&*tree, &Part::default(), &everything(false), &()).unwrap();
    let bounds = [CUBE[0] + DVec3::new(3.0, 5.0, -10.0), CUBE[0] + DVec3::new(20.0, 30.0, 100.0)];
    let part = read_part(&*made(), &Part { bounds: Some(bounds), ..Part::default() }, &everything(false), &()).unwrap();
    let mut cropped = all.clone();
    cropped.crop(bounds[0], bounds[1]);
    assert!(part.len() > 1000 && part.len() < all.len() / 2, "{} points", part.len());
    assert!(rows(&[part], &names(&all)) == rows(&[cropped], &names(&all)), "the same points");
    let beyond = Part { bounds: Some([CUBE[1] + 10.0, CUBE[1] + 20.0]), ..Part::default() };
    assert!(read_part(&*tree, &beyond, &everything(false), &()).unwrap().is_empty());

    let made_nodes = nodes(20_000);
    for (spacing, level) in [(9.0, 0), (4.0, 0), (3.9, 1), (2.0, 1), (1.0, 2), (0.4, 3), (0.01, 3)] {
        let part = Part { spacing: Some(spacing), ..Part::default() };
        let coarse = read_part(&*tree, &part, &everything(false), &()).unwrap();
        let expected: usize =
            made_nodes.iter().filter(|(key, _)| key.level <= level).map(|(_, points)| points.len()).sum();
        assert_eq!(coarse.len(), expected, "spacing {spacing} needs level {level}");
    }
}

#[test]
fn threads_change_nothing() {
    let Some(folder) = shared_data() else { return };
    let read = |count: usize| {
        threads(count, || {
            let tree = open_tree(&folder.join("scans/lion_takanawa.copc.laz"), &()).unwrap().expect("it is COPC");
            read_part(&*tree, &Part::default(), &everything(true), &()).unwrap()
        })
    };
    let one = read(1);
    assert!(read(2) == one && read(8) == one, "the same points in the same order");
}

#[test]
fn filters_tell_how_many_points_they_leave_out() {
    let tree = made();
    let notes = Notes::default();
    let all = read_part(&*tree, &Part::default(), &everything(false), &()).unwrap();
    let classes = all.field("Classification").unwrap();
    let twos = (0..all.len()).filter(|&i| classes.values.get(i) == 2.0).count();
    let keep = |text: &str| {
        let mut wanted = everything(false);
        wanted.keep = Some(text.parse().unwrap());
        wanted.fields = Some(vec!["intensity".into()]);
        wanted
    };
    let kept = read_part(&*tree, &Part::default(), &keep("2"), &notes).unwrap();
    assert_eq!((kept.len(), names(&kept)), (twos, vec!["Intensity".to_owned()]));
    let told = notes.notes.into_inner().unwrap();
    assert_eq!(told, [format!("--keep 2 left out {} of {} points", all.len() - twos, all.len())]);
    let none = read_part(&*tree, &Part::default(), &keep("9"), &()).unwrap_err();
    assert!(matches!(none, Error::NothingKept { .. }), "{none}");
    let usual = read_part(&*tree, &Part::default(), &keep(&PointFilter::usual().to_string()), &()).unwrap();
    assert_eq!(usual.len(), all.len());
}

#[test]
fn damaged_nodes_are_left_out_and_told() {
    let made = nodes(20_000);
    let (mut bytes, entries) = copc(&made);
    let lost = entries[2];
    // The number of points in the chunk, behind its first record.
    let at = lost.offset as usize + 36;
    bytes[at..at + 4].copy_from_slice(&1_u32.to_le_bytes());
    let open = |bytes: Vec<u8>| open_tree_in(Arc::new(MemoryRanges::new("a", bytes)), &()).unwrap().expect("COPC");
    let notes = Notes::default();
    let cloud = read_part(&*open(bytes.clone()), &Part::default(), &everything(false), &notes).unwrap();
    assert_eq!(cloud.len(), 20_000 - lost.points as usize);
    let told = notes.notes.into_inner().unwrap();
    assert_eq!(told, [format!("damaged nodes: {} of 20000 points are lost; copy it again", lost.points)]);
    for entry in entries.iter().filter(|entry| entry.points > 0) {
        let at = entry.offset as usize + 36;
        bytes[at..at + 4].copy_from_slice(&1_u32.to_le_bytes());
    }
    let told = read_part(&*open(bytes), &Part::default(), &everything(false), &()).unwrap_err().to_string();
    assert!(told.starts_with("a: byte ") && told.contains("node 0-0-0-0: it holds 1 of"), "{told}");
}

#[test]
fn reading_can_be_cancelled() {
    struct Stop;
    impl Progress for Stop {
        fn report(&self, _: f32) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let outcome = read_part(&*made(), &Part::default(), &everything(false), &Stop);
    assert!(matches!(outcome, Err(Error::Cancelled)), "{outcome:?}");
}
