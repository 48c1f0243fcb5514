//! The points of a spinning lidar lie where its rays hit the surface, and measures count only where the lidar sees it.

use std::f64::consts::TAU;

use autosplats::cloud::glam::DVec3;
use autosplats_quality::exact::Exact;
use autosplats_quality::light::Lit;
use autosplats_quality::measure::{Swept, Truth};
use autosplats_quality::picture::{DrawnSurface, Picture};
use autosplats_quality::random::random;
use autosplats_quality::subject::{Recipe, Source, Subject};
use autosplats_quality::sweep::Sweep;
use autosplats_quality::view::Shot;

/// A lidar beside the bumpy sphere, whose radius is about 1.
const SWEEP: Sweep = Sweep::new([-2.5, 0.3, 0.2], [-20.0, 10.0], 16, 720);
const BUMPY: Source = Source::Bumpy(5);
/// A lidar at the edge of the herd's meadow.
const EDGE: Sweep = Sweep::new([1.2, -6.9, 1.75], [-24.8, 2.0], 32, 1024);

fn subject(source: Source, sweep: Sweep) -> Subject {
    Subject::new(Recipe::swept(source, sweep)).expect("a subject")
}

/// The points without noise.
fn places(subject: &Subject) -> Vec<DVec3> {
    (0..subject.clean.len() as u32).map(|point| subject.clean.position(point)).collect()
}

/// Distance of a number from the nearest integer.
fn off_whole(number: f64) -> f64 {
    (number - number.round()).abs()
}

#[test]
fn points_lie_on_the_surface_and_on_the_beams() {
    let subject = subject(BUMPY, SWEEP);
    let places = places(&subject);
    assert!((500..SWEEP.count() / 4).contains(&places.len()), "{} rays hit the sphere", places.len());
    let mut beams = vec![0; SWEEP.beams];
    for place in places {
        let offset = place - SWEEP.origin();
        let (range, direction) = (offset.length(), offset.normalize());
        let hit = subject.surface.trace(SWEEP.origin(), direction).expect("the ray hits the surface");
        assert!((hit.distance - range).abs() < 1e-5, "{} off the surface", hit.distance - range);
        let beam = (direction.z.asin().to_degrees() + 20.0) / 2.0;
        let step = direction.y.atan2(direction.x) / TAU * 720.0 - 0.5;
        assert!(off_whole(beam) < 1e-4 && off_whole(step) < 1e-4, "beam {beam}, step {step} of the turn");
        beams[beam.round() as usize] += 1;
    }
    assert!(beams.iter().all(|&points| points > 10), "each beam hits the sphere: {beams:?}");
}

#[test]
fn noise_is_along_the_ray() {
    let recipe = Recipe::swept(BUMPY, SWEEP.noise(0.02));
    assert_eq!(recipe.name(), "bumpy:16x720-noise0.02m", "the name has the noise");
    assert!(recipe.is_noisy() && !Recipe::swept(BUMPY, SWEEP).is_noisy(), "noise counts as noise");
    let [one, other] = [(); 2].map(|()| Subject::new(recipe).expect("a subject"));
    assert_eq!(one.cloud.positions(), other.cloud.positions(), "points are reproducible");
    let mut squares = 0.0;
    for (point, place) in places(&one).into_iter().enumerate() {
        let offset = one.cloud.world_position(point) - place;
        assert!(offset.cross((place - SWEEP.origin()).normalize()).length() < 1e-6, "point {point} is off its ray");
        squares += offset.length_squared();
    }
    let deviation = (squares / one.clean.len() as f64).sqrt();
    assert!((deviation / 0.02 - 1.0).abs() < 0.05, "standard deviation {deviation} along the ray");
    assert!(one.max_offset >= 0.06, "the tolerance grows with the noise");
}

#[test]
fn gaps_are_those_from_ring_to_ring() {
    let sweep = Sweep { beams: 64, azimuths: 2048, ..EDGE };
    let subject = subject(Source::Scene("herd"), sweep);
    let mut ratios = Vec::new();
    // On the bare meadow in front of the lidar, the next ring is that of the next beam up.
    for place in places(&subject).into_iter().filter(|place| place.z < 0.3).step_by(7) {
        let gap = sweep.gap(&subject.surface, place);
        let direction = (place - sweep.origin()).normalize();
        let flat = direction.truncate().normalize();
        let elevation = direction.z.asin() + (26.8_f64 / 63.0).to_radians();
        let above = (flat * elevation.cos()).extend(elevation.sin());
        let Some(hit) = subject.surface.trace(sweep.origin(), above) else { continue };
        let found = (sweep.origin() + above * hit.distance - place).length();
        if gap.is_finite() {
            ratios.push(gap / found);
        }
    }
    ratios.sort_unstable_by(f64::total_cmp);
    let [low, middle] = [ratios[ratios.len() / 10], ratios[ratios.len() / 2]];
    assert!(
        low > 0.7 && (0.85..1.1).contains(&middle),
        "computed over measured gaps: median {middle}, lowest tenth {low}"
    );
}

#[test]
fn what_the_sensor_does_not_see_is_not_swept() {
    let subject = subject(BUMPY, SWEEP);
    let gap = |direction: DVec3| {
        let hit = subject.surface.trace(direction * 3.0, -direction).expect("the ray hits the sphere");
        SWEEP.gap(&subject.surface, direction * (3.0 - hit.distance))
    };
    assert!(gap(DVec3::new(-1.0, 0.1, 0.0).normalize()) < 0.1, "right in front of the lidar");
    assert!(gap(DVec3::new(1.0, 0.03, 0.02).normalize()).is_infinite(), "on the far side");
    assert!(gap(DVec3::new(-0.5, 0.03, 0.85).normalize()).is_infinite(), "above the beams");
}

#[test]
fn what_is_missing_wrong_or_too_much_is_noticed() {
    let subject = subject(Source::Scene("herd"), EDGE);
    let size = [240, 150];
    let camera = Shot::Behind([2.7, 1.35], [0.3, -2.0, 0.5]).camera(&subject, size).expect("a camera");
    let truth = Truth::new(Exact::trace(&subject, &camera, size).expect("a camera that can see"));
    let measure = |picture: &Picture| {
        let measures = truth.measure(picture, &Lit::new(picture, &truth.exact.rays), &subject);
        assert!(measures.cover.sampled < 0.1, "single rings do not sample the surface: {:?}", measures.cover);
        measures.swept.expect("a swept subject")
    };
    let right = Picture::truth(&truth.exact);
    let Swept { seen, closed, right: all_right, over } = measure(&right);
    assert!((0.3..0.7).contains(&seen), "horses hide parts, and the lidar has a blind spot: {seen}");
    assert_eq!([closed, all_right, over], [1.0, 1.0, 0.0], "the true picture has no errors");

    let is_chosen = |pixel| random(8, pixel).unit() < 0.2;
    let near = |value: f64, expected: f64| (value - expected).abs() < 0.02;
    let gaps = measure(&right.changed(|pixel, shown| (!is_chosen(pixel)).then_some(shown)));
    assert!(near(gaps.closed, 0.8) && near(gaps.right, 0.8) && gaps.over == 0.0, "a fifth is missing: {gaps:?}");
    let back = |shown: DrawnSurface| DrawnSurface { depth: shown.depth + 5.0, ..shown };
    let deep = measure(&right.changed(|pixel, shown| Some(if is_chosen(pixel) { back(shown) } else { shown })));
    assert!(deep.closed == 1.0 && near(deep.right, 0.8), "a fifth shows surfaces behind: {deep:?}");
    let sky = Some(DrawnSurface { depth: 10.0, normal: DVec3::Z, point: 0 });
    let full = Picture { width: right.width, shown: right.shown.iter().map(|shown| shown.or(sky)).collect() };
    assert!(measure(&full).over > 0.5, "the sky is covered");
    let near_all = right.changed(|pixel, shown| {
        Some(if truth.exact.is_measured(pixel) { shown } else { DrawnSurface { depth: shown.depth - 1.0, ..shown } })
    });
    assert!(measure(&near_all).over > 0.5, "surfaces float in front of each shadow");
    let shadows = right.changed(|pixel, shown| truth.exact.is_measured(pixel).then_some(shown));
    assert_eq!(measure(&shadows).closed, 1.0, "surfaces that the lidar does not see are not measured");
    let lit = Lit::new(&shadows, &truth.exact.rays);
    assert!(truth.measure(&shadows, &lit, &subject).psnr > 20.0, "they change the light only by occlusion beside them");
}
