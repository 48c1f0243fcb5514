//! Tests of the engine's internals: its vectors and its bound.

use super::*;
use crate::camera::{Camera, Projection};
use crate::project::{ProjectRules, Projector};
use crate::test_clouds;
use autosplats_cloud::{PointCloud, glam::DVec3};

fn screen(positions: Vec<[f32; 3]>) -> (ScreenPoints, View) {
    let projection = Projection::PerspectiveFovDeg(30.0);
    let camera = Camera { eye: test_clouds::EYE, look_at: DVec3::ZERO, up: DVec3::NEG_Y, projection };
    let view = camera.view(DVec3::ZERO, [400, 400]).expect("a view");
    let cloud = PointCloud::new(DVec3::ZERO, positions);
    (Projector::default().project(&cloud, &view, &ProjectRules::usual(10), &crate::cancel::NEVER).clone(), view)
}

#[test]
fn vectors_of_any_width_give_the_same_bits() {
    for (name, positions) in test_clouds::all(2000) {
        let (screen, view) = screen(positions);
        let rules = SearchRules { k: 10, outlier_expansions: Some(3), gap_factor: Some(4.0), lenient: true };
        let task = SearchInput { screen: &screen, view: &view, rules: &rules, past: &Past::default() };
        let queries: Vec<u32> = (0..screen.points.len() as u32).collect();
        let mut blocks = vec![NeighborhoodBlock::default(); queries.len().div_ceil(LANES)];
        let mut scalar = blocks.clone();
        let counts = search_blocks(&task, &queries, &mut blocks, &mut Scratch::default());
        let of_scalar = search_blocks_with(pulp::Scalar, &task, &queries, &mut scalar, &mut Scratch::default());
        assert_eq!(counts, of_scalar, "{name}: counts");
        assert!(blocks == scalar, "{name}: neighbourhoods");
    }
}

/// The engine never holds many more candidates than the bound, however far apart the points lie.
#[test]
fn no_more_candidates_are_read_than_allowed() {
    let (screen, view) = screen(test_clouds::outliers(80_000));
    let queries: Vec<u32> = (0..screen.points.len() as u32).collect();
    assert!(queries.len() > 4 * MAX_CANDIDATES, "there is more than may be read: {}", queries.len());
    for (outlier_expansions, gap_factor) in [(Some(3), Some(4.0)), (None, None)] {
        let rules = SearchRules { k: 10, outlier_expansions, gap_factor, lenient: true };
        let mut blocks = vec![NeighborhoodBlock::default(); queries.len().div_ceil(LANES)];
        let mut scratch = Scratch::default();
        search_blocks(
            &SearchInput { screen: &screen, view: &view, rules: &rules, past: &Past::default() },
            &queries,
            &mut blocks,
            &mut scratch,
        );
        let read = scratch.candidates.len();
        assert!(read <= 2 * MAX_CANDIDATES + CANDIDATE_GROUP, "{read} candidates at a time with {rules:?}");
    }
}
