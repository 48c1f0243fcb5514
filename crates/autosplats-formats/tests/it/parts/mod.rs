//! Files read in parts: the same points as of the whole file, bit for bit, with the same notes and errors.

use std::{
    path::{Path, PathBuf},
    sync::Mutex,
};

use autosplats_cloud::{Clouds, Error, FieldValues, PointCloud, PointFilter, Progress, Scan, glam::DVec3};
use autosplats_formats::{
    Parts, ReadOptions, Unpacking, open_parts, open_parts_of, open_parts_unpacked, read_with, write,
};

use crate::common::{positions, shared_data};

mod kinds;

/// Points of a generated file.
const COUNT: usize = 2000;

/// Sizes of parts: a few lines, some thousand records, and everything.
const SIZES: [usize; 3] = [1000, 20_000, 1 << 23];

#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Progress for Notes {
    fn report(&self, fraction: f32) {
        assert!((0.0..=1.0).contains(&fraction), "the fraction {fraction}");
    }

    fn note(&self, note: &str) {
        self.0.lock().unwrap().push(note.into());
    }
}

impl Notes {
    fn sorted(self) -> Vec<String> {
        let mut notes = self.0.into_inner().unwrap();
        notes.sort();
        notes
    }
}

/// The bytes of all values, since NaN is not equal to itself.
fn bits(values: &FieldValues) -> (&'static str, Vec<u8>) {
    macro_rules! bits {
        ($($variant:ident),*) => {
            match values {
                $(FieldValues::$variant(values) => {
                    (stringify!($variant), values.iter().flat_map(|value| value.to_le_bytes()).collect())
                })*
            }
        };
    }
    bits!(U8, I8, U16, I16, U32, I32, U64, I64, F32, F64)
}

fn float_bits(values: &[[f32; 3]]) -> Vec<[u32; 3]> {
    values.iter().map(|value| value.map(f32::to_bits)).collect()
}

/// Names and types of the attributes.
fn shape(cloud: &PointCloud) -> (bool, bool, Vec<(&str, &str)>) {
    let fields = cloud.fields().iter().map(|field| (&*field.name, bits(&field.values).0)).collect();
    (cloud.residuals().is_some(), cloud.colors().is_some(), fields)
}

/// Scans of the same sensor, one after another, as one.
fn joined(scans: &[Scan]) -> Vec<Scan> {
    let mut all: Vec<Scan> = Vec::new();
    for scan in scans.iter().filter(|scan| !scan.points.is_empty()) {
        match all.last_mut() {
            Some(last)
                if last.points.end == scan.points.start
                    && (&last.name, last.world_from_sensor) == (&scan.name, scan.world_from_sensor) =>
            {
                last.points.end = scan.points.end;
            }
            _ => all.push(scan.clone()),
        }
    }
    all
}

fn assert_same(found: &PointCloud, expected: &PointCloud, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}: number of points");
    assert_eq!(found.origin(), expected.origin(), "{what}: origin");
    assert_eq!(shape(found), shape(expected), "{what}: attributes");
    assert!(float_bits(found.positions()) == float_bits(expected.positions()), "{what}: positions");
    let residuals = |cloud: &PointCloud| cloud.residuals().map(float_bits);
    assert!(residuals(found) == residuals(expected), "{what}: residuals");
    assert!(found.colors() == expected.colors(), "{what}: colours");
    for (field, other) in found.fields().iter().zip(expected.fields()) {
        assert!(bits(&field.values) == bits(&other.values), "{what}: field {}", field.name);
    }
    let facts = |cloud: &PointCloud| (cloud.axes(), cloud.crs().clone(), cloud.resolution());
    assert_eq!(facts(found), facts(expected), "{what}: axes and coordinate system");
    assert_eq!(joined(found.scans()), joined(expected.scans()), "{what}: scans that have points");
}

/// How a file is read in parts.
#[derive(Clone, Copy, Debug)]
enum How {
    /// So many bytes at a time.
    Bytes(usize),
    /// The usual number, decompressed once. So many bytes of the disk stay free.
    Unpacked(u64),
}

impl How {
    fn open(self, path: &Path, options: &ReadOptions, notes: &Notes) -> Result<Option<Parts>, Error> {
        match self {
            Self::Bytes(size) => open_parts_of(path, options, size, notes),
            Self::Unpacked(leave) => {
                let unpacking = Unpacking { folder: &std::env::temp_dir(), leave };
                open_parts_unpacked(path, options, unpacking, notes)
            }
        }
    }
}

/// Compares a file in parts of each size with the whole. Returns false if it has to be read whole.
fn check(path: &Path, options: &ReadOptions) -> bool {
    let notes = Notes::default();
    let whole = read_with(path, options, &notes);
    let notes = notes.sorted();
    let len = std::fs::metadata(path).unwrap().len();
    let sizes = SIZES.into_iter().filter(|size| len < 1000 * *size as u64).map(How::Bytes);
    // No disk leaves as much free as the second states, so LAZ is decompressed each time.
    let is_laz = path.extension().is_some_and(|extension| extension == "laz");
    let unpacked = [0, u64::MAX].map(How::Unpacked).into_iter().filter(|_| is_laz);
    for how in sizes.chain(unpacked) {
        let what = format!("{} in parts of {how:?}, {options:?}", path.display());
        let own = Notes::default();
        let parts = match (how.open(path, options, &own), &whole) {
            (Ok(None), _) => {
                assert_eq!(own.sorted(), [""; 0], "{what}: notes of what is read whole");
                return false;
            }
            (Ok(Some(parts)), _) => parts,
            (Err(error), Err(expected)) => {
                assert_eq!(error.to_string(), expected.to_string(), "{what}");
                continue;
            }
            (Err(error), Ok(_)) => panic!("{what}: {error}"),
        };
        let whole = whole.as_ref().unwrap_or_else(|error| panic!("{what}: no error, but {error}"));
        assert_eq!(own.sorted(), notes, "{what}: notes");
        // Parts are the same each time.
        let twice =
            matches!(how, How::Bytes(size) if size == SIZES[1] && len < 100_000) || matches!(how, How::Unpacked(0));
        for _ in 0..if twice { 2 } else { 1 } {
            let again = Notes::default();
            let mut clouds = Vec::new();
            parts
                .read(&again, &mut |cloud| {
                    clouds.push(cloud.clone());
                    Ok(())
                })
                .unwrap();
            assert_eq!(again.sorted(), [""; 0], "{what}: notes while reading");
            assert_eq!(parts.points(), whole.len(), "{what}: number of points");
            if let Some(first) = clouds.first() {
                for cloud in &clouds {
                    assert!(!cloud.is_empty() && shape(cloud) == shape(first), "{what}: each part");
                    assert_eq!((cloud.origin(), cloud.crs()), (first.origin(), first.crs()), "{what}: each part");
                }
                assert_same(&PointCloud::joined(clouds.iter()), whole, &what);
            }
        }
    }
    true
}

/// Checks a file of such bytes with some options. Returns false if it has to be read whole.
fn check_bytes(name: &str, bytes: &[u8]) -> bool {
    let default = ReadOptions::default;
    let options = [
        ReadOptions { exact: true, ..default() },
        ReadOptions { keep_no_returns: true, ..default() },
        ReadOptions { keep: Some(PointFilter::usual()), ..default() },
    ];
    check_bytes_with(name, bytes, &options)
}

fn check_bytes_with(name: &str, bytes: &[u8], options: &[ReadOptions]) -> bool {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    options.iter().filter(|options| check(&path, options)).count() > 0
}

/// Filters, one of which keeps no point.
fn filters() -> Vec<ReadOptions> {
    let keep = |words: &str| Some(words.parse::<PointFilter>().unwrap());
    let options = ["ground,-withheld", "-5,-withheld", "7", "66", "2..7"];
    options.map(|words| ReadOptions { keep: keep(words), exact: true, ..ReadOptions::default() }).into()
}

fn files_in(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { files_in(&path, found) } else { found.push(path) }
    }
}

#[test]
fn real_files() {
    let Some(data) = shared_data() else { return };
    let mut files = Vec::new();
    files_in(&data, &mut files);
    files_in(&data.join("../field"), &mut files);
    files.sort();
    let mut in_parts = 0;
    for path in files {
        // One frame of each animation is enough.
        if path.to_string_lossy().contains("/animation/") && !path.ends_with("frame_000.ply") {
            continue;
        }
        let exact = ReadOptions { exact: true, ..ReadOptions::default() };
        let usual = ReadOptions { keep: Some(PointFilter::usual()), ..ReadOptions::default() };
        in_parts += [exact, usual].iter().filter(|options| check(&path, options)).count();
    }
    assert!(in_parts > 100, "only {in_parts} of the real files are read in parts");
}

#[test]
fn what_is_no_file_of_points_in_parts_is_read_whole_or_fails_alike() {
    let cube = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n";
    assert!(!check_bytes("cube.obj", cube), "a mesh");
    let ply = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    assert!(!check_bytes("mesh.ply", ply), "a mesh");
    for bytes in [&b""[..], b"ply\n", b"words alone\n", b"1 2\n", b"5\n1 2 3\n", b"\x1f\x8b\x08\x00"] {
        check_bytes("bad.ply", bytes);
        check_bytes("bad.xyz", bytes);
    }
}

/// Three chunks.
#[test]
fn compressed_files_are_decompressed_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    let count = 120_000;
    let colors = (0..count).map(|i| [i as u8, (i >> 8) as u8, 7]).collect();
    let classes = FieldValues::U8((0..count).map(|i| (i % 5) as u8).collect());
    let cloud = PointCloud::new(DVec3::new(5e5, 5e6, 0.0), positions(count)).with_colors(colors).unwrap();
    write(&cloud.with_field("Classification", classes).unwrap(), &path, &()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert!(check_bytes("a.laz", &bytes));
}

#[test]
fn a_file_that_changes_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    write(&PointCloud::new(DVec3::ZERO, positions(COUNT)), &path, &()).unwrap();
    let parts = open_parts(&path, &ReadOptions::default(), &()).unwrap().expect("it is a PLY");
    assert_eq!(Clouds::name(&parts), path);
    let count = || {
        let mut points = 0;
        parts.read(&(), &mut |cloud| {
            points += cloud.len();
            Ok(())
        })?;
        Ok::<_, Error>(points)
    };
    assert_eq!(count().unwrap(), COUNT);
    write(&PointCloud::new(DVec3::ZERO, positions(COUNT + 1)), &path, &()).unwrap();
    let error = count().unwrap_err().to_string();
    assert!(error.contains("a.ply") && error.contains("changed"), "{error}");
    std::fs::remove_file(&path).unwrap();
    assert!(matches!(count(), Err(Error::Io { .. })), "it is gone");
}

#[test]
fn reading_can_be_cancelled() {
    struct Cancelled;
    impl Progress for Cancelled {
        fn report(&self, _fraction: f32) {}

        fn cancelled(&self) -> bool {
            true
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    write(&PointCloud::new(DVec3::ZERO, positions(COUNT)), &path, &()).unwrap();
    assert!(matches!(open_parts(&path, &ReadOptions::default(), &Cancelled), Err(Error::Cancelled)));
    let parts = open_parts(&path, &ReadOptions::default(), &()).unwrap().expect("it is a PLY");
    assert!(matches!(parts.read(&Cancelled, &mut |_| panic!("no points are wanted")), Err(Error::Cancelled)));
}
