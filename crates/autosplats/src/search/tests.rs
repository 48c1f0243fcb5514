//! The screen grid on the CPU against all pairwise distances in `f64`. Each engine's `gpu/tests.rs` compares the screen
//! grid and splat communication on a GPU with this engine, and the kd-tree with brute force.

use autosplats_cloud::PointCloud;
use autosplats_cloud::glam::{DVec3, Vec3};

use super::past::Past;
use super::{
    LANES, MAX_CANDIDATES, NeighborhoodBlock, Neighborhoods, OUTLIER_RADIUS_SLACK, SearchCounts, SearchRules,
    screen_grid,
};
use crate::camera::{Camera, Projection, View};
use crate::project::{ProjectRules, Projector, ScreenPoints};
use crate::test_clouds::{self, EYE, Positions};

type Search = fn(&ScreenPoints, &[u32], &View, &SearchRules, &Past, &mut Neighborhoods, &crate::cancel::Cancel<'_>);
const ENGINES: [(&str, Search); 1] = [("screen grid", screen_grid::search)];

const KS: [u32; 5] = [1, 3, 10, 16, 64];
/// Relative distance to a threshold within which f32 rounding of a distance and a radius may decide.
const ROUNDING: f64 = 2e-6;

fn rules(k: u32) -> SearchRules {
    SearchRules { k, outlier_expansions: Some(3), gap_factor: Some(4.0), lenient: true }
}

fn cameras() -> [Camera; 2] {
    let camera = |projection| Camera { eye: EYE, look_at: DVec3::ZERO, up: DVec3::new(0.1, -1.0, 0.0), projection };
    [camera(Projection::PerspectiveFovDeg(30.0)), camera(Projection::OrthographicHeight(2.1))]
}

fn screen(positions: &[[f32; 3]], camera: &Camera, size: [u32; 2], k: u32) -> (ScreenPoints, View) {
    let cloud = PointCloud::new(DVec3::ZERO, positions.to_vec());
    let view = camera.view(DVec3::ZERO, size).expect("a view");
    (Projector::default().project(&cloud, &view, &ProjectRules::usual(k), &crate::cancel::NEVER).clone(), view)
}

/// The other screen points and their distances, ascending, for each screen point.
struct Oracle {
    others: Vec<Vec<(f64, usize)>>,
    positions: Vec<DVec3>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fate {
    Outlier,
    Clamped,
    Whole,
}

/// Expected result for one point.
#[derive(Debug)]
struct Expected {
    fate: Fate,
    /// Number of neighbours, without others at the same distance as the last.
    count: usize,
    /// K-radius; 0 for outliers.
    radius: f64,
    /// Whether a threshold of the rules is so near that rounding decides.
    unsure: bool,
}

impl Oracle {
    fn new(screen: &ScreenPoints) -> Self {
        let positions: Vec<DVec3> = screen.points.iter().map(|p| DVec3::from(p.position_view.map(f64::from))).collect();
        let others = |p: usize| {
            let all = (0..positions.len()).filter(|&q| q != p).map(|q| ((positions[q] - positions[p]).length(), q));
            let mut all: Vec<_> = all.collect();
            all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            all
        };
        Self { others: (0..positions.len()).map(others).collect(), positions }
    }

    /// First search radius r̃₀ of §5.1, from the number of screen points in the cell.
    fn initial_radius(&self, screen: &ScreenPoints, view: &View, k: u32, point: usize) -> f64 {
        let side = screen.density.cell_px;
        let cell = |i: usize| screen.points[i].pixel_xy().map(|c| c / side);
        let count = (0..screen.points.len()).filter(|&i| cell(i) == cell(point)).count();
        let radius_px = ((side * side) as f64 * f64::from(k) / (std::f64::consts::PI * count as f64)).sqrt();
        let depth = if view.perspective { self.positions[point].z } else { 1.0 };
        radius_px * depth / f64::from(view.focal_px)
    }

    /// Applies the rules of the search stage.
    fn expect(&self, rules: &SearchRules, initial_radius: f64, point: usize) -> Expected {
        let k = rules.k as usize;
        let distance = |j: usize| self.others[point].get(j - 1).map_or(f64::INFINITY, |&(d, _)| d);
        let mut unsure = false;
        let mut exceeds = |a: f64, b: f64| {
            unsure |= (a - b).abs() <= ROUNDING * b;
            a > b
        };
        let mut beyond = |factor: f64| {
            let radius = |e0: u32| factor * initial_radius * f64::from(rules.k.max(10)).sqrt().powi(e0 as i32);
            rules.outlier_expansions.is_some_and(|e0| exceeds(distance(1), radius(e0)))
        };
        let is_lone = beyond(1.0);
        let is_alone = is_lone && (!rules.lenient || beyond(f64::from(OUTLIER_RADIUS_SLACK)));
        if is_alone || self.others[point].is_empty() {
            return Expected { fate: Fate::Outlier, count: 0, radius: 0.0, unsure };
        }
        let gap = rules.gap_factor.and_then(|lambda| {
            let growth = f64::from(lambda).sqrt();
            let after = |j| if rules.lenient && j == 1 { f64::from(lambda) } else { growth };
            (1..k).find(|&j| exceeds(distance(j + 1), (after(j) * distance(j)).max(growth * initial_radius)))
        });
        if is_lone && gap.is_some() {
            return Expected { fate: Fate::Outlier, count: 0, radius: 0.0, unsure };
        }
        let end = gap.unwrap_or(k).min(self.others[point].len());
        let fate = if end < k { Fate::Clamped } else { Fate::Whole };
        Expected { fate, count: end, radius: distance(end), unsure }
    }

    /// The other points within `radius` of a point.
    fn within(&self, point: usize, radius: f64) -> &[(f64, usize)] {
        let others = &self.others[point];
        &others[..others.partition_point(|&(d, _)| d <= radius)]
    }
}

/// One neighbourhood of a block.
#[derive(Clone, Copy, Debug)]
struct Found {
    count: f64,
    k_radius: f64,
    offset: DVec3,
    second: [f64; 6],
}

fn found(neighborhoods: &Neighborhoods, index: usize) -> Found {
    let NeighborhoodBlock { count, k_radius, offset, second } = &neighborhoods.blocks[index / LANES];
    let lane = |lanes: &super::Lanes| f64::from(lanes.0[index % LANES]);
    Found {
        count: lane(count),
        k_radius: lane(k_radius),
        offset: DVec3::from(offset.each_ref().map(lane)),
        second: second.each_ref().map(lane),
    }
}

/// Compares the sums of one neighbourhood with the sums over all points within its radius.
fn compare_sums(oracle: &Oracle, point: usize, found: &Found, expected: &Expected) -> Result<(), String> {
    let Expected { count: least, radius, .. } = *expected;
    let most = oracle.within(point, radius * (1.0 + ROUNDING)).len();
    let count = found.count as usize;
    // Points at the k-th distance belong; rounding may separate points at nearly the same distance.
    if !(least..=most).contains(&count) || found.count.fract() != 0.0 {
        return Err(format!("point {point}: {count} neighbours, not {least} to {most}"));
    }
    if least != most {
        return Ok(());
    }
    let offsets = oracle.within(point, radius * (1.0 + ROUNDING)).iter();
    let offsets: Vec<DVec3> = offsets.map(|&(_, q)| oracle.positions[q] - oracle.positions[point]).collect();
    let first: DVec3 = offsets.iter().sum();
    let second = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
        .map(|(i, j)| offsets.iter().map(|offset| offset[i] * offset[j]).sum::<f64>());
    // f32 rounding of up to count + 4 additions, each of a term up to the radius (squared).
    let tolerance = 1e-6 * (count as f64 + 4.0) * radius;
    let error = (found.offset - first).abs().max_element();
    if !(error <= tolerance) {
        return Err(format!("point {point}: sum of offsets is off by {error}"));
    }
    let errors = second.iter().zip(&found.second).map(|(a, b)| (a - b).abs());
    match errors.into_iter().find(|error| !(*error <= tolerance * radius)) {
        Some(error) => Err(format!("point {point}: second moment is off by {error}")),
        None => Ok(()),
    }
}

/// Compares all neighbourhoods. Returns the number of points left out because rounding decides.
fn compare(
    oracle: &Oracle,
    initial_radii: &[f64],
    queries: &[u32],
    rules: &SearchRules,
    neighborhoods: &Neighborhoods,
) -> Result<usize, String> {
    let mut left_out = 0;
    let mut counts = SearchCounts::default();
    for (index, &query) in queries.iter().enumerate() {
        let point = query as usize;
        let expected = oracle.expect(rules, initial_radii[point], point);
        if expected.unsure {
            left_out += 1;
            continue;
        }
        counts.outliers += usize::from(expected.fate == Fate::Outlier);
        counts.clamped += usize::from(expected.fate == Fate::Clamped);
        let found = found(neighborhoods, index);
        // f32 rounding of a difference, a sum of squares and a root.
        if !((found.k_radius - expected.radius).abs() <= 1e-5 * expected.radius) {
            return Err(format!("point {point}: k-radius {}, expected {expected:?}", found.k_radius));
        }
        compare_sums(oracle, point, &found, &expected)?;
    }
    let SearchCounts { outliers, clamped, bounded } = neighborhoods.counts;
    let agree = |count: usize, expected: usize| (expected..=expected + left_out).contains(&count);
    if !agree(outliers, counts.outliers) || !agree(clamped, counts.clamped) || bounded > 0 {
        return Err(format!("counted {:?}, expected {counts:?}", neighborhoods.counts));
    }
    Ok(left_out)
}

#[test]
fn every_cloud_with_every_rule() {
    let (mut compared, mut left_out) = (0, 0);
    for camera in cameras() {
        for (name, positions) in test_clouds::all(1200) {
            let (screen, _) = screen(&positions, &camera, [90, 70], 10);
            let oracle = Oracle::new(&screen);
            for k in KS {
                let (screen, view) = self::screen(&positions, &camera, [90, 70], k);
                let count = screen.points.len();
                let radii: Vec<f64> = (0..count).map(|p| oracle.initial_radius(&screen, &view, k, p)).collect();
                for (e0, lambda) in
                    [(Some(3), Some(4.0)), (Some(0), Some(4.0)), (Some(1), None), (None, Some(2.0)), (None, None)]
                {
                    let rules = SearchRules { k, outlier_expansions: e0, gap_factor: lambda, lenient: e0.is_some() };
                    let all: Vec<u32> = (0..count as u32).collect();
                    let third: Vec<u32> = all.iter().copied().step_by(3).collect();
                    let single: Vec<u32> = all.iter().copied().skip(count / 2).take(1).collect();
                    for (engine, search) in ENGINES {
                        for queries in [&all, &third, &single] {
                            let mut neighborhoods = Neighborhoods::default();
                            search(
                                &screen,
                                queries,
                                &view,
                                &rules,
                                &Past::default(),
                                &mut neighborhoods,
                                &crate::cancel::NEVER,
                            );
                            let outcome = compare(&oracle, &radii, queries, &rules, &neighborhoods);
                            let projection = camera.projection;
                            assert!(outcome.is_ok(), "{engine}, {name}, {projection:?}, {rules:?}: {outcome:?}");
                            compared += queries.len();
                            left_out += outcome.unwrap_or_default();
                        }
                    }
                }
            }
        }
    }
    assert!(compared > 100_000, "there is something to compare: {compared}");
    // The seeds leave almost no point to rounding.
    assert!(left_out * 5000 < compared, "{left_out} of {compared} are left to rounding");
}

#[test]
fn comparison_sees_each_kind_of_error() {
    let mut positions = test_clouds::clumps(300);
    positions.extend(test_clouds::outliers(200));
    let (screen, view) = screen(&positions, &cameras()[0], [90, 70], 10);
    let oracle = Oracle::new(&screen);
    let radii: Vec<f64> = (0..screen.points.len()).map(|p| oracle.initial_radius(&screen, &view, 10, p)).collect();
    let queries: Vec<u32> = (0..screen.points.len() as u32).collect();
    let outcome = |rules: SearchRules, spoil: fn(&mut Neighborhoods)| {
        let mut neighborhoods = Neighborhoods::default();
        screen_grid::search(
            &screen,
            &queries,
            &view,
            &rules,
            &Past::default(),
            &mut neighborhoods,
            &crate::cancel::NEVER,
        );
        spoil(&mut neighborhoods);
        compare(&oracle, &radii, &queries, &self::rules(10), &neighborhoods)
    };
    assert_eq!(outcome(rules(10), |_| ()), Ok(0), "nothing is wrong yet");
    type Spoil = fn(&mut Neighborhoods);
    let spoils: [(&str, Spoil); 5] = [
        ("k-radius", |n| n.blocks[1].k_radius.0[4] *= 1.0001),
        ("count", |n| n.blocks[1].count.0[4] += 1.0),
        ("offset", |n| n.blocks[1].offset[1].0[4] += 1e-3 * n.blocks[1].k_radius.0[4]),
        ("second moment", |n| n.blocks[1].second[3].0[4] *= 1.001),
        ("counts", |n| n.counts.clamped += 1),
    ];
    for (name, spoil) in spoils {
        assert!(outcome(rules(10), spoil).is_err(), "not noticed: {name}");
    }
    let other_rules = [
        SearchRules { k: 9, ..rules(10) },
        SearchRules { gap_factor: None, ..rules(10) },
        SearchRules { gap_factor: Some(5.0), ..rules(10) },
        SearchRules { outlier_expansions: Some(0), ..rules(10) },
        SearchRules { lenient: false, ..rules(10) },
    ];
    for rules in other_rules {
        assert!(outcome(rules, |_| ()).is_err(), "not noticed: {rules:?}");
    }
}

/// A denser surface behind a wall makes the wall's first search radii too short.
#[test]
fn a_surface_before_a_denser_one_is_no_outlier() {
    let camera = Camera {
        eye: DVec3::new(10.0, 10.0, 0.0),
        look_at: DVec3::new(10.0, 10.0, 1.0),
        up: DVec3::NEG_Y,
        projection: Projection::OrthographicHeight(20.0),
    };
    let wall = (0..400).map(|i| [(i % 20) as f32 + 0.5, (i / 20) as f32 + 0.5, 30.0]);
    let behind = (0..15_129).map(|i| [(i % 123) as f32 / 6.15, (i / 123) as f32 / 6.15, 60.0]);
    let positions: Positions = wall.chain(behind).collect();
    let (screen, view) = screen(&positions, &camera, [1200, 1200], 10);
    let queries: Vec<u32> =
        (0..screen.points.len() as u32).filter(|&q| screen.points[q as usize].position_view[2] < 40.0).collect();
    assert_eq!(queries.len(), 400, "all of the wall is seen");
    let outliers = |lenient: bool| {
        let rules = SearchRules { k: 10, outlier_expansions: Some(1), gap_factor: Some(4.0), lenient };
        let mut neighborhoods = Neighborhoods::default();
        screen_grid::search(
            &screen,
            &queries,
            &view,
            &rules,
            &Past::default(),
            &mut neighborhoods,
            &crate::cancel::NEVER,
        );
        neighborhoods.counts.outliers
    };
    // The number of points of the surface behind in a cell varies a little.
    let [without, with] = [false, true].map(outliers);
    assert!(without > 350 && with < 100, "first search radii are those of what is behind: {without}, {with}");
}

/// On a lattice of whole numbers nothing is rounded: all points at the k-th distance belong.
#[test]
fn ties_belong() {
    let positions: Positions = (0..400).map(|i| [(i % 20) as f32, (i / 20) as f32, 64.0]).collect();
    let camera = Camera {
        eye: DVec3::new(10.0, 10.0, 0.0),
        look_at: DVec3::new(10.0, 10.0, 1.0),
        up: DVec3::NEG_Y,
        projection: Projection::OrthographicHeight(32.0),
    };
    // Rings of a square lattice: 4 at distance 1, 4 at √2, 4 at 2, 8 at √5.
    for (k, count, squared) in [(1, 4, 1.0f32), (3, 4, 1.0), (4, 4, 1.0), (5, 8, 2.0), (10, 12, 4.0), (16, 20, 5.0)] {
        let (screen, view) = screen(&positions, &camera, [64, 64], k);
        let at = |p: &super::super::project::ScreenPoint| p.position_view.map(f32::abs);
        let middle = screen.points.iter().position(|p| at(p) == [0.0, 0.0, 64.0]).expect("a point in the middle");
        for (engine, search) in ENGINES {
            let mut neighborhoods = Neighborhoods::default();
            search(
                &screen,
                &[middle as u32],
                &view,
                &rules(k),
                &Past::default(),
                &mut neighborhoods,
                &crate::cancel::NEVER,
            );
            let found = found(&neighborhoods, 0);
            assert_eq!(found.count as usize, count, "{engine}, k = {k}: neighbours");
            assert_eq!(found.k_radius as f32, squared.sqrt(), "{engine}, k = {k}: k-radius");
            assert_eq!(found.offset, DVec3::ZERO, "{engine}, k = {k}: the lattice is symmetric");
            assert_eq!(neighborhoods.counts, SearchCounts::default(), "{engine}, k = {k}: nothing ends early");
        }
    }
}

/// A bounded search keeps fewer neighbours, but all points up to its k-radius.
#[test]
fn bounded_searches_stay_exact_as_far_as_they_go() {
    let camera = cameras()[1];
    let positions = test_clouds::outliers(60_000);
    let (screen, view) = screen(&positions, &camera, [400, 400], 10);
    assert!(screen.points.len() > 4 * MAX_CANDIDATES, "there is more than may be read");
    let rules = SearchRules { k: 10, outlier_expansions: None, gap_factor: None, lenient: true };
    let queries: Vec<u32> = (0..screen.points.len() as u32).step_by(101).collect();
    for (engine, search) in ENGINES {
        let mut neighborhoods = Neighborhoods::default();
        search(&screen, &queries, &view, &rules, &Past::default(), &mut neighborhoods, &crate::cancel::NEVER);
        let SearchCounts { outliers, clamped, bounded } = neighborhoods.counts;
        assert!(bounded > 0, "{engine}: none meets the bound");
        assert_eq!(outliers + clamped, bounded, "{engine}: nothing else ends a search here");
        let mut fewer = 0;
        for (index, &query) in queries.iter().enumerate() {
            let found = found(&neighborhoods, index);
            let at = |q: usize| Vec3::from(screen.points[q].position_view).as_dvec3();
            let distances = (0..screen.points.len()).filter(|&q| q != query as usize);
            let distances: Vec<f64> = distances.map(|q| (at(q) - at(query as usize)).length()).collect();
            let [least, most] = [1.0 - ROUNDING, 1.0 + ROUNDING]
                .map(|factor| distances.iter().filter(|&&d| d <= found.k_radius * factor).count());
            assert!((least..=most).contains(&(found.count as usize)), "{engine}, point {query}: {found:?}");
            assert!(found.count <= 11.0, "{engine}, point {query}: more than k");
            fewer += usize::from(found.count < 10.0);
        }
        assert_eq!(fewer, bounded, "{engine}: fewer than k neighbours are counted as bounded");
    }
}

/// Points whose squared distances overflow are nobody's neighbours, even where every point is asked for.
#[test]
fn huge_coordinates_reach_no_sum() {
    let camera = cameras()[1];
    for (near, k) in [(1, 1), (1, 10), (5, 10), (200, 64)] {
        for huge in [0, 1, 40] {
            let mut positions = test_clouds::sphere(near);
            let forward = (EYE / EYE.z).as_vec3();
            // Depths in steps of f32 that fall on random pixels.
            positions.extend((0..huge).map(|i| (forward * (1e38 * (1.0 + 0.01 * i as f32))).to_array()));
            let (screen, view) = screen(&positions, &camera, [90, 70], k);
            let queries: Vec<u32> = (0..screen.points.len() as u32).collect();
            let rules = SearchRules { k, outlier_expansions: None, gap_factor: None, lenient: true };
            for (engine, search) in ENGINES {
                let mut neighborhoods = Neighborhoods::default();
                search(&screen, &queries, &view, &rules, &Past::default(), &mut neighborhoods, &crate::cancel::NEVER);
                for index in 0..queries.len() {
                    let found = found(&neighborhoods, index);
                    let sums = found.second.iter().sum::<f64>() + found.offset.element_sum() + found.k_radius;
                    assert!(sums.is_finite(), "{engine}, {near} + {huge} points, k = {k}: {found:?}");
                }
            }
        }
    }
}
