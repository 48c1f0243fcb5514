//! Points near the eye against brute force over all points.

use autosplats_cloud::PointCloud;
use autosplats_cloud::glam::DVec3;

use crate::camera::{Camera, Projection, View};
use crate::project::{ProjectRules, Projector};
use crate::test_clouds::{Positions, Random};

const K: u32 = 10;

/// A walker's view at `eye`.
fn view(eye: DVec3) -> View {
    let projection = Projection::PerspectiveFovDeg(60.0);
    let camera = Camera { eye, look_at: eye + DVec3::new(10.0, 3.0, -1.0), up: DVec3::Z, projection };
    camera.view(DVec3::ZERO, [160, 120]).expect("a view").with_margin(10)
}

/// Level ground with a point per square unit.
fn ground(random: &mut Random) -> Positions {
    (0..40_000).map(|_| [100.0 * random.signed(), 100.0 * random.signed(), 0.0]).collect()
}

/// Ground with a point per square unit, seen by a walker: near points are those of brute force over the cells, and are
/// listed wherever they lie.
#[test]
fn near_points_are_listed_all_around() {
    let mut random = Random::new(91);
    let eye = DVec3::new(0.3, -0.2, 1.7);
    let mut positions = ground(&mut random);
    // A crowd, one point of which lies alone in a cell: it is not near.
    positions.extend((0..500).map(|_| [3.0 + 0.01 * random.unit(), 0.01 * random.unit(), 1.0]));
    let view = view(eye);
    let rules = ProjectRules { near: true, ..ProjectRules::usual(K) };
    let cloud = PointCloud::new(DVec3::ZERO, positions.clone());
    let mut projector = Projector::default();
    let screen = projector.project(&cloud, &view, &rules, &crate::cancel::NEVER);
    let listed = &screen.points[screen.near_first..];
    let is_spoken_for = |source: u32| {
        let all =
            screen.points.iter().zip(&screen.source).filter(|&(point, other)| *other == source && point.is_near());
        all.filter(|(point, _)| !point.is_silent()).count()
    };
    for (source, position) in (0..).zip(&positions) {
        let distance = DVec3::from(position.map(f64::from)).distance(eye);
        let crowded = source >= 40_000;
        let from_crowd = DVec3::from(position.map(f64::from)).distance(DVec3::new(3.0, 0.0, 1.0));
        // All around, ahead and behind. Cells differ in size, so that distances in between are undecided, as are
        // points to which the crowd is about as close as their neighbours.
        if !crowded && distance < 2.5 && from_crowd > 3.0 {
            assert_eq!(is_spoken_for(source), 1, "point {source} at {position:?} is near");
        }
        if crowded || distance > 30.0 {
            assert_eq!(is_spoken_for(source), 0, "point {source} at {position:?} is not near");
        }
    }
    let behind = listed.iter().filter(|point| point.position_view[2] < 0.0 && !point.is_silent()).count();
    assert!(behind > 10, "{behind} near points are behind the eye");
    let silent: Vec<u32> = (0..).zip(&screen.points).filter(|(_, point)| point.is_silent()).map(|(at, _)| at).collect();
    assert!(silent.iter().all(|at| screen.passive.binary_search(at).is_ok()), "silent points ask for nothing");
    for (point, source) in screen.points[..screen.near_first].iter().zip(&screen.source) {
        assert_eq!(point.is_silent(), is_spoken_for(*source) == 1, "point {source} is drawn once");
    }
    let alone = projector.project(&cloud, &view, &ProjectRules::usual(K), &crate::cancel::NEVER);
    assert_eq!(alone.near_first, alone.points.len(), "nothing is listed without being asked for");
}

/// Sparse ground, dense walls on it and strays before them: near points have their neighbours in the list.
#[test]
fn neighbors_of_near_points_are_listed() {
    let mut random = Random::new(92);
    let mut positions = ground(&mut random);
    let mut wall = |x: f32, half: f32| {
        positions.extend((0..50_000).map(|_| [x, half * random.signed(), half * random.unit()]));
    };
    wall(6.0, 1.0);
    wall(-25.0, 20.0);
    positions.extend([[-19.0, 0.0, 12.0], [-18.8, 0.1, 12.0], [-3.0, 8.0, 2.0], [5.0, 0.0, 1.5]]);
    let cloud = PointCloud::new(DVec3::ZERO, positions);
    let mut near = 0;
    for eye in [[0.3, -0.2, 1.7], [-6.0, 1.0, 3.0], [4.0, 2.0, 0.5]] {
        let rules = ProjectRules { near: true, ..ProjectRules::usual(K) };
        let view = view(DVec3::from(eye));
        let mut projector = Projector::default();
        let screen = projector.project(&cloud, &view, &rules, &crate::cancel::NEVER);
        let at = |index: u32| cloud.world_position(index as usize);
        // Distance to the k-th neighbour.
        let radius = |of: u32, among: &mut dyn Iterator<Item = u32>| {
            let others = among.filter(|other| *other != of);
            let mut distances: Vec<f64> = others.map(|index| at(index).distance(at(of))).collect();
            *distances.select_nth_unstable_by(K as usize - 1, f64::total_cmp).1
        };
        let listed = &screen.source[screen.near_first..];
        for (point, &source) in screen.points[screen.near_first..].iter().zip(listed) {
            if !point.is_silent() {
                let found = radius(source, &mut listed.iter().copied());
                let expected = radius(source, &mut (0..cloud.len() as u32));
                // Cells are looked up at some places only, so that one may be missed.
                assert!(found < 1.5 * expected, "{eye:?}, point {source}: k-radius {found} instead of {expected}");
                near += 1;
            }
        }
    }
    assert!(near > 500, "{near} points are near");
}
