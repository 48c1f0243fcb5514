//! Tests of merging several clouds.

use std::path::Path;

use crate::common::{colors, positions, rich_cloud};
use autosplats_cloud::{
    Axes, Clouds, Error, FieldValues, Merged, PointCloud, Progress,
    glam::{DMat4, DVec3},
};

#[test]
fn one_part_stays_as_it_is() {
    let cloud = rich_cloud(100);
    let before = cloud.positions().as_ptr();
    let merged = PointCloud::merge(vec![(cloud.clone(), DMat4::IDENTITY)]);
    assert!(merged == cloud, "nothing changes");
    let merged = PointCloud::merge(vec![(cloud, DMat4::IDENTITY), (PointCloud::default(), DMat4::IDENTITY)]);
    assert_eq!(merged.positions().as_ptr(), before, "nothing is copied, and an empty part counts for nothing");
    assert!(PointCloud::merge(Vec::new()).is_empty(), "nothing from nothing");
}

#[test]
fn poses_move_points_in_world_coordinates() {
    let one = || PointCloud::new(DVec3::ZERO, vec![[1.0, 2.0, 3.0]]);
    let far = PointCloud::new(DVec3::new(5e5, 5e6, 0.0), vec![[0.25, 0.5, 0.75]]);
    let pose = DMat4::from_translation(DVec3::new(10.0, 0.0, 0.0)) * DMat4::from_scale(DVec3::splat(2.0));
    let near = PointCloud::merge(vec![(one(), DMat4::IDENTITY), (one(), pose)]);
    assert_eq!((near.origin(), near.positions()), (DVec3::ZERO, &[[1.0, 2.0, 3.0], [12.0, 4.0, 6.0]][..]), "near");

    let back = DMat4::from_translation(DVec3::new(1.0, 1.0, 0.0));
    let merged = PointCloud::merge(vec![(far.clone(), DMat4::IDENTITY), (far.clone(), back)]);
    assert_eq!(merged.origin(), far.origin(), "the first part's origin");
    assert_eq!(merged.positions()[0], far.positions()[0], "the first part's bits");
    assert_eq!(merged.world_position(1), DVec3::new(500_001.25, 5_000_001.5, 0.75), "moved in f64");

    let home = DMat4::from_translation(DVec3::new(-5e5, -5e6, 0.0));
    let merged = PointCloud::merge(vec![(one(), DMat4::IDENTITY), (far, home)]);
    assert_eq!((merged.origin(), merged.positions()[1]), (DVec3::ZERO, [0.25, 0.5, 0.75]), "posed to the origin");
}

#[test]
fn attributes_of_unlike_parts() {
    let bare = PointCloud::new(DVec3::ZERO, positions(2));
    let field = |values| bare.clone().with_field("Intensity", values).unwrap();
    let merge = |a: &PointCloud, b: &PointCloud| {
        PointCloud::merge(vec![(a.clone(), DMat4::IDENTITY), (b.clone(), DMat4::IDENTITY)])
    };
    let colored = bare.clone().with_colors(colors(2)).unwrap().with_axes(Axes::ZUp);
    let merged = merge(&bare, &colored);
    let grey = [200; 3];
    assert_eq!(merged.colors().unwrap(), [grey, grey, colors(2)[0], colors(2)[1]], "grey where there is no colour");
    assert_eq!(merged.axes(), Some(Axes::ZUp), "one part states none");
    assert_eq!(merge(&colored, &bare.clone().with_axes(Axes::YUp)).axes(), None, "the parts disagree");
    assert_eq!(merge(&colored, &colored).axes(), Some(Axes::ZUp), "the parts agree");

    let (bytes, floats) = (field(FieldValues::U8(vec![1, 2])), field(FieldValues::F32(vec![0.5, 3.0])));
    let values = |cloud: &PointCloud| cloud.fields()[0].values.clone();
    assert_eq!(values(&merge(&bytes, &bytes)), FieldValues::U8(vec![1, 2, 1, 2]), "one width");
    assert_eq!(values(&merge(&bytes, &floats)), FieldValues::F64(vec![1.0, 2.0, 0.5, 3.0]), "two widths");
    assert!(merge(&bytes, &bare).fields().is_empty(), "a field that one part lacks is dropped");
}

/// A cloud that comes in parts of two points.
struct Twos(PointCloud);

impl Clouds for Twos {
    fn name(&self) -> &Path {
        Path::new("twos")
    }

    fn read(
        &self,
        _progress: &dyn Progress,
        take: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let len = self.0.len();
        (0..len).step_by(2).try_for_each(|start| take(&self.0.slice(start..len.min(start + 2))))
    }
}

#[test]
fn what_is_zero_is_not_unknown() {
    let bare = PointCloud::new(DVec3::ZERO, positions(3));
    let zero = bare.clone().with_zeros(["Classification", "UserData"]);
    let bytes = FieldValues::U8(vec![6, 0, 7]);
    let class = bare.clone().with_field("Classification", bytes.clone()).unwrap().with_zeros(["UserData"]);
    let wide = bare.clone().with_field("Classification", FieldValues::I32(vec![-1; 3])).unwrap();
    let merged = |clouds: &[&PointCloud]| {
        let merged = PointCloud::merge(clouds.iter().map(|&cloud| (cloud.clone(), DMat4::IDENTITY)).collect());
        let inputs = clouds.iter().map(|&cloud| Box::new(Twos(cloud.clone())) as Box<dyn Clouds>).collect();
        let mut parts = PointCloud::default();
        let add = &mut |part: &PointCloud| {
            parts.append(part.clone());
            Ok(())
        };
        Merged::new("all".into(), inputs, &()).unwrap().read(&(), add).unwrap();
        assert_eq!(parts, merged, "in parts");
        merged
    };
    let only = |cloud: PointCloud| {
        assert_eq!(cloud.fields().len(), 1);
        cloud.fields()[0].values.clone()
    };
    let values = FieldValues::U8([6, 0, 7, 0, 0, 0].into());
    assert_eq!(only(merged(&[&class, &zero])), values, "zeros behind");
    let values = FieldValues::U8([0, 0, 0, 6, 0, 7].into());
    assert_eq!(only(merged(&[&zero, &class])), values, "and before");
    let values = FieldValues::I32([-1, -1, -1, 0, 0, 0].into());
    assert_eq!(only(merged(&[&wide, &zero])), values, "zeros are of any type");
    let values = FieldValues::F64([-1.0, -1.0, -1.0, 6.0, 0.0, 7.0, 0.0, 0.0, 0.0].into());
    assert_eq!(only(merged(&[&wide, &class, &zero])), values, "other values are not");
    assert!(merged(&[&class, &bare]).fields().is_empty(), "nothing is known of one part");
    // What is zero everywhere stays known.
    let three = merged(&[&zero, &class]);
    let user = bare.with_field("UserData", bytes).unwrap().with_zeros(["Classification"]);
    assert!(three.knows("UserData") && !merged(&[&class, &wide]).knows("UserData"));
    assert_eq!(merged(&[&three, &user]).fields().len(), 2, "in a second round too");
    assert!(!user.clone().with_field("Classification", FieldValues::U8(vec![1; 3])).unwrap().knows("userdata"), "case");
}
