//! Tests of E57 files that are not quite right: XML, scans and poses with faults, and ends that are missing.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use autosplats_cloud::{
    Error, PointCloud,
    glam::{DMat4, DQuat, DVec3},
};
use autosplats_formats::{ReadOptions, describe_bytes, read_bytes};

use crate::{
    common::{field_file, las_files::Notes},
    e57::{checksum, exact, file, message, posed, written},
};

fn load(bytes: &[u8]) -> Result<(PointCloud, String), Error> {
    let notes = Notes::default();
    let cloud = read_bytes(Path::new("a.e57"), bytes, &ReadOptions::default(), &notes)?;
    let notes = notes.notes.into_inner().unwrap().join("\n");
    assert!(!notes.contains("\\'") && !notes.contains("\\\""), "quotes are shown as they are: {notes}");
    Ok((cloud, notes))
}

/// The file with another XML section.
fn with_xml(bytes: &[u8], change: impl Fn(&str) -> String) -> Vec<u8> {
    let word = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    let data: Vec<u8> = bytes.chunks(1024).flat_map(|page| &page[..1020]).copied().collect();
    let start = word(24) / 1024 * 1020 + word(24) % 1024;
    let xml = std::str::from_utf8(&data[start..start + word(32)]).unwrap();
    let changed = change(xml);
    let mut data = [&data[..start], changed.as_bytes()].concat();
    data[32..40].copy_from_slice(&(changed.len() as u64).to_le_bytes());
    data.resize(data.len().next_multiple_of(1020), 0);
    let len = data.len() as u64 / 1020 * 1024;
    data[16..24].copy_from_slice(&len.to_le_bytes());
    data.chunks(1020).flat_map(|page| [page, &checksum(page)].concat()).collect()
}

#[test]
fn faults_of_field_files_are_told() {
    for (name, count, told) in [
        ("e03_dup_ns.e57", 4000, "not well formed"),
        ("e03b_undeclared_ns.e57", 4000, "prefix 'nor'"),
        ("e05_no_prototype.e57", 4000, "scan 1 is left out: XML section: its points have no prototype"),
        ("e07_one_byte_short.e57", 4000, "cut off at byte 110591"),
        ("z7e_scan1_bad_pose.e57", 6000, "scan 1: its pose cannot be read ('abc' is no number"),
    ] {
        let Some(bytes) = field_file(name) else { return };
        let (cloud, notes) = load(&bytes).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(cloud.len(), count, "{name}");
        assert!(notes.contains(told), "{name}: {notes}");
        assert_eq!(cloud.field("NormalX").is_some(), name.starts_with("e03"), "{name}: normals of an extension");
        let about = describe_bytes(Path::new(name), &bytes, &ReadOptions::default()).unwrap();
        assert!(about.notes.iter().any(|note| note.contains(told)), "{name}: {:?}", about.notes);
    }
}

#[test]
fn xml_that_is_not_well_formed() {
    let bytes = written(&posed());
    let (whole, notes) = load(&with_xml(&bytes, str::to_owned)).unwrap();
    assert_eq!(notes, "", "nothing is wrong");
    let nor = r#" xmlns:nor="http://www.libe57.org/E57_NOR_surface_normals.txt""#;
    let cases: [(&str, &str, &str); 12] = [
        ("a namespace twice", nor, &nor.repeat(2)),
        ("an undeclared namespace", nor, ""),
        ("an attribute twice", "fileOffset=", "type=\"CompressedVector\" fileOffset="),
        ("a bare &", "<name type=\"String\">first", "<name type=\"String\">first & more"),
        ("an unknown entity", "<name type=\"String\">first", "<name type=\"String\">first&nbsp;"),
        ("a control character", "<name type=\"String\">first", "<name type=\"String\">fi\u{7}rst\u{0}"),
        ("a bare <", "<name type=\"String\">first", "<name type=\"String\">first < second"),
        ("a value without quotes", "versionMajor type=\"Integer\"", "versionMajor type=Integer"),
        ("words before", "<?xml", "a title\n<?xml"),
        ("a comment with hyphens", "<data3D", "<!-- a -- b --><data3D"),
        ("words behind", "</e57Root>", "</e57Root> more </e57Root>"),
        ("no end", "</images2D>\n</e57Root>", ""),
    ];
    for (what, from, to) in cases {
        let odd = with_xml(&bytes, |xml| {
            assert!(xml.contains(from), "{what}: there is no {from}");
            xml.replacen(from, to, 1)
        });
        let (cloud, notes) = load(&odd).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert!(notes.contains("not well formed"), "{what}: {notes}");
        assert_eq!((cloud.positions(), cloud.fields()), (whole.positions(), whole.fields()), "{what}");
        let name = cloud.scans()[0].name.as_deref().unwrap_or_default();
        assert!(name.starts_with("first") && !name.contains(char::is_control), "{what}: {name}");
    }
    let marked = load(&with_xml(&bytes, |xml| format!("\u{feff}{xml}"))).unwrap().0;
    assert_eq!(marked.positions(), whole.positions(), "a byte order mark");
    for nothing in ["", "no XML", "<a/>", "<e57Root", "<!DOCTYPE a [<!ENTITY b \"bb\">]><e57Root>&b;</e57Root>"] {
        assert!(message(&file(&[], nothing)).contains("XML section"), "{nothing}");
    }
}

#[test]
fn a_fault_in_the_description_of_a_scan_costs_that_scan() {
    let bytes = written(&posed());
    for (what, from, to) in [
        ("no prototype", "prototype", "prototypo"),
        ("unknown type", "<cartesianX type=\"Float\"", "<cartesianX type=\"Complex\""),
        ("not a valid recordCount", "recordCount=\"30\"", "recordCount=\"-3\""),
        ("no fileOffset", "fileOffset=", "fileOffcut="),
    ] {
        // The scan named 'first', the second one, and the last, which has no name.
        for (scan, shown, left) in [(0, "scan 1 'first'", 70), (1, "scan 2 'second", 70)] {
            let odd = with_xml(&bytes, |xml| {
                let mut parts: Vec<String> = xml.split("<vectorChild").map(str::to_owned).collect();
                parts[scan + 1] = parts[scan + 1].replace(from, to);
                parts.join("<vectorChild")
            });
            let (cloud, notes) = load(&odd).unwrap_or_else(|error| panic!("{what}: {error}"));
            assert_eq!(cloud.len(), left, "{what}: the other scans are read");
            assert!(notes.contains(shown) && notes.contains("is left out"), "{what}: {notes}");
            assert!(notes.contains(what), "{what}: {notes}");
            let about = describe_bytes(Path::new("a.e57"), &odd, &ReadOptions::default()).unwrap();
            assert!(about.notes.iter().any(|note| note.contains(what)), "{what}: {:?}", about.notes);
        }
        let all =
            message(&with_xml(&bytes, |xml| xml.replace(from, to).replace("recordCount=\"40\"", "recordCount=\"\"")));
        assert!(all.contains("scan 1 'first'"), "nothing is left: {all}");
    }
}

#[test]
fn poses_that_cannot_be_read_are_told() {
    let pose = DMat4::from_rotation_translation(DQuat::from_rotation_z(0.5), DVec3::new(7.0, 8.0, 9.0));
    let scan = autosplats_cloud::Scan { name: Some("hall".into()), world_from_sensor: pose, points: 0..300 };
    let cloud = PointCloud::new(DVec3::ZERO, crate::common::positions(300)).with_scans(vec![scan]);
    let bytes = written(&cloud);
    let unread = "its pose cannot be read";
    let edited = |parts: [&str; 2]| {
        with_xml(&bytes, |xml| {
            let (before, rest) = xml.split_once("<pose type=\"Structure\">").unwrap();
            let (_, after) = rest.split_once("</pose>").unwrap();
            let [rotation, translation] = parts;
            format!("{before}<pose type=\"Structure\">{rotation}{translation}</pose>{after}")
        })
    };
    let part = |name: &str, values: &[(&str, &str)]| {
        let values = values.iter().map(|(axis, value)| format!("<{axis} type=\"Float\">{value}</{axis}>"));
        format!("<{name} type=\"Structure\">{}</{name}>", values.collect::<String>())
    };
    let rotation = |w: &str, z: &str| part("rotation", &[("w", w), ("x", "0"), ("y", "0"), ("z", z)]);
    let translation = |x: &str| part("translation", &[("x", x), ("y", "8"), ("z", "9")]);
    let (turned, moved) = (rotation("0.9689124217106447", "0.24740395925452294"), translation("7"));
    let (_, good) = load(&edited([&turned, &moved])).unwrap();
    assert_eq!(good, "", "nothing is wrong");
    for (parts, told, has_pose) in [
        ([&turned, &translation("abc")], unread, false),
        ([&turned, &translation("NaN")], unread, false),
        ([&turned, &translation("inf")], unread, false),
        ([&rotation("nan", "0"), &moved], unread, false),
        ([&turned, &part("translation", &[("x", "7"), ("y", "8")])], "has no z", false),
        ([&part("rotation", &[("x", "0"), ("y", "0"), ("z", "0.5")]), &moved], "has no w", false),
        ([&rotation("0", "0"), &moved], "its rotation is zero", true),
        ([&rotation("3", "0"), &moved], "length 3, not 1", true),
        ([&turned, &String::new()], "it has no translation", true),
        ([&String::new(), &moved], "it has no rotation", true),
    ] {
        let bytes = edited(parts.map(String::as_str));
        let (cloud, notes) = load(&bytes).unwrap_or_else(|error| panic!("{told}: {error}"));
        assert!(notes.contains("scan 1 'hall': ") && notes.contains(told), "{told}: {notes}");
        assert_eq!((cloud.len(), cloud.scans().len()), (300, usize::from(has_pose)), "{told}: {notes}");
        let about = describe_bytes(Path::new("a.e57"), &bytes, &ReadOptions::default()).unwrap();
        assert!(about.notes.iter().any(|note| note.contains(told)), "{told}: {:?}", about.notes);
    }
}

#[test]
fn ends_that_are_missing() {
    let bytes = written(&posed());
    let whole = load(&bytes).unwrap().0;
    let xml = u64::from_le_bytes(bytes[24..32].try_into().unwrap()) as usize;
    for missing in 1..bytes.len() - xml {
        let cut = &bytes[..bytes.len() - missing];
        match load(cut) {
            Ok((cloud, notes)) => {
                assert!(notes.contains(&format!("cut off at byte {}", cut.len())), "{missing} bytes: {notes}");
                let left = cloud.len();
                assert!(left == 100 || [30, 60].contains(&left), "{missing} bytes: {left} points");
                assert!(left == 100 || notes.contains("is left out") || notes.contains("not well formed"), "{notes}");
                assert!(missing > 4 || cloud.positions() == whole.positions(), "{missing} bytes: only a checksum");
            }
            Err(error) => assert!(missing > 4, "{missing} bytes: {error}"),
        }
    }
    assert!(message(&bytes[..xml]).contains("cut off"), "no XML section");
    assert!(message(&bytes[..1020]).contains("cut off"), "nothing but the first points");
}

#[test]
fn constants_and_overlaps_take_no_memory() {
    let constant = "type=\"Integer\" minimum=\"1\" maximum=\"1\"";
    let axes = |kind: &str| ["X", "Y", "Z"].map(|axis| format!("<cartesian{axis} {kind}/>")).concat();
    let scan = |count: &str, values: &str| {
        format!(
            "<vectorChild type=\"Structure\"><points type=\"CompressedVector\" fileOffset=\"48\" \
             recordCount=\"{count}\"><prototype type=\"Structure\">{values}</prototype></points></vectorChild>"
        )
    };
    let root = |scans: &str| format!("<e57Root><data3D type=\"Vector\">{scans}</data3D></e57Root>");
    let mut data = vec![0; 32];
    data[0] = 1;
    data[8..16].copy_from_slice(&(32_u64 + 512).to_le_bytes());
    data[16..24].copy_from_slice(&80_u64.to_le_bytes());
    // A packet of four streams, the last with 480 bytes.
    data.extend([1, 0, 0xff, 1, 4, 0, 0, 0, 0, 0, 0, 0, 0xe0, 1]);
    data.resize(32 + 512, 0x55);
    for count in ["350000000000", "18446744073709551615"] {
        for flag in [constant, "type=\"Integer\" minimum=\"0\" maximum=\"1\""] {
            let bytes = file(&data, &root(&scan(count, &format!("{}<flag {flag}/>", axes(constant)))));
            let message = message(&bytes);
            let told = format!("byte 48: scan 1: {count} points in 512 bytes, less than a byte each");
            assert!(message.contains(&told), "{flag}: {message}");
        }
    }
    let eight = "<flag type=\"Integer\" minimum=\"0\" maximum=\"255\"/>";
    let one = scan("480", &(axes(constant) + eight));
    let cloud = read_bytes(Path::new("a.e57"), &file(&data, &root(&one)), &exact(), &()).unwrap();
    assert_eq!((cloud.len(), cloud.positions()[479]), (480, [1.0; 3]), "constants are values");
    let bytes = file(&data, &root(&one.repeat(20_000)));
    let start = Instant::now();
    let notes = Notes::default();
    let cloud = read_bytes(Path::new("a.e57"), &bytes, &exact(), &notes).unwrap();
    assert!(cloud.len() <= bytes.len(), "{} points of {} bytes", cloud.len(), bytes.len());
    let notes = notes.notes.into_inner().unwrap().join("\n");
    assert!(notes.contains("overlap"), "{notes}");
    // One element per kind of attack on the XML parser.
    let wide = format!("<e57Root {}/>", (0..100_000).map(|i| format!("a{i}=\"\" ")).collect::<String>());
    assert!(message(&file(&[], &wide)).contains("a tag of"), "many attributes");
    let spaces = (0..50_000).map(|i| format!("<a xmlns:p{i}=\"u{i}\">")).collect::<String>();
    assert!(message(&file(&[], &format!("<e57Root>{spaces}"))).contains("namespaces"), "many namespaces");
    assert!(message(&file(&[], &"<a>".repeat(300_000))).contains("XML section"), "deep nesting");
    let laughs = "<!DOCTYPE a [<!ENTITY b \"bbbb\">]><e57Root>&b;</e57Root>";
    assert!(message(&file(&[], laughs)).contains("XML section"), "entities");
    // Far above what they take on a slow machine: quadratic time is what this looks for.
    assert!(start.elapsed() < Duration::from_secs(100), "all at once: {:?}", start.elapsed());
}
