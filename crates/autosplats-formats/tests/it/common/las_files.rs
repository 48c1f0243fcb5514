//! Hand-made LAS files, and the notes about them.

use std::{path::Path, sync::Mutex};

use autosplats_cloud::{PointCloud, Progress};
use autosplats_formats::{Description, ReadOptions, describe_bytes, read_bytes, write};

/// Stores the notes of readers and writers.
#[derive(Default)]
pub(crate) struct Notes {
    pub(crate) notes: Mutex<Vec<String>>,
    pub(crate) chunks: Mutex<Vec<PointCloud>>,
    pub(crate) wants_chunks: bool,
}

impl Progress for Notes {
    fn report(&self, _fraction: f32) {}

    fn note(&self, note: &str) {
        self.notes.lock().unwrap().push(note.into());
    }

    fn wants_chunks(&self) -> bool {
        self.wants_chunks
    }

    fn chunk(&self, points: PointCloud) {
        self.chunks.lock().unwrap().push(points);
    }
}

pub(crate) const EXACT: ReadOptions = ReadOptions {
    exact: true,
    keep_no_returns: true,
    columns: None,
    keep: None,
    whole: false,
    headers: Vec::new(),
    depth_camera: None,
};

pub(crate) fn load(bytes: &[u8]) -> (PointCloud, Vec<String>) {
    let notes = Notes::default();
    let cloud = read_bytes(Path::new("a.las"), bytes, &EXACT, &notes).unwrap_or_else(|error| panic!("{error}"));
    (cloud, notes.notes.into_inner().unwrap())
}

pub(crate) fn about(bytes: &[u8]) -> Description {
    describe_bytes(Path::new("a.las"), bytes, &EXACT).unwrap_or_else(|error| panic!("{error}"))
}

/// Writes a cloud, and returns the bytes and the notes.
pub(crate) fn written(cloud: &PointCloud, name: &str) -> (Vec<u8>, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let notes = Notes::default();
    write(cloud, &path, &notes).unwrap_or_else(|error| panic!("{error}"));
    (std::fs::read(path).unwrap(), notes.notes.into_inner().unwrap())
}

pub(crate) fn values(cloud: &PointCloud, name: &str) -> Vec<f64> {
    let names: Vec<_> = cloud.fields().iter().map(|field| &field.name).collect();
    let field = cloud.field(name).unwrap_or_else(|| panic!("no {name} in {names:?}"));
    (0..cloud.len()).map(|i| field.values.get(i)).collect()
}

/// A hand-made LAS file: header, variable length records, point records.
pub(crate) fn file(version: u8, format: u8, records: &[(&str, u16, Vec<u8>)], points: &[Vec<u8>]) -> Vec<u8> {
    let header = if version >= 4 { 375 } else { 227 };
    let mut vlrs = Vec::new();
    for (user, id, data) in records {
        vlrs.extend([0; 2]);
        let mut name = [0; 16];
        name[..user.len()].copy_from_slice(user.as_bytes());
        vlrs.extend(name);
        vlrs.extend(id.to_le_bytes());
        vlrs.extend((data.len() as u16).to_le_bytes());
        vlrs.extend([0; 32]);
        vlrs.extend(data);
    }
    let mut bytes = vec![0; header];
    let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    put(0, b"LASF");
    put(24, &[1, version]);
    put(58, b"by hand");
    put(90, &60_u16.to_le_bytes());
    put(92, &2024_u16.to_le_bytes());
    put(94, &(header as u16).to_le_bytes());
    put(96, &((header + vlrs.len()) as u32).to_le_bytes());
    put(100, &(records.len() as u32).to_le_bytes());
    put(104, &[format]);
    put(105, &(points[0].len() as u16).to_le_bytes());
    put(107, &(points.len() as u32).to_le_bytes());
    for axis in 0..3 {
        put(131 + 8 * axis, &0.5_f64.to_le_bytes());
        put(155 + 8 * axis, &100_f64.to_le_bytes());
    }
    if version >= 4 {
        put(247, &(points.len() as u64).to_le_bytes());
    }
    bytes.extend(vlrs);
    bytes.extend(points.concat());
    bytes
}

/// Descriptor of an extra value.
pub(crate) fn extra(
    kind: u8,
    options: u8,
    name: &str,
    no_data: [[u8; 8]; 3],
    scale: [f64; 3],
    offset: [f64; 3],
) -> Vec<u8> {
    let mut raw = vec![0; 192];
    raw[2] = kind;
    raw[3] = options;
    raw[4..4 + name.len()].copy_from_slice(name.as_bytes());
    raw[40..64].copy_from_slice(no_data.as_flattened());
    raw[112..136].copy_from_slice(scale.map(f64::to_le_bytes).as_flattened());
    raw[136..160].copy_from_slice(offset.map(f64::to_le_bytes).as_flattened());
    raw
}

pub(crate) const NONE: [[u8; 8]; 3] = [[0; 8]; 3];
