//! Shared by the tests of all crates of points: generated clouds.

#![allow(dead_code, reason = "not every test uses all of it")]
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

use autosplats_cloud::{Axes, FieldValues, PointCloud, Random, glam::DVec3};

pub(crate) fn positions(count: usize) -> Vec<[f32; 3]> {
    let mut random = Random::from_state(1);
    (0..count).map(|_| [random.unit() as f32 * 20.0 - 10.0, random.unit() as f32, random.unit() as f32 * 3.0]).collect()
}

pub(crate) fn colors(count: usize) -> Vec<[u8; 3]> {
    let mut random = Random::from_state(2);
    (0..count).map(|_| [random.bits() as u8, random.bits() as u8, random.bits() as u8]).collect()
}

/// A cloud with every kind of attribute.
pub(crate) fn rich_cloud(count: usize) -> PointCloud {
    let mut random = Random::from_state(3);
    let mut values = || (0..count).map(|_| random.bits()).collect::<Vec<_>>();
    let fields = [
        ("Classification", FieldValues::U8(values().into_iter().map(|v| v as u8).collect())),
        ("ScanAngle", FieldValues::I8(values().into_iter().map(|v| v as i8).collect())),
        ("Intensity", FieldValues::U16(values().into_iter().map(|v| v as u16).collect())),
        ("offset", FieldValues::I16(values().into_iter().map(|v| v as i16).collect())),
        ("id", FieldValues::U32(values().into_iter().map(|v| v as u32).collect())),
        ("delta", FieldValues::I32(values().into_iter().map(|v| v as i32).collect())),
        ("NormalX", FieldValues::F32(values().into_iter().map(|v| v as f32 / 1e19).collect())),
        ("GpsTime", FieldValues::F64(values().into_iter().map(|v| v as f64 / 1e3).collect())),
    ];
    let mut cloud = PointCloud::new(DVec3::ZERO, positions(count)).with_colors(colors(count)).unwrap();
    for (name, values) in fields {
        cloud = cloud.with_field(name, values).unwrap();
    }
    cloud.with_axes(Axes::YUp)
}
