//! Limits for the measures of the small cases: pictures may get better, but not worse.
//!
//! `cargo test -p autosplats-quality --test it limits:: -- --nocapture` prints all measures. Further tests spoil a
//! picture, each by one kind of defect, and expect the measures of that defect to miss their limits.

use std::f64::consts::TAU;
use std::sync::OnceLock;

use autosplats::cloud::glam::{DQuat, DVec3};
use autosplats_quality::case::{Case, quick};
use autosplats_quality::light::Lit;
use autosplats_quality::measure::{Angles, Measures};
use autosplats_quality::method::{Method, Painter};
use autosplats_quality::motion::{Change, Changes, same};
use autosplats_quality::picture::{DrawnSurface, Picture};
use autosplats_quality::random::random;
use autosplats_quality::run::{Outcome, Pictures, measure, movement};
use autosplats_quality::still::Still;
use autosplats_quality::subject::Subject;

/// The limits of a case. Angles are in degrees, shares in percent. NaN is no limit.
struct Limits {
    case: &'static str,
    /// Greatest mean errors of normals: over all pixels, and near silhouettes.
    normals: [f64; 2],
    /// Greatest ratios of these errors to those of the best plane fits.
    ratios: [f64; 2],
    /// Greatest shares of normals above 90° to the true one, and to all true ones around.
    flipped: [f64; 2],
    /// Greatest share of holes.
    holes: f64,
    /// Greatest share of leaks.
    leaks: f64,
    /// Greatest share of surfaces in front.
    before: f64,
    /// Least intersection over union.
    iou: f64,
    /// Greatest mean error in depth, pixels.
    depth_px: f64,
    /// Least PSNR, decibels.
    psnr: f64,
    /// Greatest mean FLIP error.
    flip: f64,
    /// Of a lidar: least shares closed and right, greatest share over.
    swept: [f64; 3],
    /// Greatest ratios of the changes of normals and lightness in motion to those of the true pictures.
    motion: [f64; 2],
    /// Least gain of a still over a single picture in PSNR against the truth of 16 rays, decibels.
    still: f64,
}

const NO_LIMIT: f64 = f64::NAN;
const NOISE: &str = "bumpy:200K-noise0.3% front";
const OUTLIERS: &str = "bumpy:200K-outliers2% front";

/// One line for each case: measured values with a few percent to spare. Better pictures call for tighter limits.
#[rustfmt::skip]
const LIMITS: [Limits; 9] = [
    Limits { case: "figure:60K own", normals: [6.3, 7.9], ratios: [1.05, 1.05], flipped: [0.62, 0.07], holes: 0.02, leaks: 0.02, before: 0.25, iou: 0.982, depth_px: 0.39, psnr: 24.6, flip: 0.074, swept: [NO_LIMIT; 3], motion: [1.18, 1.01], still: 3.1 },
    Limits { case: "two-scales:150K own", normals: [4.65, 8.2], ratios: [1.02, 1.02], flipped: [0.46, 0.02], holes: 0.02, leaks: 0.02, before: 0.47, iou: 0.987, depth_px: 0.28, psnr: 27.5, flip: 0.056, swept: [NO_LIMIT; 3], motion: [NO_LIMIT; 2], still: 2.7 },
    Limits { case: "statue:150K own", normals: [24.4, 26.1], ratios: [1.25, 1.22], flipped: [1.0, 0.12], holes: 0.045, leaks: 0.03, before: 0.37, iou: 0.975, depth_px: 0.82, psnr: 18.6, flip: 0.248, swept: [NO_LIMIT; 3], motion: [NO_LIMIT; 2], still: 3.9 },
    Limits { case: "statue:150K near", normals: [16.2, 23.2], ratios: [1.00, 0.99], flipped: [1.57, 0.45], holes: NO_LIMIT, leaks: NO_LIMIT, before: NO_LIMIT, iou: NO_LIMIT, depth_px: 1.88, psnr: 20.7, flip: 0.182, swept: [NO_LIMIT; 3], motion: [NO_LIMIT; 2], still: 0.1 },
    Limits { case: "bumpy:200K front", normals: [0.42, 0.98], ratios: [0.95, 0.90], flipped: [0.02, 0.01], holes: 0.02, leaks: 0.02, before: 0.02, iou: 0.998, depth_px: 0.115, psnr: 43.0, flip: 0.013, swept: [NO_LIMIT; 3], motion: [NO_LIMIT; 2], still: 1.3 },
    Limits { case: "bumpy:200K-uneven front", normals: [0.68, 1.50], ratios: [0.98, 0.92], flipped: [0.04, 0.02], holes: 0.02, leaks: 0.02, before: 0.03, iou: 0.998, depth_px: 0.100, psnr: 40.2, flip: 0.017, swept: [NO_LIMIT; 3], motion: [NO_LIMIT; 2], still: 0.5 },
    Limits { case: "bumpy:200K-noise0.3% front", normals: [3.9, 5.8], ratios: [0.75, 0.60], flipped: [0.03, 0.03], holes: 0.03, leaks: 0.02, before: 0.15, iou: 0.993, depth_px: 1.02, psnr: 30.8, flip: 0.082, swept: [NO_LIMIT; 3], motion: [0.92, 1.27], still: -0.4 },
    Limits { case: "bumpy:200K-outliers2% front", normals: [0.67, 1.97], ratios: [1.15, 1.40], flipped: [0.14, 0.12], holes: 0.02, leaks: 0.02, before: 0.06, iou: 0.996, depth_px: 0.17, psnr: 33.5, flip: 0.017, swept: [NO_LIMIT; 3], motion: [NO_LIMIT; 2], still: 2.0 },
    Limits { case: "herd:32x1024 behind", normals: [11.2, 37.3], ratios: [0.69, 0.95], flipped: [2.75, 1.6], holes: NO_LIMIT, leaks: NO_LIMIT, before: NO_LIMIT, iou: NO_LIMIT, depth_px: 3.6, psnr: 19.4, flip: 0.156, swept: [98.6, 92.7, 10.0], motion: [NO_LIMIT; 2], still: 0.0 },
];

/// The limits that a picture misses.
fn misses(measures: &Measures, limits: &Limits) -> Vec<String> {
    let angles = measures.angles.expect("a method that knows normals");
    let cover = measures.cover;
    let most = [
        ("normals", angles.mean, limits.normals[0]),
        ("normals near silhouettes", angles.band, limits.normals[1]),
        ("above 90°", 100.0 * angles.above_90, limits.flipped[0]),
        ("flipped", 100.0 * angles.flipped, limits.flipped[1]),
        ("holes", 100.0 * cover.holes, limits.holes),
        ("leaks", 100.0 * cover.leaks, limits.leaks),
        ("before", 100.0 * cover.before, limits.before),
        // A least value, negated, is a greatest one.
        ("IoU", -cover.iou, -limits.iou),
        ("depth", measures.depth_px, limits.depth_px),
        ("PSNR", -measures.psnr, -limits.psnr),
        ("FLIP", measures.flip, limits.flip),
    ];
    let swept = measures.swept.map_or([NO_LIMIT; 3], |swept| [-swept.closed, -swept.right, swept.over]);
    let [closed, right, over] = swept.map(|share| 100.0 * share);
    let most_swept =
        [("closed", closed, -limits.swept[0]), ("right", right, -limits.swept[1]), ("over", over, limits.swept[2])];
    [beyond(&most), beyond(&most_swept)].concat()
}

/// The values that are above their limit, or NaN although there is a limit.
fn beyond(values: &[(&str, f64, f64)]) -> Vec<String> {
    let is_beyond = |(_, value, limit): &&(&str, f64, f64)| !limit.is_nan() && !(value <= limit);
    values.iter().filter(is_beyond).map(|(what, value, limit)| format!("{what}: {value:.4}, limit {limit}")).collect()
}

/// The limits that the ratios of errors of normals miss.
fn ratio_misses([all, band]: [f64; 2], limits: &Limits) -> Vec<String> {
    beyond(&[
        ("normals over best fits", all, limits.ratios[0]),
        ("normals near silhouettes over best fits", band, limits.ratios[1]),
    ])
}

/// The limits that the changes in motion miss.
fn motion_misses(ours: Change, truth: Change, limits: &Limits) -> Vec<String> {
    beyond(&[
        ("turning", ours.degrees / truth.degrees, limits.motion[0]),
        ("flicker", ours.lightness / truth.lightness, limits.motion[1]),
    ])
}

/// The limit that a still's gain in decibels misses.
fn still_misses(gain: f64, limits: &Limits) -> Vec<String> {
    beyond(&[("still", -gain, -limits.still)])
}

#[test]
fn a_still_that_gains_less_is_found() {
    for limits in &LIMITS {
        assert!(still_misses(limits.still + 0.01, limits).is_empty(), "{}", limits.case);
        assert_eq!(still_misses(limits.still - 0.01, limits).len(), 1, "{}", limits.case);
    }
}

/// A case with its pictures.
struct Measured {
    case: Case,
    subject: Subject,
    limits: &'static Limits,
    outcome: Outcome,
    pictures: Pictures,
}

/// Measures a case once for all tests, without motion.
fn measured(name: &str) -> &'static Measured {
    static MEASURED: [OnceLock<Measured>; LIMITS.len()] = [const { OnceLock::new() }; LIMITS.len()];
    let at = LIMITS.iter().position(|limits| limits.case == name).expect("a case of this name");
    MEASURED[at].get_or_init(|| {
        let case = Case { motion: false, ..quick()[at] };
        let subject = Subject::new(case.recipe).expect("a subject");
        let others: &[Method] = match name {
            NOISE => &[Method::Paper, Method::Known],
            OUTLIERS => &[Method::Paper],
            _ => &[],
        };
        let fits = Method::ALL.into_iter().filter(|method| matches!(method, Method::Fit(_)));
        let methods: Vec<_> = [Method::Ours].into_iter().chain(fits).chain(others.iter().copied()).collect();
        let (outcome, pictures) = measure(&case, &subject, &mut Painter::new(&subject), &methods).expect("measures");
        Measured { case, subject, limits: &LIMITS[at], outcome, pictures }
    })
}

/// Checks the limits of a case.
fn check_limits(name: &str) {
    let Measured { case, subject, limits, outcome, .. } = measured(name);
    let measures = outcome.of(Method::Ours).expect("our picture");
    let values: [fn(&Angles) -> f64; 2] = [|angles| angles.mean, |angles| angles.band];
    let ratios = values.map(|value| outcome.over_best_fit(Method::Ours, value).expect("plane fits"));
    println!("{name}: {measures:.3?}\n{ratios:.3?}");
    let mut found = misses(measures, limits);
    found.extend(ratio_misses(ratios, limits));
    let Still { still, methods, .. } = &outcome.still;
    found.extend(still_misses(still - methods[0].1, limits));
    if quick().iter().any(|case| case.name() == name && case.motion) {
        let motion = movement(case, subject, &mut Painter::new(subject), &[Method::Ours], false).expect("a movement");
        println!("{motion:.3?}");
        found.extend(motion_misses(motion.methods[0].1, motion.truth, limits));
    }
    assert!(found.is_empty(), "{name}: limits missed:\n{}", found.join("\n"));
}

#[test]
fn figure() {
    check_limits("figure:60K own");
}

#[test]
fn two_scales() {
    check_limits("two-scales:150K own");
}

#[test]
fn statue() {
    check_limits("statue:150K own");
}

#[test]
fn statue_near() {
    check_limits("statue:150K near");
}

#[test]
fn bumpy() {
    check_limits("bumpy:200K front");
}

#[test]
fn bumpy_uneven() {
    check_limits("bumpy:200K-uneven front");
}

#[test]
fn bumpy_with_noise() {
    check_limits(NOISE);
}

#[test]
fn bumpy_with_outliers() {
    check_limits(OUTLIERS);
}

#[test]
fn herd_swept() {
    check_limits("herd:32x1024 behind");
}

/// The paper's settings, which do not adapt to noise, miss the limits.
#[test]
fn the_papers_settings_are_not_enough_for_noise() {
    for name in [NOISE, OUTLIERS] {
        let Measured { limits, outcome, .. } = measured(name);
        let found = misses(outcome.of(Method::Paper).expect("a picture"), limits).join("\n");
        notices(&found, &["normals:", "normals near silhouettes:", "before", "IoU", "PSNR", "FLIP"]);
    }
}

/// [`Method::Known`] shows what exact normals and places can reach, so it must be near the truth.
#[test]
fn what_is_known_is_nearly_the_truth() {
    let outcome = &measured(NOISE).outcome;
    let [ours, known] = [Method::Ours, Method::Known].map(|method| outcome.of(method).expect("a picture"));
    let [far, near] = [ours, known].map(|measures| measures.angles.expect("normals").mean);
    assert!(near < 1.0 && near < 0.2 * far, "errors of normals are {near}°, ours {far}°");
    assert!(known.psnr > ours.psnr + 10.0, "{} dB, ours {}", known.psnr, ours.psnr);
}

#[test]
fn every_case_has_its_line() {
    let names: Vec<_> = quick().iter().map(Case::name).collect();
    assert_eq!(names, LIMITS.map(|limits| limits.case), "every case has one line");
}

/// A good picture to spoil.
fn sample() -> &'static Measured {
    measured("bumpy:200K front")
}

impl Measured {
    fn picture(&self) -> &Picture {
        &self.pictures.drawn[0].1
    }

    /// The limits that `picture` misses, lit anew.
    fn misses(&self, picture: &Picture) -> String {
        let lit = Lit::new(picture, &self.pictures.truth.exact.rays);
        self.lit_misses(picture, &lit)
    }

    fn lit_misses(&self, picture: &Picture, lit: &Lit) -> String {
        misses(&self.pictures.truth.measure(picture, lit, &self.subject), self.limits).join("\n")
    }

    /// The limits that the picture misses if one in `one_in` of its pixels is changed.
    fn misses_of_spoilt(&self, one_in: usize, change: impl Fn(DrawnSurface) -> Option<DrawnSurface>) -> String {
        let is_chosen = |pixel| random(5, pixel).unit() < 1.0 / one_in as f64;
        self.misses(&self.picture().changed(|pixel, shown| if is_chosen(pixel) { change(shown) } else { Some(shown) }))
    }
}

#[track_caller]
fn notices(misses: &str, what: &[&str]) {
    println!("{misses}\n");
    for what in what {
        assert!(misses.contains(what), "{what} should miss its limit, found:\n{misses}");
    }
}

#[test]
fn a_good_picture_misses_nothing() {
    let sample = sample();
    assert_eq!(sample.misses(sample.picture()), "", "the next tests need a good picture");
    let truth = Picture::truth(&sample.pictures.truth.exact);
    let lit = Lit::new(&truth, &sample.pictures.truth.exact.rays);
    // A true picture has no points. None are needed, as its cover is complete.
    let measures = sample.pictures.truth.measure(&truth, &lit, &sample.subject);
    let angles = measures.angles.expect("normals");
    assert!(
        angles.rms < 1e-9 && measures.depth_px == 0.0 && measures.flip < 1e-6,
        "the true picture has no errors: {measures:?}"
    );
    assert!(measures.psnr.is_infinite() && measures.cover.iou == 1.0, "the true picture has no errors: {measures:?}");
}

#[test]
fn a_shifted_picture_is_noticed() {
    let sample = sample();
    notices(&sample.misses(&sample.picture().shifted(4)), &["IoU", "normals:", "PSNR", "FLIP"]);
}

#[test]
fn flipped_normals_are_noticed() {
    let flipped = |shown: DrawnSurface| Some(DrawnSurface { normal: -shown.normal, ..shown });
    notices(&sample().misses_of_spoilt(200, flipped), &["above 90°", "flipped", "normals:", "PSNR"]);
}

#[test]
fn tilted_normals_are_noticed() {
    let tilt = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.0_f64.to_radians());
    notices(
        &sample().misses_of_spoilt(2, |shown| Some(DrawnSurface { normal: tilt * shown.normal, ..shown })),
        &["normals:"],
    );
    // A quarter of the pixels near silhouettes is too few to change the mean over all pixels.
    let sample = sample();
    let band = sample.pictures.truth.exact.band();
    let tilted = sample.picture().changed(|pixel, shown| {
        let is_chosen = band[pixel] && pixel % 4 == 0;
        Some(if is_chosen { DrawnSurface { normal: tilt * shown.normal, ..shown } } else { shown })
    });
    let misses = sample.misses(&tilted);
    notices(&misses, &["normals near silhouettes:"]);
    assert!(!misses.contains("normals:"), "most normals are right: {misses}");
}

#[test]
fn what_plane_fits_do_better_is_noticed() {
    let limits = limits_of_first();
    let [all, band] = limits.ratios;
    assert!(ratio_misses([all, band], limits).is_empty());
    notices(&ratio_misses([all + 0.01, band], limits).join("\n"), &["normals over best fits:"]);
    notices(&ratio_misses([all, band + 0.01], limits).join("\n"), &["normals near silhouettes over best fits:"]);
}

#[test]
fn what_is_open_or_closed_wrongly_between_rings_is_noticed() {
    let sample = measured("herd:32x1024 behind");
    assert_eq!(sample.misses(sample.picture()), "", "the rest needs a good picture");
    notices(&sample.misses_of_spoilt(20, |_| None), &["closed"]);
    let back = |shown: DrawnSurface| Some(DrawnSurface { depth: shown.depth + 0.3 * sample.subject.diagonal, ..shown });
    let misses = sample.misses_of_spoilt(20, back);
    notices(&misses, &["right"]);
    assert!(!misses.contains("closed"), "all pixels are covered: {misses}");
    // A screen in front of everything.
    let near = DrawnSurface { depth: 0.5, normal: DVec3::Y, point: 0 };
    let all = Picture { width: sample.picture().width, shown: vec![Some(near); sample.picture().shown.len()] };
    notices(&sample.misses(&all), &["over", "right"]);
}

#[test]
fn holes_are_noticed() {
    notices(&sample().misses_of_spoilt(300, |_| None), &["holes"]);
}

#[test]
fn leaks_are_noticed() {
    let sample = sample();
    let back = |shown: DrawnSurface| Some(DrawnSurface { depth: shown.depth + 0.3 * sample.subject.diagonal, ..shown });
    notices(&sample.misses_of_spoilt(300, back), &["leaks", "depth"]);
}

#[test]
fn what_floats_in_front_is_noticed() {
    let sample = sample();
    let front =
        |shown: DrawnSurface| Some(DrawnSurface { depth: shown.depth - 0.3 * sample.subject.diagonal, ..shown });
    notices(&sample.misses_of_spoilt(300, front), &["before", "depth"]);
}

#[test]
fn noise_in_colors_is_noticed() {
    let sample = sample();
    let lit = &sample.pictures.drawn[0].2;
    let noisy = lit.changed(|pixel, color| {
        let noise = 0.05 * random(6, pixel).normal();
        color.map(|channel| (channel + noise).clamp(0.0, 1.0))
    });
    let misses = sample.lit_misses(sample.picture(), &noisy);
    notices(&misses, &["PSNR", "FLIP"]);
    assert!(!misses.contains("normals"), "only colours are wrong: {misses}");
}

#[test]
fn a_jittering_picture_is_noticed() {
    let sample = sample();
    let exact = &sample.pictures.truth.exact;
    let limits = Limits { motion: [1.1, 1.1], ..*limits_of_first() };
    // The camera does not move, so each pixel shows the same point. Normals wobble by two degrees.
    let pairs = same(exact, exact);
    assert!(pairs.len() > 10_000 && pairs.iter().all(|(from, to)| from == to), "every pixel shows the same point");
    let wobbling = |step: usize| {
        sample.picture().changed(|pixel, shown| {
            let turn = TAU * random(7 + step as u64, pixel).unit();
            let axis = DVec3::new(turn.cos(), turn.sin(), 0.0);
            Some(DrawnSurface { normal: DQuat::from_axis_angle(axis, 2.0_f64.to_radians()) * shown.normal, ..shown })
        })
    };
    let change = |pictures: &[Picture]| {
        let lit: Vec<_> = pictures.iter().map(|picture| Lit::new(picture, &exact.rays)).collect();
        let mut changes = Changes::default();
        for step in 1..pictures.len() {
            changes.add(&pairs, [(&pictures[step - 1], &lit[step - 1]), (&pictures[step], &lit[step])]);
        }
        changes.mean()
    };
    let still = change(&[sample.picture().clone(), sample.picture().clone()]);
    assert_eq!(still, Change { degrees: 0.0, lightness: 0.0 }, "equal pictures have no change");
    let wobble = change(&[wobbling(0), wobbling(1), wobbling(2)]);
    // About the change of true pictures of a moving camera.
    let truth = Change { degrees: 0.5, lightness: 0.5 };
    notices(&motion_misses(wobble, truth, &limits).join("\n"), &["turning", "flicker"]);
    assert!(motion_misses(truth, truth, &limits).is_empty(), "a change like the truth's is within the limits");
}

fn limits_of_first() -> &'static Limits {
    &LIMITS[0]
}
