//! Files of points that come in parts: the same bytes and notes as of one cloud.

use std::path::Path;

use autosplats_cloud::{
    Clouds, Crs, Error, FieldValues, PointCloud, Progress, Scan, Unit,
    glam::{DMat4, DVec3},
};
use autosplats_formats::{open_parts, read_with, write, write_clouds, written_formats};

use crate::{
    common::{las_files::Notes, positions, rich_cloud},
    e57::{exact, posed},
};

/// A cloud that comes in parts of so many points.
struct Parts<'a>(&'a PointCloud, usize);

impl Clouds for Parts<'_> {
    fn name(&self) -> &Path {
        Path::new("parts")
    }

    fn read(
        &self,
        _progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        (0..self.0.len()).step_by(self.1).try_for_each(|start| {
            let mut part = self.0.clone();
            part.retain(|index| (start..start + self.1).contains(&index));
            let scans = part.scans().iter().filter(|scan| !scan.points.is_empty()).cloned().collect();
            take(&part.with_scans(scans))
        })
    }
}

/// Clouds with all that a format may hold or lose, more points than fill a packet of E57.
fn clouds() -> Vec<(&'static str, PointCloud)> {
    let crs = |unit, vertical_unit| Crs { unit: Some(unit), vertical_unit, ..Crs::default() };
    let many = rich_cloud(5000).with_scans(posed().scans().to_vec());
    let mut nowhere = positions(900);
    nowhere[700] = [f32::NAN, 0.0, 0.0];
    let returns = FieldValues::U8((0..900).map(|i| u8::from(i == 800) + 1).collect());
    let nowhere = PointCloud::new(DVec3::ZERO, nowhere)
        .with_field("ReturnNumber", returns.clone())
        .unwrap()
        .with_field("NumberOfReturns", returns)
        .unwrap()
        .with_field("Intensity", FieldValues::F32((0..900).map(|i| 0.5 - i as f32).collect()))
        .unwrap()
        .with_field("serial", FieldValues::U64((0..900).map(|i| if i == 850 { u64::MAX } else { i }).collect()))
        .unwrap();
    let mut bent = posed().scans().to_vec();
    bent[0].world_from_sensor = DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
    let degrees = rich_cloud(3000).with_crs(crs(Unit::Degree, Some(Unit::Foot)));
    vec![
        ("posed", posed()),
        ("many", many),
        ("points that are nowhere", nowhere),
        ("a pose that mirrors", posed().with_scans(bent)),
        ("in feet", posed().with_crs(crs(Unit::Foot, None))),
        ("in degrees", degrees),
    ]
}

#[test]
fn every_format_has_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    for extension in written_formats().flat_map(|(_, extensions)| extensions) {
        for (what, cloud) in clouds() {
            let outputs = [0, 1].map(|number| folder.path().join(format!("{number}.{extension}")));
            let notes = Notes::default();
            write(&cloud, &outputs[0], &notes).unwrap();
            let (notes, whole) = (notes.notes.into_inner().unwrap(), std::fs::read(&outputs[0]).unwrap());
            for size in [7, 450, 1 << 20] {
                // Cutting a large cloud into small parts takes long.
                if cloud.len() / size > 200 {
                    continue;
                }
                let own = Notes::default();
                write_clouds(&Parts(&cloud, size), &outputs[1], &own).unwrap();
                let own = own.notes.into_inner().unwrap();
                assert_eq!(own, notes, "{extension}, {what}, parts of {size}: notes");
                let parts = std::fs::read(&outputs[1]).unwrap();
                assert!(parts == whole, "{extension}, {what}, parts of {size}: bytes");
            }
        }
    }
}

#[test]
fn a_scan_without_points_is_written_by_its_place() {
    let mut scans = posed().scans().to_vec();
    scans.push(Scan { points: 95..95, ..scans[0].clone() });
    scans.insert(0, Scan { points: 20..20, ..scans[1].clone() });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.e57");
    write(&posed().with_scans(scans), &path, &()).unwrap();
    let back = read_with(&path, &exact(), &()).unwrap();
    let found: Vec<_> = back.scans().iter().map(|scan| scan.points.len()).filter(|&len| len > 0).collect();
    assert_eq!((back.len(), found), (100, vec![30, 30]), "others are as without it");
}

/// Of a field that is zero at every point a reader of LAS keeps the name, in parts as of the whole.
#[test]
fn fields_of_zeros_are_known() {
    let folder = tempfile::tempdir().unwrap();
    let tile = |class: u8| {
        let cloud = PointCloud::new(DVec3::ZERO, positions(50));
        cloud.with_field("Classification", FieldValues::U8(vec![class; 50])).unwrap()
    };
    for name in ["a.las", "a.laz", "a.copc.laz"] {
        let path = folder.path().join(name);
        write(&tile(0), &path, &()).unwrap();
        let whole = read_with(&path, &exact(), &()).unwrap();
        let mut parts = PointCloud::default();
        let opened = open_parts(&path, &exact(), &()).unwrap().expect("LAS is read in parts");
        let mut add = |part: &PointCloud| {
            parts.append(part.clone());
            Ok(())
        };
        Clouds::read(&opened, &(), &mut add).unwrap();
        assert_eq!(parts, whole, "{name}");
        assert!(whole.field("Classification").is_none() && whole.knows("Classification"), "{name}");
        assert!(!whole.knows("Infrared"), "{name}: the point format has none");
        let both = PointCloud::merge(vec![(whole, DMat4::IDENTITY), (tile(6), DMat4::IDENTITY)]);
        let values = both.field("Classification").map(|field| &field.values);
        assert_eq!(values, Some(&FieldValues::U8([[0; 50], [6; 50]].concat())), "{name}");
    }
}
