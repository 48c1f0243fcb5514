//! Tests of the LAS family: contents of records, coordinate systems, descriptions, damage.

use std::path::{Path, PathBuf};

use crate::common::{
    las_bytes,
    las_files::{NONE, Notes, about, extra, file, load, values, written},
    shared_data,
};
use autosplats_cloud::{Crs, FieldValues, PointCloud, Unit, glam::DVec3};
use autosplats_formats::{ReadOptions, describe, read_bytes};

#[test]
fn extra_bytes_of_every_type() {
    let plain = |kind: u8| extra(kind, 0, &format!("type {kind}"), NONE, [0.0; 3], [0.0; 3]);
    let first: Vec<u8> = (1..=10).flat_map(plain).collect();
    let mut second = extra(3, 8 + 16, "scaled", NONE, [0.25; 3], [10.0; 3]);
    let none = (-1_i64).to_le_bytes();
    second.extend(extra(4, 1 + 8, "holes", [none; 3], [0.5; 3], [0.0; 3]));
    second.extend(extra(9, 1, "missing", [(-9999_f64).to_le_bytes(); 3], [0.0; 3], [0.0; 3]));
    second.extend(extra(26, 8, "triple", NONE, [1.0, 2.0, 3.0], [0.0; 3]));
    second.extend(extra(0, 2, "", NONE, [0.0; 3], [0.0; 3]));
    second.extend(extra(1, 0, "Intensity", NONE, [0.0; 3], [0.0; 3]));
    let record = |sign: i32| {
        let mut raw = vec![0; 20];
        raw[12] = 9;
        raw.push(200);
        raw.push((-100 * sign) as u8);
        raw.extend(60_000_u16.to_le_bytes());
        raw.extend((-30_000 * sign as i16).to_le_bytes());
        raw.extend(4_000_000_000_u32.to_le_bytes());
        raw.extend((-2_000_000_000 * sign).to_le_bytes());
        raw.extend(u64::MAX.to_le_bytes());
        raw.extend(i64::MIN.to_le_bytes());
        raw.extend((1.5 * sign as f32).to_le_bytes());
        raw.extend((1e300 * f64::from(sign)).to_le_bytes());
        raw.extend(8_u16.to_le_bytes());
        raw.extend((if sign > 0 { -1_i16 } else { 7 }).to_le_bytes());
        raw.extend((if sign > 0 { -9999_f32 } else { 2.5 }).to_le_bytes());
        for value in [5_i32, 6, -7] {
            raw.extend(value.to_le_bytes());
        }
        raw.extend([1, 2, 33, 77]);
        raw
    };
    let vlrs = [("LASF_Spec", 4, first), ("other", 4, vec![7; 192]), ("LASF_Spec", 4, second)];
    let bytes = file(2, 0, &vlrs, &[record(1), record(-1)]);
    let (cloud, notes) = load(&bytes);
    let field = |name: &str| cloud.field(name).unwrap_or_else(|| panic!("no {name}")).values.clone();
    assert_eq!(field("type 1"), FieldValues::U8(vec![200; 2]), "unsigned byte");
    assert_eq!(field("type 2"), FieldValues::I8(vec![-100, 100]), "signed byte");
    assert_eq!(field("type 3"), FieldValues::U16(vec![60_000; 2]), "16 bits");
    assert_eq!(field("type 4"), FieldValues::I16(vec![-30_000, 30_000]), "16 bits, signed");
    assert_eq!(field("type 5"), FieldValues::U32(vec![4_000_000_000; 2]), "32 bits");
    assert_eq!(field("type 6"), FieldValues::I32(vec![-2_000_000_000, 2_000_000_000]), "32 bits, signed");
    assert_eq!(field("type 7"), FieldValues::U64(vec![u64::MAX; 2]), "64 bits");
    assert_eq!(field("type 8"), FieldValues::I64(vec![i64::MIN; 2]), "64 bits, signed");
    assert_eq!(field("type 9"), FieldValues::F32(vec![1.5, -1.5]), "float");
    assert_eq!(field("type 10"), FieldValues::F64(vec![1e300, -1e300]), "double");
    assert_eq!(field("scaled"), FieldValues::F64(vec![12.0; 2]), "8 × 0.25 + 10");
    let holes = values(&cloud, "holes");
    assert!(holes[0].is_nan() && holes[1] == 3.5, "the value for none is no number: {holes:?}");
    let missing = values(&cloud, "missing");
    assert!(missing[0].is_nan() && missing[1] == 2.5, "also where nothing is scaled: {missing:?}");
    assert_eq!(["triple_0", "triple_1", "triple_2"].map(|name| values(&cloud, name)[0]), [5.0, 12.0, -21.0], "triples");
    assert_eq!((values(&cloud, "Intensity"), values(&cloud, "Intensity_")), (vec![9.0; 2], vec![33.0; 2]), "own names");
    assert!(notes.iter().any(|note| note.contains("3 bytes of each record are not described")), "{notes:?}");

    let description = about(&bytes);
    let stored = |name: &str| {
        let found = description.attributes.iter().find(|attribute| attribute.name == name);
        found.unwrap_or_else(|| panic!("no {name}")).stored.clone()
    };
    let expected = ["uint16 × 0.25 + 10", "float64", "int32 × 2", "uint16", "int32 × 0.5"];
    assert_eq!(["scaled", "type 10", "triple_1", "Intensity", "X"].map(stored), expected, "types as stored");
    // Clouds that were read can be written: all types come back.
    for name in ["b.las", "b.laz"] {
        let (again, _) = load(&written(&cloud, name).0);
        for field in cloud.fields() {
            let same = |i| {
                let (a, b) = (field.values.get(i), again.field(&field.name).unwrap().values.get(i));
                a == b || a.is_nan() && b.is_nan()
            };
            assert!((0..2).all(same), "{name}: {} comes back", field.name);
        }
    }
}

#[test]
fn extra_bytes_that_lie() {
    let point = || vec![1_u8; 24];
    let bytes = file(2, 0, &[("LASF_Spec", 4, extra(10, 0, "wide", NONE, [0.0; 3], [0.0; 3]))], &[point()]);
    let (cloud, notes) = load(&bytes);
    assert!(cloud.field("wide").is_none() && notes.iter().any(|note| note.contains("no room")), "{notes:?}");
    let bytes = file(2, 0, &[("LASF_Spec", 4, extra(77, 0, "odd", NONE, [0.0; 3], [0.0; 3]))], &[point()]);
    let (_, notes) = load(&bytes);
    assert!(notes.iter().any(|note| note.contains("unknown type 77")), "{notes:?}");
    let scales = extra(5, 8 + 16, "scales", NONE, [0.0, 1.0, 1.0], [f64::NAN, 0.0, 0.0]);
    let (cloud, _) = load(&file(2, 0, &[("LASF_Spec", 4, scales)], &[point()]));
    assert_eq!(values(&cloud, "scales"), [f64::from(0x0101_0101)], "scales that are none are left alone");
    let many = vec![("LASF_Spec", 4_u16, vec![0_u8; 0]); 3];
    assert_eq!(load(&file(2, 0, &many, &[point()])).0.len(), 1, "empty descriptions");
}

#[test]
fn every_bit_of_a_record() {
    let mut narrow = vec![0; 20];
    narrow[14] = 0b1110_1010;
    narrow[15] = 0b1010_1001;
    narrow[16] = -7_i8 as u8;
    narrow[17] = 201;
    let (cloud, _) = load(&file(2, 0, &[], &[narrow]));
    let of = |cloud: &PointCloud, names: &[&str]| names.iter().map(|name| values(cloud, name)[0]).collect::<Vec<_>>();
    let names = ["ReturnNumber", "NumberOfReturns", "ScanDirectionFlag", "EdgeOfFlightLine", "Classification"];
    assert_eq!(of(&cloud, &names), [2.0, 5.0, 1.0, 1.0, 9.0], "bits of formats to 5");
    assert_eq!(of(&cloud, &["Synthetic", "Withheld", "ScanAngleRank", "UserData"]), [1.0, 1.0, -7.0, 201.0], "bytes");
    assert!(cloud.field("KeyPoint").is_none(), "what is zero for all points is left out");
    assert_eq!(cloud.world_position(0), DVec3::splat(100.0), "scale and offset");
    assert_eq!(cloud.resolution(), Some(DVec3::splat(0.5)), "the step of coordinates");

    let mut wide = vec![0; 30];
    wide[14] = 0b1011_1101;
    wide[15] = 0b0110_1010;
    wide[16] = 250;
    wide[17] = 3;
    wide[18..20].copy_from_slice(&(-2500_i16).to_le_bytes());
    let (cloud, _) = load(&file(4, 6, &[], &[wide]));
    assert_eq!(of(&cloud, &["ReturnNumber", "NumberOfReturns", "KeyPoint", "Overlap"]), [13.0, 11.0, 1.0, 1.0], "bits");
    assert_eq!(of(&cloud, &["ScanChannel", "ScanDirectionFlag", "Classification"]), [2.0, 1.0, 250.0], "from 6 on");
    assert!((values(&cloud, "ScanAngleRank")[0] + 15.0).abs() < 1e-5, "angles in degrees");
    assert!(cloud.field("EdgeOfFlightLine").is_none() && cloud.field("Synthetic").is_none(), "zeros");
    for name in ["a.las", "a.laz"] {
        let (bytes, notes) = written(&cloud, name);
        assert!(notes.is_empty(), "nothing is lost: {notes:?}");
        assert!(load(&bytes).0 == cloud, "{name}: all bits come back");
        assert!(about(&bytes).format.starts_with("LAS 1.4, point format 6"), "{}", about(&bytes).format);
    }
}

#[test]
fn colours_of_8_bits_in_16() {
    let point = |color: [u16; 3]| {
        let mut raw = vec![0; 26];
        raw[20..].copy_from_slice(color.map(u16::to_le_bytes).as_flattened());
        raw
    };
    // More than one block of points, with the large values in the last.
    let narrow: Vec<_> = (0..30_000).map(|i| point([i as u16 % 256, 255, 0])).collect();
    let (cloud, notes) = load(&file(2, 2, &[], &narrow));
    assert_eq!(cloud.colors().unwrap()[7], [7, 255, 0], "as they are");
    assert!(notes.iter().any(|note| note.contains("8 bits")), "{notes:?}");
    let mut wide = narrow;
    wide[26_000..].fill(point([256, 65_535, 3]));
    let (cloud, notes) = load(&file(2, 2, &[], &wide));
    let colors = cloud.colors().unwrap();
    assert!(colors[..26_000].iter().all(|color| *color == [0; 3]), "many large values make the others small");
    assert_eq!((colors[29_999], notes.len()), ([1, 255, 0], 0), "and that is no guess");
    assert_eq!(values(&cloud, "Blue")[29_999], 3.0, "all 16 bits are kept for those who want them");
}

#[test]
fn what_is_left_of_broken_files() {
    let las = las_bytes((1, 2), 3, false, 1000);
    let whole = load(&las).0;
    let (cut, notes) = load(&las[..las.len() - 34 * 10 - 1]);
    assert_eq!(cut.len(), 989, "complete points are kept");
    assert!((0..989).all(|i| cut.world_position(i) == whole.world_position(i)), "as they are");
    let told = |notes: &[String], words: &str| notes.iter().any(|note| note.contains(words));
    assert!(told(&notes, "11 of 1000 points are lost"), "{notes:?}");
    assert!(told(&about(&las[..las.len() - 35]).notes, "998 of 1000"), "a description tells it, too");

    // A chunk of three with impossible layers.
    let laz = las_bytes((1, 4), 6, true, 120_000);
    let whole = load(&laz).0;
    let start = u32::from_le_bytes(laz[96..100].try_into().unwrap()) as usize + 8;
    let mut damaged = laz.clone();
    damaged[start + 34..start + 38].fill(0xff);
    let (rest, notes) = load(&damaged);
    assert_eq!(rest.len(), 70_000, "the other chunks are kept");
    assert!((0..70_000).all(|i| rest.world_position(i) == whole.world_position(50_000 + i)), "as they are");
    assert!(told(&notes, "50000 of 120000 points are lost"), "{notes:?}");

    let mut liar = las;
    liar[187..195].copy_from_slice(&f64::NAN.to_le_bytes());
    liar[100] = 3;
    let description = about(&liar);
    assert!(description.bounds.is_none() && told(&description.notes, "cannot be those"), "{:?}", description.notes);
    assert!(told(&description.notes, "3 records before the points; there are 0"), "{:?}", description.notes);
    assert_eq!(load(&liar).0.len(), 1000, "which keeps nothing from being read");
}

#[test]
fn previews_are_the_cloud_in_pieces() {
    for compressed in [false, true] {
        let bytes = las_bytes((1, 4), 7, compressed, 1_200_000);
        let watch = Notes { wants_chunks: true, ..Notes::default() };
        let cloud = read_bytes(Path::new("a.las"), &bytes, &ReadOptions::default(), &watch).unwrap();
        let chunks = watch.chunks.into_inner().unwrap();
        assert!(chunks.len() > 1 && chunks.iter().all(|chunk| chunk.colors().is_some()), "{} pieces", chunks.len());
        let joined: Vec<_> = chunks.iter().flat_map(PointCloud::positions).collect();
        assert!(joined.into_iter().eq(cloud.positions()), "compressed: {compressed}: the same points in order");
    }
}

#[test]
fn degrees_are_recognised_without_a_system() {
    let point = |x: i32, y: i32, z: i32| {
        let mut raw = vec![0; 20];
        raw[..12].copy_from_slice([x, y, z].map(i32::to_le_bytes).as_flattened());
        raw
    };
    let mut bytes = file(2, 0, &[], &[point(0, 0, 0), point(100_000, 100_000, 30_000)]);
    let mut put = |at: usize, value: f64| bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
    for (axis, (scale, offset, high)) in
        [(1e-7, -94.0, -93.99), (1e-7, 31.0, 31.01), (1e-3, 5.0, 35.0)].into_iter().enumerate()
    {
        put(131 + 8 * axis, scale);
        put(155 + 8 * axis, offset);
        put(179 + 16 * axis, high);
        put(187 + 16 * axis, offset);
    }
    let (mut cloud, notes) = load(&bytes);
    assert_eq!((cloud.crs().unit, cloud.crs().vertical_unit), (Some(Unit::Degree), Some(Unit::Metre)), "{notes:?}");
    assert!(notes.iter().any(|note| note.contains("look like degrees")), "{notes:?}");
    assert!(cloud.to_local_metres(), "so that they can be shown in metres");
    let size = cloud.world_position(1) - cloud.world_position(0);
    // 0.01° at 31° north is 955 m to the east and 1108.7 m to the north.
    assert!((size - DVec3::new(955.2, 1108.7, 30.0)).abs().max_element() < 1.0, "{size}");
    bytes[179 + 32..179 + 40].copy_from_slice(&5.3_f64.to_le_bytes());
    assert_eq!(load(&bytes).0.crs(), &Crs::default(), "a flat box may be anything");
}

#[test]
fn keys_say_what_text_of_a_horizontal_system_does_not() {
    let unit = |name: &str, metres: f64| format!(r#"UNIT["{name}",{metres}]"#);
    let horizontal = format!(r#"PROJCS["p",GEOGCS["g"],{}]"#, unit("foot", 0.3048));
    let both = format!(r#"COMPD_CS["c",{horizontal},VERT_CS["v",{}]]"#, unit("foot", 0.3048));
    let centre = format!(r#"GEOCCS["e",{}]"#, unit("metre", 1.0));
    let keys = |units: &[[u16; 4]]| {
        let keys = [&[[1, 1, 0, units.len() as u16]], units].concat();
        keys.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>()
    };
    let (heights, x_and_y) = ([4099, 0, 1, 9001], [3076, 0, 1, 9001]);
    let cases = [
        (&*horizontal, vec![heights], Unit::Foot, true),
        (&horizontal, vec![x_and_y, heights], Unit::Foot, true),
        (&horizontal, vec![x_and_y], Unit::Foot, false),
        (&both, vec![heights], Unit::Foot, false),
        (&centre, vec![[4099, 0, 1, 9002]], Unit::Metre, false),
        (r#"PROJCS["p"]"#, vec![[3076, 0, 1, 9002], heights], Unit::Foot, true),
    ];
    for (text, units, unit, in_metres) in cases {
        let vlrs = [("LASF_Projection", 2112, text.as_bytes().to_vec()), ("LASF_Projection", 34735, keys(&units))];
        let (cloud, notes) = load(&file(2, 0, &vlrs, &[vec![1; 20], vec![2; 20]]));
        assert_eq!((cloud.crs().unit, cloud.crs().vertical_unit), (Some(unit), None), "{text}, {units:?}");
        let scaled = notes.iter().any(|note| note.contains("heights in metre; heights are scaled to foot"));
        assert_eq!(scaled, in_metres, "{text}, {units:?}: {notes:?}");
        let back = load(&written(&cloud, "a.las").0).0;
        assert_eq!(back.crs(), cloud.crs(), "{text}, {units:?}: and comes back");
    }
}

/// File, format, coordinate system, and text of the expected note.
type Case = (&'static str, &'static str, Option<u32>, Option<&'static str>, Option<Unit>, Option<&'static str>);

#[rustfmt::skip]
const CASES: &[Case] = &[
    ("scans/autzen_thin.las", "LAS 1.2, point format 3", None, None, None, None),
    ("scans/autzen_trim.laz", "LAS 1.2, point format 3, compressed (LAZ)", None, Some("NAD_1983_HARN_Lambert_Conformal_Conic"), Some(Unit::Foot), None),
    ("scans/courtyard_1p46M.laz", "LAS 1.2, point format 2, compressed (LAZ)", None, None, None, None),
    ("scans/ign_lambert93_extrabytes.laz", "LAS 1.4, point format 8, compressed (LAZ)", Some(2154), Some("RGF93 / Lambert-93"), Some(Unit::Metre), None),
    ("scans/latlon_degrees.las", "LAS 1.2, point format 0", Some(4326), Some("WGS 84"), Some(Unit::Degree), None),
    ("scans/lion_takanawa.copc.laz", "COPC 1.0 (LAS 1.4 point format 7)", None, None, None, None),
    ("scans/lone_star.copc.laz", "COPC 1.0 (LAS 1.4 point format 6)", None, None, Some(Unit::Metre), Some("geocentric")),
    ("scans/simple_1065.las", "LAS 1.2, point format 3", None, None, None, None),
    ("malformed/las_bad_vlr_count.las", "", None, None, None, Some("3 records before the points; there are 2")),
];

#[test]
fn real_files_are_described() {
    let Some(folder) = shared_data() else { return };
    for &(file, format, epsg, name, unit, note) in CASES {
        let path = folder.join(file);
        let description = describe(&path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let cloud = load(&std::fs::read(&path).unwrap()).0;
        assert!(format.is_empty() || description.format == format, "{file}: {}", description.format);
        assert_eq!(&description.crs, cloud.crs(), "{file}: reading finds the same system");
        let crs = &description.crs;
        if !format.is_empty() {
            assert_eq!((crs.epsg, crs.name.as_deref(), crs.unit), (epsg, name, unit), "{file}");
        }
        let told = |words: &str| description.notes.iter().any(|note| note.contains(words));
        assert!(note.is_none_or(told) && (note.is_some() || description.notes.is_empty()), "{:?}", description.notes);
        assert_eq!(description.points, Some(cloud.len() as u64), "{file}");
        for field in cloud.fields() {
            let known = description.attributes.iter().any(|attribute| attribute.name == field.name);
            assert!(known, "{file}: {} is not described", field.name);
        }
        let [low, high] = description.bounds.unwrap();
        for i in 0..cloud.len() {
            let (point, slack) = (cloud.world_position(i), description.resolution.unwrap() * 10.0);
            // Headers of COPC are exact, while points are rounded to the scale.
            assert!(point.cmpge(low - slack).all() && point.cmple(high + slack).all(), "{file}: {point}");
        }
    }
    let detail = |file: &str, name: &str| {
        let description = describe(&folder.join(file), &ReadOptions::default()).unwrap();
        description.details.into_iter().find(|(found, _)| found == name).map(|(_, value)| value)
    };
    assert_eq!(detail("scans/autzen_trim.laz", "created").as_deref(), Some("2015-09-10"), "day 253");
    assert_eq!(detail("scans/simple_1065.las", "points by return").as_deref(), Some("925 114 21 5"), "returns");
    assert_eq!(detail("scans/autzen_thin.las", "generating software").as_deref(), Some("TerraScan"), "software");
    assert!(detail("scans/lion_takanawa.copc.laz", "COPC spacing").is_some(), "the tree");
}

#[test]
fn degrees_of_a_real_file_become_metres() {
    let Some(folder) = shared_data() else { return };
    let mut cloud = load(&std::fs::read(folder.join("scans/latlon_degrees.las")).unwrap()).0;
    assert_eq!(cloud.crs().vertical_unit, Some(Unit::Metre), "heights are metres");
    assert!(cloud.to_local_metres(), "degrees");
    let bounds = |axis: usize| {
        let values = (0..cloud.len()).map(|i| cloud.world_position(i)[axis]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    // 0.02283° of longitude at 95.5 km per degree, and 0.0106° of latitude at 110.87 km.
    let size = [0, 1, 2].map(|axis| bounds(axis).1 - bounds(axis).0);
    assert!((size[0] - 2181.0).abs() < 5.0 && (size[1] - 1174.7).abs() < 3.0, "{size:?}");
    assert!((size[2] - 39.038).abs() < 0.01, "{size:?}");
}

#[test]
fn real_files_survive_writing() {
    let Some(folder) = shared_data() else { return };
    let mut files: Vec<PathBuf> = CASES.iter().map(|case| folder.join(case.0)).collect();
    files.push(folder.join("malformed/las_gps_time_nan.las"));
    for path in files {
        let file = path.file_name().unwrap().to_string_lossy();
        let cloud = load(&std::fs::read(&path).unwrap()).0;
        for name in ["a.las", "a.laz"] {
            let (bytes, notes) = written(&cloud, name);
            assert!(notes.is_empty(), "{file} as {name}: {notes:?}");
            let back = load(&bytes).0;
            assert_eq!(back.len(), cloud.len(), "{file} as {name}");
            let step = cloud.resolution().unwrap();
            assert_eq!(back.resolution(), Some(step), "{file} as {name}");
            let same = |i| ((back.world_position(i) - cloud.world_position(i)) / step).abs().max_element() < 1e-3;
            assert!((0..cloud.len()).all(same), "{file} as {name}: every coordinate is the same number of steps");
            assert!(back.colors() == cloud.colors(), "{file} as {name}: colours");
            for field in cloud.fields() {
                let other = back.field(&field.name).unwrap_or_else(|| panic!("{file}: {} is lost", field.name));
                let (a, b) = (format!("{:?}", field.values), format!("{:?}", other.values));
                assert!(a == b, "{file} as {name}: {}", field.name);
            }
            assert_eq!(back.fields().len(), cloud.fields().len(), "{file} as {name}: nothing is added");
            let system = |cloud: &PointCloud| (cloud.crs().unit, cloud.crs().epsg, cloud.crs().geotiff.clone());
            assert_eq!(system(&back), system(&cloud), "{file} as {name}: coordinate system");
            // A system known by its code gets text, which has the code's own name.
            let stated = cloud.crs().wkt.is_some() || back.crs().wkt.is_none();
            let text = |cloud: &PointCloud| (cloud.crs().name.clone(), cloud.crs().wkt.clone());
            assert!(!stated || text(&back) == text(&cloud), "{file} as {name}: coordinate system");
        }
    }
}
