//! Tests of LAS and LAZ files whose counts, chunk tables and bounds are not what they should be.

use std::path::Path;

use autosplats_cloud::PointCloud;
use autosplats_formats::{ReadOptions, read_bytes};

use crate::common::{
    field_file, las_bytes,
    las_files::{about, file, load},
};

fn message(bytes: &[u8]) -> String {
    let result = read_bytes(Path::new("a.laz"), bytes, &ReadOptions::default(), &());
    result.map(|cloud| cloud.len()).unwrap_err().to_string()
}

fn told(notes: &[String], words: &str) -> bool {
    notes.iter().any(|note| note.contains(words))
}

fn same_points(a: &PointCloud, b: &PointCloud) -> bool {
    (0..a.len()).all(|i| a.world_position(i) == b.world_position(i))
}

/// Sets the number of points in the header: the short one, and the long one of LAS 1.4.
fn set_count(bytes: &mut [u8], short: u32, long: u64) {
    bytes[107..111].copy_from_slice(&short.to_le_bytes());
    if bytes[25] >= 4 {
        bytes[247..255].copy_from_slice(&long.to_le_bytes());
    }
}

fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

/// First byte of the points, and first byte of the chunk table.
fn places(laz: &[u8]) -> (usize, usize) {
    let start = word(laz, 96);
    (start, i64::from_le_bytes(laz[start..start + 8].try_into().unwrap()) as usize)
}

#[test]
fn field_files_of_the_las_family() {
    for (name, count, words) in [
        ("l12f_count_zero_streamed.las", 6000, "the header states 0 points, but 6000 are there; all are read"),
        ("z1_no_chunktable_trunc_3.laz", 100_000, "2 whole chunks are found"),
        ("z3_chunktable_zeroed_3.laz", 130_000, "3 whole chunks are found"),
        ("z3_chunktable_zeroed_7.laz", 130_000, "3 whole chunks are found"),
        ("l10c_dbl_max_bounds.las", 6000, ""),
    ] {
        let Some(bytes) = field_file(name) else { return };
        let (cloud, notes) = load(&bytes);
        assert_eq!(cloud.len(), count, "{name}");
        assert!(told(&notes, words) || words.is_empty(), "{name}: {notes:?}");
        let description = about(&bytes);
        for text in notes.iter().chain(&description.notes).chain(description.details.iter().map(|(_, value)| value)) {
            assert!(text.len() < 160, "{name}: a short message, not {text}");
        }
        assert_eq!(description.bounds.is_none(), name.starts_with("l1"), "{name}");
    }
}

#[test]
fn a_count_of_zero_before_records() {
    for (version, format) in
        [((1, 0), 0), ((1, 2), 1), ((1, 2), 3), ((1, 4), 3), ((1, 4), 6), ((1, 4), 7), ((1, 4), 10)]
    {
        let mut bytes = las_bytes(version, format, false, 1000);
        let whole = load(&bytes).0;
        set_count(&mut bytes, 0, 0);
        let (cloud, notes) = load(&bytes);
        assert!(cloud.len() == 1000 && same_points(&cloud, &whole), "{version:?} {format}: {} points", cloud.len());
        assert!(told(&notes, "states 0 points, but 1000 are there"), "{notes:?}");
        let description = about(&bytes);
        assert_eq!((description.points, description.bounds), (Some(1000), None), "{version:?} {format}");
        assert!(told(&description.notes, "states 0 points"), "{:?}", description.notes);
        bytes.truncate(bytes.len() - 1);
        assert_eq!(load(&bytes).0.len(), 999, "{version:?} {format}: whole records");
        let start = word(&bytes, 96);
        bytes.truncate(start);
        let (cloud, notes) = load(&bytes);
        assert!(cloud.is_empty() && !told(&notes, "states"), "{version:?} {format}: no record: {notes:?}");
        // Extended records behind the points are no points.
        if version == (1, 4) {
            let mut bytes = las_bytes(version, format, false, 50);
            let end = bytes.len() as u64;
            set_count(&mut bytes, 0, 0);
            bytes[235..243].copy_from_slice(&end.to_le_bytes());
            bytes[243..247].copy_from_slice(&1_u32.to_le_bytes());
            bytes.extend([0; 260]);
            bytes[end as usize + 20..][..8].copy_from_slice(&200_u64.to_le_bytes());
            assert_eq!(load(&bytes).0.len(), 50, "{format}: {:?}", load(&bytes).1);
        }
    }
}

#[test]
fn a_count_that_is_too_small() {
    for (version, format) in [((1, 2), 1), ((1, 4), 7)] {
        let mut bytes = las_bytes(version, format, false, 1000);
        set_count(&mut bytes, if version == (1, 4) { 0 } else { 600 }, 600);
        let (cloud, notes) = load(&bytes);
        assert_eq!(cloud.len(), 600, "{version:?}: as stated");
        assert!(told(&notes, "states 600 points, but 1000 are there; the others are left out"), "{notes:?}");
        assert!(told(&about(&bytes).notes, "but 1000 are there"), "{:?}", about(&bytes).notes);
        for (count, stated) in [(120_000, 60_000), (120_000, 100_000), (20_000, 10_000)] {
            let mut bytes = las_bytes(version, format, true, count);
            assert!(load(&bytes).1.is_empty(), "nothing is wrong");
            set_count(&mut bytes, if version == (1, 4) { 0 } else { stated }, stated.into());
            let (cloud, notes) = load(&bytes);
            assert_eq!(cloud.len(), stated as usize, "{version:?}: as stated");
            assert!(told(&notes, "the compressed data hold more"), "{version:?}: {stated} of {count}: {notes:?}");
        }
    }
}

#[test]
fn a_count_of_zero_before_compressed_records() {
    for (version, format) in [((1, 2), 0), ((1, 2), 3), ((1, 4), 6), ((1, 4), 8)] {
        for count in [1, 20_000, 100_000, 120_000] {
            let mut bytes = las_bytes(version, format, true, count);
            let whole = load(&bytes).0;
            set_count(&mut bytes, 0, 0);
            let (cloud, notes) = load(&bytes);
            assert_eq!(cloud.len(), count, "{version:?} {format}: {notes:?}");
            assert!(same_points(&cloud, &whole), "{version:?} {format}");
            assert!(told(&notes, &format!("states 0 points, but {count} are there")), "{notes:?}");
            // Without table, only layers tell how many points there are.
            let (start, table) = places(&bytes);
            bytes[start..start + 8].fill(0xff);
            bytes.truncate(table);
            if format < 6 {
                assert!(message(&bytes).contains("chunk table"), "{}", message(&bytes));
            } else {
                assert_eq!(load(&bytes).0.len(), count, "{format}");
            }
        }
        let mut empty = las_bytes(version, format, true, 1);
        set_count(&mut empty, 0, 0);
        let (start, _) = places(&empty);
        empty.truncate(start);
        assert!(load(&empty).0.is_empty(), "{version:?} {format}: no points");
    }
}

#[test]
fn chunks_without_a_table() {
    for (version, format) in [((1, 2), 0), ((1, 2), 1), ((1, 2), 2), ((1, 2), 3), ((1, 4), 6), ((1, 4), 7), ((1, 4), 8)]
    {
        let whole_bytes = las_bytes(version, format, true, 120_000);
        let whole = load(&whole_bytes).0;
        let (start, table) = places(&whole_bytes);
        let changed = |change: &dyn Fn(&mut Vec<u8>)| {
            let mut bytes = whole_bytes.clone();
            change(&mut bytes);
            bytes
        };
        let beyond = (whole_bytes.len() as u64 + 99).to_le_bytes();
        // Only what follows tells that the last chunk is whole, if it is not in layers.
        let unsure = if format < 6 { 100_000 } else { 120_000 };
        let cases: [(&str, Vec<u8>, usize); 7] = [
            ("zeros", changed(&|bytes| bytes[table..].fill(0)), 120_000),
            ("lengths of zero", changed(&|bytes| bytes[table + 8..].fill(0)), 120_000),
            ("huge lengths", changed(&|bytes| bytes[table + 8..].fill(0xff)), 120_000),
            ("no offset", changed(&|bytes| bytes[start..start + 8].fill(0xff)), 120_000),
            ("an offset beyond the end", changed(&|bytes| bytes[start..start + 8].copy_from_slice(&beyond)), 120_000),
            ("no table", changed(&|bytes| bytes.truncate(table)), unsure),
            ("a cut chunk", changed(&|bytes| bytes.truncate(table - 100)), 100_000),
        ];
        for (what, bytes, count) in cases {
            let (cloud, notes) = load(&bytes);
            assert_eq!(cloud.len(), count, "{format}, {what}: {notes:?}");
            assert!(same_points(&cloud, &whole), "{format}, {what}");
            assert!(told(&notes, "table of the compressed chunks cannot be used"), "{format}, {what}: {notes:?}");
            let lost = format!("{} of 120000 points are lost", 120_000 - count);
            assert_eq!(told(&notes, &lost), count < 120_000, "{format}, {what}: {notes:?}");
            assert_eq!(about(&bytes).points, Some(120_000), "{format}, {what}");
        }
        let first = changed(&|bytes| bytes.truncate(start + 50));
        assert!(message(&first).contains("cut off"), "{format}: no whole chunk: {}", message(&first));
    }
}

#[test]
fn messages_of_extreme_values_are_short() {
    for extreme in [f64::MAX, f64::MIN, f64::NAN, f64::INFINITY, 1e300, 1e-300] {
        let mut bytes = file(2, 0, &[], &[vec![1; 20], vec![2; 20]]);
        for at in (179..227).step_by(8) {
            bytes[at..at + 8].copy_from_slice(&extreme.to_le_bytes());
        }
        let description = about(&bytes);
        assert!(told(&description.notes, "bounds in the header cannot be those of the points") || extreme == 1e-300);
        assert!(description.notes.iter().all(|note| note.len() < 100), "{:?}", description.notes);
        assert_eq!(load(&bytes).0.len(), 2, "read all the same");
        bytes[131..139].copy_from_slice(&0.0_f64.to_le_bytes());
        bytes[155..163].copy_from_slice(&extreme.to_le_bytes());
        let message = message(&bytes);
        assert!(message.contains("invalid scale 0, 0.5, 0.5") && message.len() < 120, "{message}");
    }
}
