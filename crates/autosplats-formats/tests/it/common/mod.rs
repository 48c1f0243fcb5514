//! Shared by the tests of formats and sources: files in memory, and generators of files.

#![allow(dead_code, reason = "not every test uses all of it")]
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

#[path = "../../../../autosplats-cloud/tests/it/common/mod.rs"]
mod clouds;
pub(crate) mod las_files;
pub(crate) mod trees;

use autosplats_cloud::{Error, PointCloud, Random};
use autosplats_formats::read;

pub(crate) use self::clouds::*;

/// Reads `bytes` as a file of the given name.
pub(crate) fn read_bytes(name: &str, bytes: &[u8]) -> Result<PointCloud, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path, &())
}

/// The folder of real files, if present. In continuous integration it must be present.
pub(crate) fn shared_data() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("AUTOSPLATS_DATA").map_or_else(beside, PathBuf::from);
    if folder.join("README.md").exists() {
        return Some(folder);
    }
    assert!(std::env::var_os("CI").is_none(), "the shared files are not at {}", folder.display());
    // Bypasses the test harness, which hides what a passing test prints.
    let message = format!("SKIPPED: the shared files are not at {}; nothing is checked\n", folder.display());
    std::io::stderr().write_all(message.as_bytes()).unwrap();
    None
}

/// A file of the folder of field cases, which is beside that of real files.
pub(crate) fn field_file(name: &str) -> Option<Vec<u8>> {
    let path = shared_data()?.join("../field").join(name);
    Some(std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
}

/// The error message that reading `bytes` must give: one line that names the file.
pub(crate) fn error(name: &str, bytes: &[u8]) -> String {
    let message = match read_bytes(name, bytes) {
        Ok(cloud) => panic!("{name} was read: {} points", cloud.len()),
        Err(error) => error.to_string(),
    };
    assert!(message.contains(name), "the message names the file: {message}");
    assert!(!message.contains(char::is_control), "the message is one line of plain text: {message:?}");
    message
}

/// A LAS file of any version and point format from the `las` crate, optionally compressed.
pub(crate) fn las_bytes(version: (u8, u8), format: u8, compressed: bool, count: usize) -> Vec<u8> {
    let mut builder = las::Builder::from(version);
    builder.point_format = las::point::Format::new(format).unwrap();
    builder.point_format.is_compressed = compressed;
    let transform = |offset| las::Transform { scale: 0.001, offset };
    builder.transforms = las::Vector { x: transform(5e5), y: transform(5e6), z: transform(0.0) };
    let format = builder.point_format;
    let mut writer = las::Writer::new(std::io::Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    let mut random = Random::from_state(4);
    for ([x, y, z], [red, green, blue]) in positions(count).into_iter().zip(colors(count)) {
        let number = (random.modulo(3) + 1) as u8;
        let wide = |channel| u16::from(channel) << 8;
        let point = las::Point {
            x: 5e5 + f64::from(x),
            y: 5e6 + f64::from(y),
            z: z.into(),
            intensity: random.bits() as u16,
            return_number: number,
            number_of_returns: 3,
            classification: las::point::Classification::new(random.modulo(6) as u8 + 1).unwrap(),
            point_source_id: random.modulo(9) as u16 + 1,
            gps_time: format.has_gps_time.then(|| random.unit() * 1e6),
            color: format.has_color.then(|| las::Color::new(wide(red), wide(green), wide(blue))),
            nir: format.has_nir.then_some(random.bits() as u16),
            waveform: format.has_waveform.then(Default::default),
            ..Default::default()
        };
        writer.write_point(point).unwrap();
    }
    writer.close().unwrap();
    writer.into_inner().unwrap().into_inner()
}

/// A PCD of x y z (float), rgb (packed) and label (unsigned 16 bit), in one of the three encodings.
pub(crate) fn pcd_bytes(encoding: &str, count: usize) -> Vec<u8> {
    let mut bytes = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb label\nSIZE 4 4 4 4 2\nTYPE F F F F U\nCOUNT 1 1 1 1 1\n\
         WIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA {encoding}\n"
    )
    .into_bytes();
    let rows: Vec<_> = positions(count).into_iter().zip(colors(count)).enumerate().collect();
    let packed = |[red, green, blue]: [u8; 3]| u32::from_be_bytes([0, red, green, blue]);
    match encoding {
        "ascii" => {
            for (i, ([x, y, z], color)) in rows {
                let rgb = f32::from_bits(packed(color));
                bytes.extend(format!("{x} {y} {z} {rgb:e} {}\n", i % 1000).bytes());
            }
        }
        "binary" => {
            for (i, (position, color)) in rows {
                position.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
                bytes.extend(packed(color).to_le_bytes());
                bytes.extend(((i % 1000) as u16).to_le_bytes());
            }
        }
        _ => {
            let mut plain = Vec::new();
            for axis in 0..3 {
                rows.iter().for_each(|(_, (position, _))| plain.extend(position[axis].to_le_bytes()));
            }
            rows.iter().for_each(|(_, (_, color))| plain.extend(packed(*color).to_le_bytes()));
            rows.iter().for_each(|(i, _)| plain.extend(((i % 1000) as u16).to_le_bytes()));
            let mut compressed = Vec::new();
            for run in plain.chunks(32) {
                compressed.push(run.len() as u8 - 1);
                compressed.extend(run);
            }
            bytes.extend((compressed.len() as u32).to_le_bytes());
            bytes.extend((plain.len() as u32).to_le_bytes());
            bytes.extend(compressed);
        }
    }
    bytes
}

/// A PTX of two scans, with intensities and colours.
pub(crate) fn ptx_bytes(count: usize) -> Vec<u8> {
    let rows: Vec<String> = positions(count)
        .into_iter()
        .zip(colors(count))
        .map(|([x, y, z], [red, green, blue])| format!("{x} {y} {z} 0.5 {red} {green} {blue}\n"))
        .collect();
    let map = "9 8 7\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n9 8 7 1\n";
    let (first, second) = rows.split_at(count / 2);
    let scan = |rows: &[String]| format!("{}\n1\n{map}{}", rows.len(), rows.concat());
    (scan(first) + &scan(second)).into_bytes()
}
