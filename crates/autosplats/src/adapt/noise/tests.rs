//! The sample: which surfels are chosen.

use autosplats_cloud::glam::DVec3;

use super::super::tests::{Case, PROJECTIONS};
use super::*;
use crate::camera::{Camera, Projection};
use crate::test_clouds::{self, noisy};

/// A corner of a survey, with a coordinate below zero.
const FAR: DVec3 = DVec3::new(512_000.25, -5_400_000.75, -0.5);

#[test]
fn the_order_of_points_does_not_matter() {
    let positions = noisy(test_clouds::sphere(40_000), 0.02);
    let reversed: Vec<_> = positions.iter().rev().copied().collect();
    for projection in PROJECTIONS {
        let [noise, other] =
            [&positions, &reversed].map(|positions| Case::new(positions, projection, [400, 300]).noise());
        assert!(noise.level > 0.0);
        assert_eq!(noise, other, "{projection:?}");
    }
}

/// Places keep their hashes when the eye moves; places beside them have others.
#[test]
fn hashes_stay_when_the_eye_moves() {
    let looks = |eye: DVec3| {
        let camera =
            Camera { eye, look_at: eye + DVec3::Z, up: DVec3::NEG_Y, projection: Projection::PerspectiveFovDeg(45.0) };
        camera.view(FAR, [1000, 1000]).expect("a view")
    };
    let [view, moved] = [FAR, FAR + DVec3::new(0.37, -0.11, 0.0)].map(looks);
    let mut random = test_clouds::Random::new(5);
    let places: Vec<Vec3> = (0..10_000).map(|_| Vec3::from(random.direction()).abs() * 8.0 + 1.0).collect();
    let hashes = |view: &View, shift: Vec3| -> Vec<u32> {
        places.iter().map(|&place| hash_place(place + shift, view.eye_parts(), view)).collect()
    };
    let own = hashes(&view, Vec3::ZERO);
    let alike = |other: &[u32]| own.iter().zip(other).filter(|(a, b)| a == b).count();
    let by_other_eye = hashes(&moved, (view.eye - moved.eye).as_vec3());
    assert!(alike(&by_other_eye) > 9900, "{} of 10,000 stay", alike(&by_other_eye));
    let beside = hashes(&view, Vec3::X * view.pixel_size(9.0));
    assert!(alike(&beside) < 100, "{} of 10,000 are as beside them", alike(&beside));
    // As many as chance chooses.
    let chosen = own.iter().filter(|&&hash| hash < u32::MAX / 10).count();
    assert!((850..1150).contains(&chosen), "{chosen} of 10,000 in a tenth");
}
