//! Small whole files of every format, in every variant that is read differently.

use std::path::Path;

use anyhow::{Context as _, Result};
use autosplats_cloud::{FieldValues, PointCloud, glam::DVec3, write};

/// Files of one format.
pub(crate) struct Seeds {
    /// Their extension.
    pub(crate) extension: &'static str,
    /// Their contents.
    pub(crate) files: Vec<Vec<u8>>,
}

/// Points of a seed: few, so that many inputs fit into a second.
const POINTS: usize = 24;

pub(crate) fn all() -> Result<Vec<Seeds>> {
    let seeds = |extension, files: Vec<Vec<u8>>| Seeds { extension, files };
    let rows: String = (0..POINTS).map(|i| format!("{} {} {} {}\n", i, i * i % 7, 0.5 * i as f64, i * 10)).collect();
    Ok(vec![
        seeds("ply", [written("ply")?, vec![ascii_ply(), list_ply()]].concat()),
        seeds("pcd", vec![ascii_pcd()]),
        seeds("xyz", vec![rows.clone().into_bytes()]),
        seeds("pts", vec![format!("{POINTS}\n{rows}").into_bytes()]),
        seeds("csv", vec![format!("x,y,z,Intensity\n{}", rows.replace(' ', ",")).into_bytes()]),
    ])
}

/// Clouds of several kinds in a format that the project writes.
fn written(extension: &str) -> Result<Vec<Vec<u8>>> {
    let bare = PointCloud::new(DVec3::ZERO, (0..POINTS).map(|i| [i as f32, (i * i % 7) as f32, 0.5]).collect());
    let byte = |i: usize| i as u8;
    let colored = bare.clone().with_colors((0..POINTS).map(|i| [byte(i), 255, byte(i * i)]).collect())?;
    let rich = colored
        .with_field("Intensity", FieldValues::U16((0..POINTS).map(|i| (i * 1000) as u16).collect()))?
        .with_field("Classification", FieldValues::U8((0..POINTS).map(|i| byte(i % 6)).collect()))?
        .with_field("GpsTime", FieldValues::F64((0..POINTS).map(|i| 1e5 + i as f64).collect()))?
        .with_field("odd name", FieldValues::F32((0..POINTS).map(|i| i as f32 - 3.5).collect()))?;
    let far = PointCloud::new(DVec3::new(5e5, 5e6, 300.0), bare.positions().to_vec());
    let folder = tempfile::tempdir()?;
    let path = folder.path().join(format!("a.{extension}"));
    [bare, rich, far].iter().map(|cloud| file(cloud, &path)).collect()
}

fn file(cloud: &PointCloud, path: &Path) -> Result<Vec<u8>> {
    write(cloud, path, &()).with_context(|| format!("seed {}", path.display()))?;
    Ok(std::fs::read(path)?)
}

fn ascii_ply() -> Vec<u8> {
    b"ply\r\nformat ascii 1.0\r\ncomment a\r\nelement vertex 3\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n\
      property list uchar int ids\r\nelement face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n\
      0 0 0 0\r\n1 0 0 2 7 8\r\n0 1 0 1 9\r\n3 0 1 2\r\n"
        .to_vec()
}

fn list_ply() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement face 2\nproperty list uchar int vertex_indices\n\
                      element vertex 3\nproperty list uint uchar ids\nproperty double x\nproperty float y\n\
                      property short z\nproperty ushort red\nproperty ushort green\nproperty ushort blue\nend_header\n"
        .to_vec();
    for face in [[0_i32, 1, 2], [2, 1, 0]] {
        bytes.push(3);
        bytes.extend(face.map(i32::to_be_bytes).as_flattened());
    }
    for i in 0..3_u16 {
        bytes.extend([0, 0, 0, 1, 7]);
        bytes.extend(f64::from(i).to_be_bytes());
        bytes.extend(0.5_f32.to_be_bytes());
        bytes.extend([i, 300 * i, 40000, 7].map(u16::to_be_bytes).as_flattened());
    }
    bytes
}

fn ascii_pcd() -> Vec<u8> {
    b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb label\nSIZE 4 4 4 4 2\nTYPE F F F F U\nCOUNT 1 1 1 1 1\nWIDTH 2\n\
      HEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA ascii\n1 2 3 4.2e-38 1\nnan nan nan 0 2\n0 0 0 0 3\n4 5 6 255 4\n"
        .to_vec()
}
