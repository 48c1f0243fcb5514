//! `normals`.

use crate::common::{Folder, SPHERE_POINTS};

/// Values of a binary PLY of bytes, floats and doubles, one row per point, and the names of its properties.
fn rows(file: &[u8]) -> (Vec<String>, Vec<Vec<f32>>) {
    let end = file.windows(11).position(|window| window == b"end_header\n").expect("a header that ends") + 11;
    let header = String::from_utf8_lossy(&file[..end]);
    let properties: Vec<(usize, String)> = header
        .lines()
        .filter_map(|line| line.strip_prefix("property "))
        .map(|line| {
            let (kind, name) = line.split_once(' ').expect("a type and a name");
            let size = match kind {
                "uchar" => 1,
                "float" => 4,
                _ => 8,
            };
            (size, name.to_owned())
        })
        .collect();
    let stride: usize = properties.iter().map(|(size, _)| size).sum();
    let row = |record: &[u8]| {
        let mut at = 0;
        let value = |(size, _): &(usize, String)| {
            let bytes = &record[at..at + size];
            at += size;
            match bytes {
                [byte] => f32::from(*byte),
                [a, b, c, d] => f32::from_le_bytes([*a, *b, *c, *d]),
                double => f64::from_le_bytes(double.try_into().expect("eight bytes")) as f32,
            }
        };
        properties.iter().map(value).collect()
    };
    let rows = file[end..].chunks_exact(stride).map(row).collect();
    (properties.iter().map(|(_, name)| name.clone()).collect(), rows)
}

#[test]
fn a_sphere_has_its_own_normals() {
    let folder = Folder::with_sphere();
    folder.succeed(&["normals", "sphere.ply", "out.ply"]);
    let (names, rows) = rows(&folder.read("out.ply"));
    assert_eq!(rows.len(), SPHERE_POINTS, "every point");
    let column = |name: &str| names.iter().position(|found| found == name).unwrap_or_else(|| panic!("no {name}"));
    let [x, y, z] = ["x", "y", "z"].map(column);
    let [nx, ny, nz] = ["nx", "ny", "nz"].map(column);
    let (curvature, radius) = (column("Curvature"), column("DensityRadius"));
    for row in &rows {
        let cosine = row[x] * row[nx] + row[y] * row[ny] + row[z] * row[nz];
        assert!(cosine > 0.995, "a unit sphere's normal is its point, outward: {cosine}");
        assert!((0.0..0.02).contains(&row[curvature]), "nearly flat: {}", row[curvature]);
        // 6000 points on an area of 4 pi: each covers a circle of radius 0.026.
        assert!((0.03..0.09).contains(&row[radius]), "about twice 0.026: {}", row[radius]);
    }
}

#[test]
fn normals_turn_to_a_sensor() {
    let folder = Folder::with_sphere();
    folder.succeed(&["normals", "sphere.ply", "-o", "out.ply", "--sensor", "0,0,0", "--quiet"]);
    let (names, rows) = rows(&folder.read("out.ply"));
    let column = |name: &str| names.iter().position(|found| found == name).unwrap_or_else(|| panic!("no {name}"));
    let [x, nx] = ["x", "nx"].map(column);
    assert!(rows.iter().all(|row| row[x] * row[nx] <= 1e-3), "inward, to the sensor in the middle");
    folder.fail(&["normals", "sphere.ply", "b.ply", "--orient", "sensor"], 2, &["--sensor"]);
    folder.fail(&["normals", "sphere.ply", "b.ply", "-k", "2"], 2, &["3 to 1024"]);
    folder.fail(&["normals", "sphere.ply", "out.ply"], 4, &["--force"]);
}

#[test]
fn more_points_than_memory_holds_have_the_same_normals() {
    let folder = Folder::with_sphere();
    folder.succeed(&["convert", "scene:figure:100K", "scan.laz"]);
    for options in [&["--orient", "up"][..], &["--sensor", "0,-9,1"], &["-k", "20"]] {
        folder.succeed(&[&["normals", "scan.laz", "whole.ply", "--force"], options].concat());
        let in_parts = ["normals", "scan.laz", "parts.ply", "--force", "--memory", "4M"];
        let outcome = folder.succeed(&[&in_parts, options].concat());
        assert!(outcome.stderr.contains("parts, 0 in doubt"), "{}", outcome.stderr);
        let ([names, others], [whole, parts]) = {
            let [(a, b), (c, d)] = ["whole.ply", "parts.ply"].map(|name| rows(&folder.read(name)));
            ([a, c], [b, d])
        };
        assert_eq!((&names, whole.len()), (&others, parts.len()), "{options:?}");
        let column = |name: &str| names.iter().position(|found| found == name).unwrap_or_else(|| panic!("no {name}"));
        let [nx, ny, nz] = ["nx", "ny", "nz"].map(column);
        let radius = column("DensityRadius");
        let same = |(a, b): (&Vec<f32>, &Vec<f32>)| {
            let cosine = a[nx] * b[nx] + a[ny] * b[ny] + a[nz] * b[nz];
            // A tenth of a degree.
            a[..3] == b[..3] && cosine > 0.999_998 && (a[radius] - b[radius]).abs() <= 1e-5 * a[radius]
        };
        let unlike = whole.iter().zip(&parts).filter(|pair| !same(*pair)).count();
        assert!(unlike <= whole.len() / 10_000, "{options:?}: {unlike} of {} differ", whole.len());
    }
    let outcome = folder.succeed(&["normals", "scan.laz", "n.copc.laz", "--memory", "4M"]);
    assert!(outcome.stderr.contains("normals of 100000 points"), "{}", outcome.stderr);
    let info = folder.succeed(&["info", "n.copc.laz"]).stdout;
    assert!(info.contains("COPC") && info.contains("NormalZ"), "an octree of the results: {info}");
}
