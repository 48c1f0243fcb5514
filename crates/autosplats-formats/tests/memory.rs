//! Measures the memory that reading takes, in a separate process.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

#[path = "it/common/mod.rs"]
mod common;

use autosplats_cloud::{FieldValues, PointCloud, glam::DVec3};
use autosplats_formats::write;
use common::{positions, read_bytes};

/// A value of `/proc/self/status` in kilobytes.
fn status(name: &str) -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

#[test]
fn points_that_are_only_claimed_take_no_memory() {
    // Two chunks, the first with 8-bit colours and the second with a wider one.
    const CHUNK: usize = 50_000;
    const CLAIMED: u32 = 40_000_000;
    let channel = |i: usize| if i == 2 * CHUNK - 1 { 60_000_u16 } else { 200 };
    let bytes = (0..2 * CHUNK).map(|i| [(channel(i) >> 8) as u8; 3]).collect();
    let mut cloud = PointCloud::new(DVec3::ZERO, positions(2 * CHUNK)).with_colors(bytes).unwrap();
    for name in ["Red", "Green", "Blue"] {
        let values = (0..2 * CHUNK).map(channel).collect();
        cloud = cloud.with_field(name, FieldValues::U16(values)).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.laz");
    write(&cloud, &path, &()).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let user = bytes.windows(14).position(|word| word == b"laszip encoded").unwrap();
    let mut put = |at: usize, value: u32| bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    // Length of chunks in the compression record, and the number of points.
    put(user + 52 + 12, CLAIMED);
    put(107, CLAIMED + CHUNK as u32);

    let before = status("VmRSS");
    let cloud = read_bytes("a.laz", &bytes).unwrap();
    assert!((2 * CHUNK..2 * CHUNK + 1000).contains(&cloud.len()), "{} points are real", cloud.len());
    assert_eq!(cloud.colors().unwrap()[CHUNK - 1], [0; 3], "one large value makes the others small");
    let (Some(before), Some(peak)) = (before, status("VmHWM")) else { return };
    // One byte per claimed point would be 40 MB. The real points need a tenth of that.
    assert!(peak < before + 30_000, "{} kB more for a file of {} kB", peak - before, bytes.len() / 1000);
}
