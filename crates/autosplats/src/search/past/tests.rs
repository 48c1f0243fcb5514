//! The past changes only the work of a search, never its result.

use autosplats_cloud::glam::DVec3;

use super::*;
use crate::camera::{Camera, View};
use crate::project::ProjectRules;
use crate::search::screen_grid::gpu::tests::{Moments, cameras, host_moments, projected};
use crate::search::{SearchCounts, SearchRules, screen_grid};
use crate::test_clouds::{self, Random};

const SIZE: [u32; 2] = [121, 90];

fn seen(view: &View) -> PlacedView {
    PlacedView { view: *view, origin: DVec3::ZERO }
}

/// A past with these radii, seen by `view`.
fn past(view: &View, k: u32, radii: &[f32]) -> Past {
    let pixels = radii.iter().map(|radius| AtomicU32::new(radius.to_bits())).collect();
    let mut past =
        Past { last: PastRadii { seen: Some((seen(view), k)), pixels, ..PastRadii::default() }, ..Past::default() };
    past.begin(seen(view), k);
    past
}

/// The radii that a search of this frame stores for each pixel.
pub(crate) fn found(screen: &ScreenPoints, view: &View, k: u32) -> Vec<f32> {
    let rules = SearchRules { k, outlier_expansions: None, gap_factor: None, lenient: true };
    let queries: Vec<u32> = (0..screen.points.len() as u32).collect();
    let mut past = Past::default();
    past.begin(seen(view), k);
    let mut neighborhoods = Neighborhoods::default();
    screen_grid::search(screen, &queries, view, &rules, &past, &mut neighborhoods, &crate::cancel::NEVER);
    past.keep(screen, &queries, &neighborhoods);
    past.end();
    past.last.pixels.iter().map(|radius| f32::from_bits(radius.load(Ordering::Relaxed))).collect()
}

/// Random radii of about the right order of magnitude.
pub(crate) fn garbage(screen: &ScreenPoints, view: &View, k: u32, random: &mut Random) -> Vec<f32> {
    let depth = screen.points.first().map_or(1.0, |point| screen.density.initial_radius(point, k, view));
    (0..view.width * view.height).map(|_| depth * 10_f32.powf(1.5 * random.signed())).collect()
}

fn search(screen: &ScreenPoints, view: &View, rules: &SearchRules, past: &Past) -> (Vec<Moments>, SearchCounts) {
    let queries: Vec<u32> = (0..screen.points.len() as u32).collect();
    let mut neighborhoods = Neighborhoods::default();
    screen_grid::search(screen, &queries, view, rules, past, &mut neighborhoods, &crate::cancel::NEVER);
    (host_moments(&neighborhoods, queries.len()), neighborhoods.counts)
}

#[test]
fn the_past_changes_nothing() {
    let mut random = Random::new(3);
    for k in [1, 3, 10, 17, 64] {
        for (camera, (name, positions)) in cameras()
            .into_iter()
            .flat_map(|camera| test_clouds::all(4000).into_iter().map(move |cloud| (camera, cloud)))
        {
            let (screen, view) = projected(&positions, &camera, SIZE, &ProjectRules::usual(k));
            let pasts = [found(&screen, &view, k), garbage(&screen, &view, k, &mut random)];
            for (e0, lambda) in [(Some(1), Some(4.0)), (Some(3), None), (None, Some(2.0)), (None, None)] {
                let rules = SearchRules { k, outlier_expansions: e0, gap_factor: lambda, lenient: e0.is_some() };
                let without = search(&screen, &view, &rules, &Past::default());
                for radii in &pasts {
                    let with = search(&screen, &view, &rules, &past(&view, k, radii));
                    assert!(with == without, "{name}, {:?}, {rules:?}", camera.projection);
                }
            }
        }
    }
}

/// Sparse points beside a crowd may meet the bound on search work. The starting radius must not matter there either.
#[test]
fn the_past_changes_nothing_at_the_bound() {
    let mut random = Random::new(6);
    let mut positions = test_clouds::plane(400);
    positions.extend(test_clouds::clumps(30_000));
    positions.extend(test_clouds::outliers(2000));
    let mut bounded = 0;
    for camera in cameras() {
        for k in [10, 64] {
            let (screen, view) = projected(&positions, &camera, [400, 300], &ProjectRules::usual(k));
            assert!(screen.points.len() > 4096, "more than are read: {}", screen.points.len());
            let rules = SearchRules { k, outlier_expansions: None, gap_factor: None, lenient: true };
            let without = search(&screen, &view, &rules, &Past::default());
            bounded += without.1.bounded;
            for radii in [found(&screen, &view, k), garbage(&screen, &view, k, &mut random)] {
                let with = search(&screen, &view, &rules, &past(&view, k, &radii));
                assert!(with == without, "k = {k}, {:?}", camera.projection);
            }
        }
    }
    assert!(bounded > 0, "some meet the bound");
}

/// After a step aside the radius of a point is found again, unless the point was outside the picture.
#[test]
fn radii_are_found_again_from_elsewhere() {
    let camera = cameras()[0];
    let (screen, view) = projected(&test_clouds::plane(3000), &camera, SIZE, &ProjectRules::usual(10));
    let radii = found(&screen, &view, 10);
    let step = Camera { eye: camera.eye + DVec3::new(0.2, 0.1, 0.0), ..camera };
    let (moved, moved_view) = projected(&test_clouds::plane(3000), &step, SIZE, &ProjectRules::usual(10));
    let mut past = past(&view, 10, &radii);
    past.begin(seen(&moved_view), 10);
    let then: std::collections::HashMap<u32, f32> = (0..screen.points.len())
        .map(|at| {
            let [x, y] = screen.points[at].pixel_xy();
            (screen.source[at], radii[y * view.width as usize + x])
        })
        .collect();
    let (mut same, mut known) = (0, 0);
    for (point, source) in moved.points.iter().zip(&moved.source) {
        let initial_radius = moved.density.initial_radius(point, 10, &moved_view);
        let Some(radius) = past.radius(point.position_view, initial_radius) else { continue };
        known += 1;
        same += usize::from(then.get(source) == Some(&radius));
    }
    assert!(known * 10 > moved.points.len() * 8, "{known} of {} look back at something", moved.points.len());
    assert!(same * 10 > known * 8, "{same} of {known} find themselves");
}

#[test]
fn what_is_another_question_is_not_answered() {
    let camera = cameras()[0];
    let (screen, view) = projected(&test_clouds::plane(3000), &camera, SIZE, &ProjectRules::usual(10));
    let point = screen.points[screen.points.len() / 2];
    let initial_radius = screen.density.initial_radius(&point, 10, &view);
    let mut past = past(&view, 10, &found(&screen, &view, 10));
    assert!(past.radius(point.position_view, initial_radius).is_some(), "the same k");
    assert_eq!(past.radius(point.position_view, 100.0 * initial_radius), None, "of another surface");
    past.begin(seen(&view), 11);
    assert_eq!(past.radius(point.position_view, initial_radius), None, "another k");
    past.forget();
    past.begin(seen(&view), 10);
    assert_eq!(past.radius(point.position_view, initial_radius), None, "forgotten");
}

#[test]
fn a_past_that_is_wrong_is_not_trusted() {
    let mut trust = Trust::default();
    let looks = |trust: &mut Trust, missed: f32| {
        (0..64)
            .filter(|_| {
                let looks = trust.looks_back();
                if looks {
                    trust.learn(missed);
                }
                looks
            })
            .count()
    };
    assert_eq!(looks(&mut trust, 1.0), 64, "what is right is looked at by all");
    let wrong = looks(&mut trust, 1.6);
    assert!((8..16).contains(&wrong), "what is wrong is looked at by one of eight: {wrong}");
    assert!(trust.slack().is_none() && looks(&mut trust, 1.0) > 16, "and again by all once it is right");
}
