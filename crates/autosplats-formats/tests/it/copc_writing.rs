//! Tests of making octrees: COPC files of any points.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::atomic::{AtomicUsize, Ordering},
};

use autosplats_cloud::{
    Clouds, Error, FieldValues, Key, Outline, PointCloud, PointFilter, Progress, Random,
    glam::{DMat4, DVec3},
};
use autosplats_formats::{ReadOptions, TreeInput, TreeOptions, open_tree, read_with, write, write_tree};

use crate::common::{
    las_bytes,
    las_files::{EXACT, Notes},
    shared_data,
    trees::{decoded, everything, keys, rows},
};

const MEMORY: u64 = 512 << 20;

fn options(memory: u64) -> TreeOptions {
    TreeOptions { memory, keep_no_returns: true, ..TreeOptions::default() }
}

/// A cloud whose outline is known, with the number of times it was read.
struct Outlined {
    cloud: PointCloud,
    bounds: [DVec3; 2],
    reads: AtomicUsize,
}

impl Clouds for &Outlined {
    fn name(&self) -> &Path {
        Path::new("outlined")
    }

    fn outline(&self, _progress: &dyn Progress) -> Result<Option<Outline>, Error> {
        Ok(Some(Outline { points: self.cloud.len() as u64, bounds: self.bounds, some: surface(10) }))
    }

    fn read(
        &self,
        _progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.reads.fetch_add(1, Ordering::Relaxed);
        take(&self.cloud)
    }
}

/// Writes the tree of some LAS files, and returns the notes.
fn tree_of(files: &[PathBuf], out: &Path, options: &TreeOptions) -> Result<Vec<String>, Error> {
    let notes = Notes::default();
    write_tree(files.iter().cloned().map(TreeInput::Las).collect(), out, options, &notes)?;
    Ok(notes.notes.into_inner().unwrap())
}

/// A cloud in memory.
struct Held(PointCloud);

impl Clouds for Held {
    fn name(&self) -> &Path {
        Path::new("held")
    }

    fn read(
        &self,
        _progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        take(&self.0)
    }
}

fn tree_of_cloud(cloud: PointCloud, out: &Path) -> Result<Vec<String>, Error> {
    let notes = Notes::default();
    write_tree(vec![TreeInput::Clouds(Box::new(Held(cloud)))], out, &options(MEMORY), &notes)?;
    Ok(notes.notes.into_inner().unwrap())
}

/// A waved surface, denser to one side, with a few outliers.
fn surface(count: usize) -> PointCloud {
    let mut random = Random::from_state(3);
    let points = (0..count).map(|i| {
        let (x, y) = (40.0 * random.unit().powi(3), 40.0 * random.unit());
        let z = if i % 5000 == 7 { 40.0 * random.unit() } else { 3.0 * (0.3 * x).sin() + 2.0 * (0.2 * y).cos() };
        [x as f32, y as f32, z as f32]
    });
    let points: Vec<[f32; 3]> = points.collect();
    let colors = points.iter().map(|point| point.map(|at| (5.0 * at.abs()) as u8)).collect();
    let labels = FieldValues::F32((0..count).map(|i| i as f32).collect());
    PointCloud::new(DVec3::new(5e5, 5e6, 0.0), points).with_colors(colors).unwrap().with_field("Label", labels).unwrap()
}

fn read(path: &Path) -> PointCloud {
    read_with(path, &EXACT, &()).unwrap_or_else(|error| panic!("{error}"))
}

/// Asserts that both have the same points with the same values, in any order.
fn assert_same_points(name: &str, one: &PointCloud, other: &PointCloud) {
    // Times and flags that are zero at every point are no fields; angles have other steps.
    let names = |cloud: &PointCloud| -> Vec<String> {
        let names = cloud.fields().iter().map(|field| field.name.clone());
        names.filter(|name| name != "ScanAngleRank").collect()
    };
    let (mut own, mut others) = (names(one), names(other));
    own.sort();
    others.sort();
    assert_eq!(own, others, "{name}: the same fields");
    assert!(
        rows(std::slice::from_ref(one), &own) == rows(std::slice::from_ref(other), &own),
        "{name}: the same values"
    );
    let angles = |cloud: &PointCloud| -> Option<Vec<i64>> {
        let values = &cloud.field("ScanAngleRank")?.values;
        let mut angles: Vec<i64> = (0..cloud.len()).map(|i| values.get(i).round() as i64).collect();
        angles.sort_unstable();
        Some(angles)
    };
    assert_eq!(angles(one), angles(other), "{name}: the same angles");
}

#[test]
fn every_point_keeps_all_its_values() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.copc.laz");
    let Some(data) = shared_data() else { return };
    let files = [
        "autzen_thin.las",
        "autzen_trim.laz",
        "ign_lambert93_extrabytes.laz",
        "lion_takanawa.copc.laz",
        "lone_star.copc.laz",
        "simple_1065.las",
    ];
    for name in files {
        let path = data.join("scans").join(name);
        tree_of(std::slice::from_ref(&path), &out, &options(MEMORY)).unwrap();
        let (before, after) = (read(&path), read(&out));
        assert_same_points(name, &before, &after);
        assert_eq!(before.resolution(), after.resolution(), "{name}: the same steps");
        assert_eq!(before.crs(), after.crs(), "{name}: the same coordinate system");
    }
}

#[test]
fn every_point_format_becomes_one_of_copc() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (folder.path().join("a.las"), folder.path().join("a.copc.laz"));
    for (format, becomes) in [(0, 6), (1, 6), (2, 7), (3, 7), (6, 6), (7, 7), (8, 8)] {
        for compressed in [false, true] {
            let version = if format < 6 { (1, 2) } else { (1, 4) };
            std::fs::write(&path, las_bytes(version, format, compressed, 3000)).unwrap();
            tree_of(std::slice::from_ref(&path), &out, &options(MEMORY)).unwrap();
            assert_same_points(&format!("format {format}"), &read(&path), &read(&out));
            assert_eq!(std::fs::read(&out).unwrap()[104], 0x80 | becomes, "format {format}");
        }
    }
}

#[test]
fn other_programs_read_all_of_it_and_parts() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.copc.laz");
    let cloud = surface(200_000);
    tree_of_cloud(cloud.clone(), &out).unwrap();
    let mut theirs = las::copc::CopcReader::from_path(&out).unwrap();
    let all = theirs.query(las::copc::LodSelection::All, las::copc::BoundsSelection::All).unwrap();
    assert_eq!(all.points().count(), cloud.len());
    let [low, high] = [DVec3::new(5e5 + 10.0, 5e6 + 5.0, -10.0), DVec3::new(5e5 + 20.0, 5e6 + 30.0, 10.0)];
    let corner = |at: DVec3| las::Vector { x: at.x, y: at.y, z: at.z };
    let bounds = las::Bounds { min: corner(low), max: corner(high) };
    let part = theirs.query(las::copc::LodSelection::All, las::copc::BoundsSelection::Within(bounds)).unwrap();
    let back = read(&out);
    let inside =
        (0..back.len()).map(|i| back.world_position(i)).filter(|at| at.cmpge(low).all() && at.cmple(high).all());
    assert_eq!(part.points().count(), inside.count());
}

/// Asserts that every point is inside its node's cube, and that no two points of an inner node share a cell. Returns
/// the number of points by level.
fn check_structure(path: &Path) -> Vec<usize> {
    let tree = open_tree(path, &()).unwrap().expect("it is COPC");
    let info = tree.info();
    assert_eq!(info.notes, Vec::<String>::new(), "nothing is odd");
    let keys = keys(&*tree);
    let mut levels = vec![0; 1 + keys.iter().map(|key| key.level as usize).max().unwrap()];
    for &key in &keys {
        let cloud = decoded(&*tree, key, &everything(true));
        let [low, high] = key.cube(info.cube);
        // Coordinates are multiples of a step, but for rounding.
        let slack = 1e-3 * info.resolution.unwrap();
        let is_leaf = !key.children().any(|child| keys.contains(&child));
        assert!(!is_leaf || cloud.len() <= 1 << 16, "{key} has {} points", cloud.len());
        let mut cells: HashMap<[i64; 3], u32> = HashMap::new();
        for i in 0..cloud.len() {
            let at = cloud.world_position(i);
            assert!(at.cmpge(low - slack).all() && at.cmple(high + slack).all(), "{key}: {at} in {low} to {high}");
            let cell = ((at - low + slack) / (high - low) * 128.0).floor();
            *cells.entry(cell.to_array().map(|at| at as i64)).or_default() += 1;
        }
        assert!(is_leaf || cells.values().all(|&count| count == 1), "{key}: cells of several points");
        levels[key.level as usize] += cloud.len();
    }
    levels
}

#[test]
fn levels_are_even_and_outliers_stay_below() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.copc.laz");
    // More than a part, so that nodes are joined above the parts.
    let count = 1_200_000;
    tree_of_cloud(surface(count), &out).unwrap();
    let levels = check_structure(&out);
    assert_eq!(levels.iter().sum::<usize>(), count);
    assert!(levels.len() > 3 && levels[0] > 3000, "{levels:?}");
    let tree = open_tree(&out, &()).unwrap().expect("it is COPC");
    let root = decoded(&*tree, Key::ROOT, &everything(false));
    let strays = root.positions().iter().filter(|point| f64::from(point[2]) + root.origin().z > 8.0).count();
    assert!(strays * 10 < count / 5000, "{strays} outliers are in the root");
}

#[test]
fn bytes_depend_on_the_points_alone() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.copc.laz");
    let parts: Vec<PathBuf> = (0..3)
        .map(|part| {
            let path = folder.path().join(format!("{part}.laz"));
            let mut cloud = surface(1_000_000);
            cloud.retain(|index| index % 3 == part);
            write(&cloud, &path, &()).unwrap();
            path
        })
        .collect();
    let make = |order: [usize; 3], threads: usize, memory: u64| {
        let files = order.map(|part| parts[part].clone());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| tree_of(&files, &out, &options(memory))).unwrap();
        std::fs::read(&out).unwrap()
    };
    let first = make([0, 1, 2], 2, MEMORY);
    for (order, threads, memory) in [([2, 0, 1], 1, MEMORY), ([1, 2, 0], 8, MEMORY), ([0, 1, 2], 2, 160 << 20)] {
        assert!(make(order, threads, memory) == first, "{order:?}, {threads} threads, {memory} bytes");
    }
}

#[test]
fn headers_that_lie_about_bounds_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (folder.path().join("a.las"), folder.path().join("a.copc.laz"));
    let good = las_bytes((1, 2), 3, false, 5000);
    let bounds = |at: usize, value: f64| {
        let mut bytes = good.clone();
        bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
        bytes
    };
    // Greatest x far too large and too small, and NaN.
    for (what, bytes) in [("wide", bounds(179, 2.5e6)), ("narrow", bounds(179, 5e5)), ("none", bounds(187, f64::NAN))] {
        std::fs::write(&path, &bytes).unwrap();
        let notes = tree_of(std::slice::from_ref(&path), &out, &options(MEMORY)).unwrap();
        assert_eq!(notes.iter().any(|note| note.contains("bounds")), what != "none", "{what}: {notes:?}");
        check_structure(&out);
        assert_same_points(what, &read(&path), &read(&out));
        let side = open_tree(&out, &()).unwrap().expect("it is COPC").info().cube;
        assert!((side[1] - side[0]).x < 64.0, "{what}: {side:?}");
    }
}

#[test]
fn points_with_an_outline_are_read_once_unless_it_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let (one, other) = (folder.path().join("a.copc.laz"), folder.path().join("b.copc.laz"));
    // So many that steps are of the same size with each of the bounds.
    let cloud = surface(400_000);
    tree_of_cloud(cloud.clone(), &one).unwrap();
    let (low, high) = (0..cloud.len())
        .map(|i| cloud.world_position(i))
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let cube = |path: &Path| open_tree(path, &()).unwrap().expect("it is COPC").info().cube;
    for (name, bounds, reads) in [
        ("exact", [low, high], 1),
        ("a little wider", [low - 0.5, high + 0.5], 1),
        ("too narrow, but not beyond the cube", [low, high - DVec3::X], 1),
        ("too narrow", [low + DVec3::X, high], 3),
        ("four times too wide", [low - 65.0, high + 65.0], 2),
    ] {
        let outlined = Outlined { cloud: cloud.clone(), bounds, reads: AtomicUsize::new(0) };
        let input = TreeInput::Clouds(Box::new(&outlined));
        write_tree(vec![input], &other, &options(MEMORY), &()).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(outlined.reads.into_inner(), reads, "{name}");
        assert_same_points(name, &read(&one), &read(&other));
        let [[low, high], [other_low, other_high]] = [&one, &other].map(|path| cube(path));
        let same_size = (high - low).abs_diff_eq(other_high - other_low, 1e-9);
        assert!(same_size, "{name}: {other_low} to {other_high} instead of {low} to {high}");
    }
}

#[test]
fn few_points_and_many_at_one_place() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.copc.laz");
    let at = |places: Vec<[f32; 3]>| PointCloud::new(DVec3::new(1.0, 2.0, 3.0), places);
    tree_of_cloud(at(vec![[0.5; 3]]), &out).unwrap();
    assert_eq!(read(&out).world_position(0), DVec3::new(1.5, 2.5, 3.5), "one point");
    let count = 1_200_000;
    tree_of_cloud(at(vec![[0.25; 3]; count]), &out).unwrap();
    assert_eq!(read(&out).len(), count, "all at one place");
    let mut places = vec![[0.0; 3]; count];
    places[7] = [1e3; 3];
    tree_of_cloud(at(places), &out).unwrap();
    assert_eq!(read(&out).len(), count, "all but one at one place");
    let error = tree_of_cloud(at(Vec::new()), &out).unwrap_err().to_string();
    assert!(error.contains("no points"), "{error}");
    let mut places = vec![[0.5; 3]; 10];
    places[3] = [f32::NAN; 3];
    let notes = tree_of_cloud(at(places), &out).unwrap();
    assert_eq!((read(&out).len(), notes.len()), (9, 1), "{notes:?}");
}

#[test]
fn points_are_chosen_on_the_way() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (folder.path().join("a.laz"), folder.path().join("a.copc.laz"));
    std::fs::write(&path, las_bytes((1, 2), 3, true, 5000)).unwrap();
    let keep: PointFilter = "2..4".parse().unwrap();
    let mut expected = read_with(&path, &ReadOptions { keep: Some(keep.clone()), ..EXACT }, &()).unwrap();
    let [low, high] = [DVec3::new(5e5 - 9.0, 5e6 - 9.0, -9.0), DVec3::new(5e5 + 7.0, 5e6 + 9.0, 9.0)];
    expected.crop(low, high);
    assert!(expected.len() > 100, "{} are left", expected.len());
    let some = TreeOptions { keep: Some(keep), bounds: Some([low, high]), ..options(MEMORY) };
    let notes = tree_of(std::slice::from_ref(&path), &out, &some).unwrap();
    assert!(notes.iter().any(|note| note.contains("--keep 2..4")), "{notes:?}");
    assert_same_points("chosen", &expected, &read(&out));
    let nowhere = TreeOptions { bounds: Some([DVec3::ZERO, DVec3::ONE]), ..options(MEMORY) };
    let error = tree_of(std::slice::from_ref(&path), &out, &nowhere).unwrap_err().to_string();
    assert!(error.contains("none of the 5000 points"), "{error}");
}

#[test]
fn what_cannot_be_joined_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.copc.laz");
    let place = |name: &str, wkt: Option<&str>, offset: DVec3, step: f64| {
        let path = folder.path().join(name);
        let mut cloud = surface(2000).with_resolution(DVec3::splat(step));
        if let Some(wkt) = wkt {
            cloud = cloud.with_crs(autosplats_cloud::Crs::from_wkt(wkt));
        }
        write(&PointCloud::merge(vec![(cloud, DMat4::from_translation(offset))]), &path, &()).unwrap();
        path
    };
    let utm = |zone: u32| format!(r#"PROJCS["zone {zone}",UNIT["metre",1],AUTHORITY["EPSG","326{zone}"]]"#);
    let one = place("1.las", Some(&utm(32)), DVec3::ZERO, 0.001);
    let other = place("2.las", Some(&utm(33)), DVec3::ZERO, 0.001);
    let error = tree_of(&[one.clone(), other], &out, &options(MEMORY)).unwrap_err().to_string();
    assert!(error.contains("EPSG:32633") && error.contains("EPSG:32632"), "{error}");
    let far = place("3.las", Some(&utm(32)), DVec3::splat(1e8), 0.001);
    let error = tree_of(&[one, far], &out, &options(MEMORY)).unwrap_err().to_string();
    assert!(error.contains("steps"), "{error}");
    assert!(!out.exists(), "nothing was written");
}

/// Cancels after some reports.
struct Impatient(AtomicUsize);

impl Progress for Impatient {
    fn report(&self, _fraction: f32) {}

    fn cancelled(&self) -> bool {
        self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_err()
    }
}

#[test]
fn nothing_is_left_behind() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.copc.laz");
    let left = || std::fs::read_dir(folder.path()).unwrap().count();
    for patience in [0, 3, 8] {
        let clouds = TreeInput::Clouds(Box::new(Held(surface(200_000))));
        let outcome = write_tree(vec![clouds], &out, &options(MEMORY), &Impatient(AtomicUsize::new(patience)));
        assert!(matches!(outcome, Err(Error::Cancelled)), "after {patience}: {outcome:?}");
        assert_eq!(left(), 0, "after {patience}");
    }
    let clouds = || vec![TreeInput::Clouds(Box::new(Held(surface(1000))))];
    let missing = TreeOptions { temp: Some(folder.path().join("missing")), ..options(MEMORY) };
    assert!(matches!(write_tree(clouds(), &out, &missing, &()), Err(Error::Io { .. })), "no folder");
    let error = write_tree(clouds(), &out, &options(1 << 20), &()).unwrap_err();
    assert!(matches!(error, Error::OutOfMemory { .. }), "{error}");
    assert_eq!(left(), 0);
}
