//! Tests of the LAS writer.

use std::path::Path;

use crate::common::{
    las_bytes,
    las_files::{EXACT, about, load, values, written},
    positions, rich_cloud,
};
use autosplats_cloud::{
    Crs, Error, FieldValues, PointCloud, Random,
    glam::{DMat4, DVec3},
};
use autosplats_formats::{describe_bytes, read_bytes, write};

#[test]
fn the_format_fits_the_fields() {
    let cloud = |fields: &[(&str, FieldValues)]| {
        let bare = PointCloud::new(DVec3::ZERO, positions(2));
        fields.iter().fold(bare, |cloud, (name, values)| cloud.with_field(*name, values.clone()).unwrap())
    };
    let bytes = |values: [u8; 2]| FieldValues::U8(values.into());
    let time = ("GpsTime", FieldValues::F64(vec![1e9, 0.5]));
    let cases: &[(&[(&str, FieldValues)], &str)] = &[
        (&[], "LAS 1.2, point format 0"),
        (std::slice::from_ref(&time), "LAS 1.2, point format 1"),
        (&[("Classification", bytes([31, 0]))], "LAS 1.2, point format 0"),
        (&[("Classification", bytes([32, 0]))], "LAS 1.4, point format 6"),
        (&[("ReturnNumber", bytes([5, 1]))], "LAS 1.2, point format 0"),
        (&[("NumberOfReturns", bytes([6, 1]))], "LAS 1.4, point format 6"),
        (&[("ScanChannel", bytes([1, 0]))], "LAS 1.4, point format 6"),
        (&[("Infrared", FieldValues::U16(vec![1, 0]))], "LAS 1.4, point format 8"),
        (&[("ScanAngleRank", FieldValues::F32(vec![1.5, 0.0]))], "LAS 1.4, point format 6"),
        (&[("ScanAngleRank", FieldValues::I8(vec![-15, 0]))], "LAS 1.2, point format 0"),
    ];
    for (fields, format) in cases {
        let cloud = cloud(fields);
        let (bytes, _) = written(&cloud, "a.las");
        assert_eq!(about(&bytes).format, *format, "{fields:?}");
        let back = load(&bytes).0;
        for (name, values) in *fields {
            let same = |i| back.field(name).is_some_and(|back| (back.values.get(i) - values.get(i)).abs() < 1e-6);
            assert!((0..2).all(same), "{name} comes back in format '{format}'");
        }
        let colored = cloud.with_colors(vec![[1, 2, 255]; 2]).unwrap();
        let back = load(&written(&colored, "a.laz").0).0;
        assert_eq!(back.colors().unwrap()[1], [1, 2, 255], "colours in '{format}'");
        assert!(back.field("Red").is_none(), "bytes are all there is of them");
    }
    // Integer fields cannot hold these values.
    let odd = cloud(&[
        ("Intensity", FieldValues::F32(vec![0.25, f32::NAN])),
        ("Classification", FieldValues::I32(vec![-1, 300])),
    ]);
    let (bytes, notes) = written(&odd, "a.laz");
    let back = load(&bytes).0;
    assert_eq!(back.field("Classification").unwrap().values, FieldValues::I32(vec![-1, 300]), "kept as extra bytes");
    assert!(notes.iter().filter(|note| note.contains("extra bytes")).count() == 1, "and that is told: {notes:?}");
}

#[test]
fn intensities_of_any_range_fill_their_place() {
    let nan = f32::NAN;
    let cases: &[(FieldValues, &[f64], &str)] = &[
        (FieldValues::F32(vec![0.25, 0.75, nan]), &[16_384.0, 49_151.0, 0.0], "intensities of 0 to 1 are scaled"),
        (FieldValues::F64(vec![0.5; 3]), &[32_768.0; 3], "intensities of 0 to 1 are scaled"),
        (FieldValues::I16(vec![-2048, 2047, -2048]), &[0.0, 65_535.0, 0.0], "intensities of -2048 to 2047 are scaled"),
        (FieldValues::F32(vec![12.5, 200.0, 387.5]), &[0.0, 32_768.0, 65_535.0], "intensities of 12.5 to 387.5"),
        (FieldValues::F64(vec![-f64::MAX, 0.0, f64::MAX]), &[0.0, 32_768.0, 65_535.0], "are scaled"),
        (FieldValues::F32(vec![0.0, 255.0, 65_535.0]), &[0.0, 255.0, 65_535.0], ""),
        (FieldValues::U8(vec![0, 1, 1]), &[0.0, 1.0, 1.0], ""),
    ];
    for (intensities, expected, told) in cases {
        let cloud = PointCloud::new(DVec3::ZERO, positions(3)).with_field("Intensity", intensities.clone()).unwrap();
        let (bytes, notes) = written(&cloud, "a.laz");
        let (back, _) = load(&bytes);
        assert_eq!(values(&back, "Intensity"), *expected, "{intensities:?}");
        let scaled = notes.iter().any(|note| note.contains(told) && note.contains("ExactIntensity"));
        assert_eq!(scaled, !told.is_empty(), "{intensities:?}: {notes:?}");
        let exact = back.field("ExactIntensity").map(|field| format!("{:?}", field.values));
        assert_eq!(exact, scaled.then(|| format!("{intensities:?}")), "what scaling changes is kept as well");
        // Once values are scaled, nothing needs to be scaled again.
        let (again, _) = load(&written(&back, "a.las").0);
        assert_eq!(format!("{:?}", again.fields()), format!("{:?}", back.fields()), "and stays as it is");
    }
    for values in [vec![70_000.5; 3], vec![0.5, f32::INFINITY, 2.0], vec![nan; 3]] {
        let cloud =
            PointCloud::new(DVec3::ZERO, positions(3)).with_field("Intensity", FieldValues::F32(values)).unwrap();
        let (bytes, notes) = written(&cloud, "a.las");
        let back = load(&bytes).0;
        assert_eq!(format!("{:?}", back.fields()), format!("{:?}", cloud.fields()), "no range, no scale");
        assert!(notes.iter().any(|note| note.contains("do not fit their place")), "{notes:?}");
    }
}

#[test]
fn written_clouds_come_back() {
    let long = "a name that is much longer than the 32 bytes there are";
    let mut cloud =
        rich_cloud(120_000).with_field("kind", FieldValues::U64((0..120_000).map(|i| i << 40).collect())).unwrap();
    for name in [long.to_owned(), format!("{long}, too"), "ä".repeat(20), "KIND".into()] {
        if name != "KIND" {
            cloud = cloud.with_field(name, FieldValues::I64((0..120_000).map(|i| -i).collect())).unwrap();
        }
    }
    for name in ["a.las", "a.laz"] {
        let (bytes, notes) = written(&cloud, name);
        let back = load(&bytes).0;
        assert_eq!((back.len(), back.colors()), (cloud.len(), cloud.colors()), "{name}: points and colours");
        for field in cloud.fields().iter().filter(|field| field.name.len() <= 32) {
            assert_eq!(back.field(&field.name), Some(field), "{name}");
        }
        let renamed = ["a name that is much longer than", "a name that is much longer tha_2", "ääääääääääääääää"];
        for name in renamed {
            assert!(
                back.field(&name[..name.len().min(32)]).is_some(),
                "{:?}",
                back.fields().iter().map(|f| &f.name).collect::<Vec<_>>()
            );
        }
        // Twenty metres by three: steps of a hundredth of a millimetre.
        let far = (0..cloud.len()).map(|i| (back.world_position(i) - cloud.world_position(i)).abs().max_element());
        assert!(far.fold(0.0, f64::max) < 0.51e-5, "{name}: positions are rounded to the step");
        assert!(notes.iter().any(|note| note.contains("rounded to steps of 0.00001")), "{notes:?}");
        let description = about(&bytes);
        let [low, high] = description.bounds.unwrap();
        assert!((low.x + 10.0).abs() < 0.01 && (high.x - 10.0).abs() < 0.01, "bounds {low} to {high}");
    }
    let empty = load(&written(&PointCloud::default(), "a.laz").0).0;
    assert_eq!(empty.len(), 0, "no points at all");
}

#[test]
fn moved_points_do_not_take_others_with_them() {
    // Not at the corner, which is the centre of the rotation.
    let steps = |i: usize| DVec3::new((1 + i * 37 % 1009) as f64, (i * 11 % 997) as f64, (i % 83) as f64) * 0.01;
    // At multiples of the step, and at an odd position.
    for corner in [DVec3::new(512_000.0, 5_400_000.0, 300.0), DVec3::new(512_000.003_7, 5_400_000.006_1, 300.0023)] {
        let place = |i: usize| corner + steps(i);
        let coarse = |i: usize| steps(i).as_vec3();
        let positions = (0..1000).map(|i| coarse(i).to_array()).collect();
        let residuals = (0..1000).map(|i| (steps(i) - coarse(i).as_dvec3()).as_vec3().to_array()).collect();
        let mut cloud = PointCloud::new(corner, positions).with_residuals(residuals).unwrap();
        cloud = cloud.with_resolution(DVec3::splat(0.01));
        let turn = DMat4::from_translation(corner) * DMat4::from_rotation_z(1.0) * DMat4::from_translation(-corner);
        let moved = |i: usize| i % 10 < 4;
        cloud.move_points(moved, &turn, None);
        let (bytes, notes) = written(&cloud, "a.las");
        let back = load(&bytes).0;
        for i in 0..1000 {
            let off = (back.world_position(i) - cloud.world_position(i)).abs().max_element();
            // A step or two of f64, or half a step of the file.
            assert!(off < if moved(i) { 0.005_001 } else { 2e-9 }, "{corner}: point {i} is off by {off}");
            assert!(moved(i) || (back.world_position(i) - place(i)).abs().max_element() < 2e-9, "point {i} stays");
        }
        assert!(notes.iter().any(|note| note.contains("rounded to steps of 0.01")), "{notes:?}");
    }
}

#[test]
fn what_las_cannot_hold() {
    let mut points = positions(100);
    points[3][1] = f32::NAN;
    points[99][2] = f32::INFINITY;
    let labels = FieldValues::U16((0..100).collect());
    let cloud = PointCloud::new(DVec3::new(5e5, 5e6, 0.0), points).with_field("PointSourceId", labels).unwrap();
    let (bytes, notes) = written(&cloud, "a.laz");
    let back = load(&bytes).0;
    assert_eq!(back.len(), 98, "points that are nowhere");
    assert!(notes.iter().any(|note| note.contains("2 points without finite coordinates")), "{notes:?}");
    assert_eq!(values(&back, "PointSourceId")[2..4], [2.0, 4.0], "the others keep what they have");

    let mut points = positions(100);
    points[50] = [1e30, 0.0, 0.0];
    let folder = tempfile::tempdir().unwrap();
    let wild = write(&PointCloud::new(DVec3::ZERO, points), &folder.path().join("a.las"), &()).unwrap_err().to_string();
    assert!(wild.contains("so far away") && wild.contains("PLY"), "{wild}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "and nothing is left behind");

    let (moved, notes) = {
        let (cloud, _) = load(&las_bytes((1, 2), 1, false, 500));
        let turned = PointCloud::merge(vec![(cloud, DMat4::from_rotation_z(0.3))]);
        let (bytes, notes) = written(&turned, "a.las");
        ((turned, load(&bytes).0), notes)
    };
    assert!(notes.iter().any(|note| note.contains("rounded to steps of 0.001")), "what was turned is off the grid");
    let off = |i| (moved.0.world_position(i) - moved.1.world_position(i)).abs().max_element();
    assert!((0..500).map(off).fold(0.0, f64::max) < 0.000_51, "by half a step");
}

#[test]
fn written_files_cut_and_changed() {
    let mut random = Random::from_state(7);
    let small = rich_cloud(200).with_crs(Crs::from_wkt(r#"GEOGCS["WGS 84",UNIT["degree",0.0174532925199433]]"#));
    let wide = small.clone().with_field("ScanChannel", FieldValues::U8(vec![2; 200])).unwrap();
    for (cloud, name) in [(&small, "a.las"), (&small, "a.laz"), (&wide, "b.las"), (&wide, "b.laz")] {
        let (bytes, _) = written(cloud, name);
        let try_it = |bytes: &[u8]| {
            let path = Path::new("a.las");
            for result in [
                read_bytes(path, bytes, &EXACT, &()).map(|cloud| assert!(cloud.len() <= 200, "no more points")),
                describe_bytes(path, bytes, &EXACT).map(|_| ()),
            ] {
                let Err(error) = result else { continue };
                let plain = !error.to_string().contains(char::is_control);
                assert!(plain && !matches!(error, Error::Io { .. }), "{error}");
            }
        };
        for len in (0..bytes.len().min(2500)).step_by(3) {
            try_it(&bytes[..len]);
        }
        for _ in 0..600 {
            let mut changed = bytes.clone();
            for _ in 0..=random.modulo(3) {
                let range = [1500.min(bytes.len()), bytes.len()][random.modulo(2)];
                let at = random.modulo(range);
                changed[at] = random.bits() as u8;
            }
            // Other tests compare false counts with the size; here they would only take time.
            changed[107..111].copy_from_slice(&bytes[107..111]);
            if bytes[25] == 4 {
                changed[247..255].copy_from_slice(&bytes[247..255]);
            }
            try_it(&changed);
        }
    }
}
