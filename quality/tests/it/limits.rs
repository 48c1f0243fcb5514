//! The small cases, held to what was measured when the limits were last set: pictures may get better, not worse.
//!
//! `cargo test -p autosplats-quality --test it limits:: -- --nocapture` prints what was measured. The last tests spoil pictures,
//! each in a way that one of the measures is for, which then has to notice.

use std::f64::consts::TAU;
use std::sync::OnceLock;

use autosplats::cloud::glam::{DQuat, DVec3};
use autosplats_quality::case::{Case, quick};
use autosplats_quality::light::Lit;
use autosplats_quality::measure::{Angles, Measures};
use autosplats_quality::method::{Method, Painter};
use autosplats_quality::motion::{Change, Changes, same};
use autosplats_quality::picture::{Picture, Shown};
use autosplats_quality::random::Random;
use autosplats_quality::run::{Pictures, measure};
use autosplats_quality::still::Still;
use autosplats_quality::subject::Subject;
use autosplats_quality::target::ratio;

/// What a case has to keep. Angles in degrees, shares in percent; what has no number is not looked at.
struct Limits {
    case: &'static str,
    /// Mean error of normals, all and near silhouettes.
    normals: [f64; 2],
    /// The same over those of the best plane fits.
    ratios: [f64; 2],
    /// Shares above 90°: to the true normal, and to all that is truly seen around.
    flipped: [f64; 2],
    holes: f64,
    leaks: f64,
    before: f64,
    /// At least.
    iou: f64,
    depth_px: f64,
    /// At least.
    psnr: f64,
    flip: f64,
    /// Of what the sensor of a sweep sees, at least closed and right, at most over.
    swept: [f64; 3],
    /// Changes of normals and lightness in motion, over those in the true pictures.
    motion: [f64; 2],
    /// What a still gains at least over a single picture against the truth of many rays, decibels.
    still: f64,
}

const NONE: f64 = f64::NAN;

/// One line for each case. Set anew when pictures got better: what was measured, with a few percent to spare.
#[rustfmt::skip]
const LIMITS: [Limits; 9] = [
    Limits { case: "figure:60K own", normals: [6.3, 7.9], ratios: [1.05, 1.05], flipped: [0.62, 0.07], holes: 0.02, leaks: 0.02, before: 0.25, iou: 0.982, depth_px: 0.39, psnr: 24.6, flip: 0.074, swept: [NONE; 3], motion: [1.18, 1.01], still: 3.1 },
    Limits { case: "two-scales:150K own", normals: [4.65, 8.2], ratios: [1.02, 1.02], flipped: [0.46, 0.02], holes: 0.02, leaks: 0.02, before: 0.47, iou: 0.987, depth_px: 0.28, psnr: 27.5, flip: 0.056, swept: [NONE; 3], motion: [NONE; 2], still: 2.7 },
    Limits { case: "statue:150K own", normals: [24.4, 26.1], ratios: [1.25, 1.22], flipped: [1.0, 0.12], holes: 0.045, leaks: 0.03, before: 0.37, iou: 0.975, depth_px: 0.82, psnr: 18.6, flip: 0.248, swept: [NONE; 3], motion: [NONE; 2], still: 3.9 },
    Limits { case: "statue:150K near", normals: [16.2, 23.2], ratios: [1.00, 0.99], flipped: [1.57, 0.45], holes: NONE, leaks: NONE, before: NONE, iou: NONE, depth_px: 1.88, psnr: 20.7, flip: 0.182, swept: [NONE; 3], motion: [NONE; 2], still: 0.1 },
    Limits { case: "bumpy:200K front", normals: [0.42, 0.98], ratios: [0.95, 0.90], flipped: [0.02, 0.01], holes: 0.02, leaks: 0.02, before: 0.02, iou: 0.998, depth_px: 0.115, psnr: 43.0, flip: 0.013, swept: [NONE; 3], motion: [NONE; 2], still: 1.3 },
    Limits { case: "bumpy:200K-uneven front", normals: [0.68, 1.50], ratios: [0.98, 0.92], flipped: [0.04, 0.02], holes: 0.02, leaks: 0.02, before: 0.03, iou: 0.998, depth_px: 0.100, psnr: 40.2, flip: 0.017, swept: [NONE; 3], motion: [NONE; 2], still: 0.5 },
    Limits { case: "bumpy:200K-noise0.3% front", normals: [3.9, 5.8], ratios: [0.75, 0.60], flipped: [0.03, 0.03], holes: 0.03, leaks: 0.02, before: 0.15, iou: 0.993, depth_px: 1.02, psnr: 30.8, flip: 0.082, swept: [NONE; 3], motion: [0.92, 1.27], still: -0.4 },
    Limits { case: "bumpy:200K-outliers2% front", normals: [0.67, 1.97], ratios: [1.15, 1.40], flipped: [0.14, 0.12], holes: 0.02, leaks: 0.02, before: 0.06, iou: 0.996, depth_px: 0.17, psnr: 33.5, flip: 0.017, swept: [NONE; 3], motion: [NONE; 2], still: 2.0 },
    Limits { case: "herd:32x1024 behind", normals: [11.2, 37.3], ratios: [0.69, 0.95], flipped: [2.75, 1.6], holes: NONE, leaks: NONE, before: NONE, iou: NONE, depth_px: 3.6, psnr: 19.4, flip: 0.156, swept: [98.6, 92.7, 10.0], motion: [NONE; 2], still: 0.0 },
];

/// What of a picture is beyond its limits.
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
        // Turned round, at least is at most.
        ("IoU", -cover.iou, -limits.iou),
        ("depth", measures.depth_px, limits.depth_px),
        ("PSNR", -measures.psnr, -limits.psnr),
        ("FLIP", measures.flip, limits.flip),
    ];
    let swept = measures.swept.map_or([NONE; 3], |swept| [-swept.closed, -swept.right, swept.over]);
    let [closed, right, over] = swept.map(|share| 100.0 * share);
    let most_swept =
        [("closed", closed, -limits.swept[0]), ("right", right, -limits.swept[1]), ("over", over, limits.swept[2])];
    [beyond(&most), beyond(&most_swept)].concat()
}

/// Those of some values that are above their limit, or no number though there is a limit.
fn beyond(values: &[(&str, f64, f64)]) -> Vec<String> {
    let is_beyond = |(_, value, limit): &&(&str, f64, f64)| !limit.is_nan() && !(value <= limit);
    values.iter().filter(is_beyond).map(|(what, value, limit)| format!("{what}: {value:.4}, limit {limit}")).collect()
}

/// Errors of normals over those of the best plane fits that are beyond their limits.
fn ratio_misses([all, band]: [f64; 2], limits: &Limits) -> Vec<String> {
    beyond(&[
        ("normals over best fits", all, limits.ratios[0]),
        ("normals near silhouettes over best fits", band, limits.ratios[1]),
    ])
}

/// A change in motion that is beyond its limits.
fn motion_misses(ours: Change, truth: Change, limits: &Limits) -> Vec<String> {
    beyond(&[
        ("turning", ours.degrees / truth.degrees, limits.motion[0]),
        ("flicker", ours.lightness / truth.lightness, limits.motion[1]),
    ])
}

/// What a still gains over a single picture against the truth of many rays, in decibels, that is beyond its limit.
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

fn limits_of(case: &Case) -> &'static Limits {
    LIMITS.iter().find(|limits| limits.case == case.name()).expect("limits for each case")
}

/// Measures a case and holds it to its limits.
fn hold(name: &str) {
    let case = quick().into_iter().find(|case| case.name() == name).expect("a case of this name");
    let limits = limits_of(&case);
    let subject = Subject::new(case.recipe).expect("a subject");
    let mut painter = Painter::new(&subject);
    let methods: Vec<_> =
        Method::ALL.into_iter().filter(|method| matches!(method, Method::Ours | Method::Fit(_))).collect();
    let (outcome, _) = measure(&case, &subject, &mut painter, &methods).expect("a measured case");
    let measures = outcome.of(Method::Ours).expect("our picture");
    let values: [fn(&Angles) -> f64; 2] = [|angles| angles.mean, |angles| angles.band];
    let ratios = values.map(|value| ratio(&outcome, Method::Ours, value).expect("plane fits"));
    println!("{name}: {measures:.3?}\n{ratios:.3?}\n{:.3?}", outcome.motion);
    let mut found = misses(measures, limits);
    found.extend(ratio_misses(ratios, limits));
    let Still { still, methods, .. } = &outcome.still;
    found.extend(still_misses(still - methods[0].1, limits));
    if let Some(motion) = &outcome.motion {
        found.extend(motion_misses(motion.methods[0].1, motion.truth, limits));
    }
    assert!(found.is_empty(), "{name}: limits missed:\n{}", found.join("\n"));
}

#[test]
fn figure() {
    hold("figure:60K own");
}

#[test]
fn two_scales() {
    hold("two-scales:150K own");
}

#[test]
fn statue() {
    hold("statue:150K own");
}

#[test]
fn statue_near() {
    hold("statue:150K near");
}

#[test]
fn bumpy() {
    hold("bumpy:200K front");
}

#[test]
fn bumpy_uneven() {
    hold("bumpy:200K-uneven front");
}

#[test]
fn bumpy_with_noise() {
    hold("bumpy:200K-noise0.3% front");
}

#[test]
fn bumpy_with_outliers() {
    hold("bumpy:200K-outliers2% front");
}

#[test]
fn herd_swept() {
    hold("herd:32x1024 behind");
}

/// Without what is adapted to noise the limits would not be met.
#[test]
fn the_papers_settings_are_not_enough_for_noise() {
    for name in ["bumpy:200K-noise0.3% front", "bumpy:200K-outliers2% front"] {
        let case = Case { motion: false, ..quick().into_iter().find(|case| case.name() == name).expect("this case") };
        let subject = Subject::new(case.recipe).expect("a subject");
        let mut painter = Painter::new(&subject);
        let (outcome, _) = measure(&case, &subject, &mut painter, &[Method::Paper]).expect("a measured case");
        let found = misses(outcome.of(Method::Paper).expect("a picture"), limits_of(&case)).join("\n");
        notices(&found, &["normals:", "normals near silhouettes:", "before", "IoU", "PSNR", "FLIP"]);
    }
}

/// Or the column about it would tell nothing of what is in reach.
#[test]
fn what_is_known_is_nearly_the_truth() {
    let name = "bumpy:200K-noise0.3% front";
    let case = Case { motion: false, ..quick().into_iter().find(|case| case.name() == name).expect("this case") };
    let subject = Subject::new(case.recipe).expect("a subject");
    let mut painter = Painter::new(&subject);
    let (outcome, _) = measure(&case, &subject, &mut painter, &[Method::Ours, Method::Known]).expect("a measured case");
    let [ours, known] = [Method::Ours, Method::Known].map(|method| outcome.of(method).expect("a picture"));
    let [far, near] = [ours, known].map(|measures| measures.angles.expect("normals").mean);
    assert!(near < 1.0 && near < 0.2 * far, "normals are {near} degrees off, ours {far}");
    assert!(known.psnr > ours.psnr + 10.0, "{} dB, ours {}", known.psnr, ours.psnr);
}

#[test]
fn every_case_has_its_line() {
    let names: Vec<_> = quick().iter().map(Case::name).collect();
    assert_eq!(names, LIMITS.map(|limits| limits.case), "a line for each case, and no other");
}

/// A good picture to be spoilt.
struct Sample {
    subject: Subject,
    limits: &'static Limits,
    pictures: Pictures,
}

fn sample() -> &'static Sample {
    static SAMPLE: OnceLock<Sample> = OnceLock::new();
    SAMPLE.get_or_init(|| {
        let case = quick().into_iter().find(|case| case.name() == "bumpy:200K front").expect("this case");
        let subject = Subject::new(case.recipe).expect("a subject");
        let mut painter = Painter::new(&subject);
        let (_, pictures) = measure(&case, &subject, &mut painter, &[Method::Ours]).expect("a measured case");
        Sample { subject, limits: limits_of(&case), pictures }
    })
}

impl Sample {
    fn picture(&self) -> &Picture {
        &self.pictures.drawn[0].1
    }

    /// What is beyond the limits of a picture.
    fn misses(&self, picture: &Picture) -> String {
        let lit = Lit::new(picture, &self.pictures.truth.exact.rays);
        self.lit_misses(picture, &lit)
    }

    fn lit_misses(&self, picture: &Picture, lit: &Lit) -> String {
        misses(&self.pictures.truth.measure(picture, lit, &self.subject), self.limits).join("\n")
    }

    /// The picture with one in so many of its pixels changed.
    fn spoilt(&self, one_in: usize, change: impl Fn(Shown) -> Option<Shown>) -> String {
        let is_chosen = |pixel| Random::new(5, pixel).unit() < 1.0 / one_in as f64;
        self.misses(&self.picture().changed(|pixel, shown| if is_chosen(pixel) { change(shown) } else { Some(shown) }))
    }
}

#[track_caller]
fn notices(misses: &str, what: &[&str]) {
    println!("{misses}\n");
    for what in what {
        assert!(misses.contains(what), "{what} should be noticed, not only:\n{misses}");
    }
}

#[test]
fn a_good_picture_misses_nothing() {
    let sample = sample();
    assert_eq!(sample.misses(sample.picture()), "", "else the next tests would say nothing");
    let truth = Picture::truth(&sample.pictures.truth.exact);
    let lit = Lit::new(&truth, &sample.pictures.truth.exact.rays);
    // Of the truth nobody knows the points, so its cover is judged where it covers, which is everywhere.
    let measures = sample.pictures.truth.measure(&truth, &lit, &sample.subject);
    let angles = measures.angles.expect("normals");
    assert!(angles.rms < 1e-9 && measures.depth_px == 0.0 && measures.flip < 1e-6, "the truth is true: {measures:?}");
    assert!(measures.psnr.is_infinite() && measures.cover.iou == 1.0, "the truth is true: {measures:?}");
}

#[test]
fn a_shifted_picture_is_noticed() {
    let sample = sample();
    notices(&sample.misses(&sample.picture().shifted(4)), &["IoU", "normals:", "PSNR", "FLIP"]);
}

#[test]
fn flipped_normals_are_noticed() {
    let flipped = |shown: Shown| Some(Shown { normal: -shown.normal, ..shown });
    notices(&sample().spoilt(200, flipped), &["above 90°", "flipped", "normals:", "PSNR"]);
}

#[test]
fn tilted_normals_are_noticed() {
    let tilt = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.0_f64.to_radians());
    notices(&sample().spoilt(2, |shown| Some(Shown { normal: tilt * shown.normal, ..shown })), &["normals:"]);
    // A quarter of those near silhouettes are too few to be noticed among all.
    let sample = sample();
    let band = sample.pictures.truth.exact.band();
    let tilted = sample.picture().changed(|pixel, shown| {
        let is_chosen = band[pixel] && pixel % 4 == 0;
        Some(if is_chosen { Shown { normal: tilt * shown.normal, ..shown } } else { shown })
    });
    let misses = sample.misses(&tilted);
    notices(&misses, &["normals near silhouettes:"]);
    assert!(!misses.contains("normals:"), "all but a few are right: {misses}");
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
    let case = quick().into_iter().find(|case| case.name() == "herd:32x1024 behind").expect("this case");
    let subject = Subject::new(case.recipe).expect("a subject");
    let mut painter = Painter::new(&subject);
    let (_, pictures) = measure(&case, &subject, &mut painter, &[Method::Ours]).expect("a measured case");
    let sample = Sample { subject, limits: limits_of(&case), pictures };
    assert_eq!(sample.misses(sample.picture()), "", "else the rest would say nothing");
    notices(&sample.spoilt(20, |_| None), &["closed"]);
    let back = |shown: Shown| Some(Shown { depth: shown.depth + 0.3 * sample.subject.diagonal, ..shown });
    let misses = sample.spoilt(20, back);
    notices(&misses, &["right"]);
    assert!(!misses.contains("closed"), "it is covered: {misses}");
    // A screen before everything.
    let near = Shown { depth: 0.5, normal: DVec3::Y, point: 0 };
    let all = Picture { width: sample.picture().width, shown: vec![Some(near); sample.picture().shown.len()] };
    notices(&sample.misses(&all), &["over", "right"]);
}

#[test]
fn holes_are_noticed() {
    notices(&sample().spoilt(300, |_| None), &["holes"]);
}

#[test]
fn leaks_are_noticed() {
    let sample = sample();
    let back = |shown: Shown| Some(Shown { depth: shown.depth + 0.3 * sample.subject.diagonal, ..shown });
    notices(&sample.spoilt(300, back), &["leaks", "depth"]);
}

#[test]
fn what_floats_in_front_is_noticed() {
    let sample = sample();
    let front = |shown: Shown| Some(Shown { depth: shown.depth - 0.3 * sample.subject.diagonal, ..shown });
    notices(&sample.spoilt(300, front), &["before", "depth"]);
}

#[test]
fn noise_in_colors_is_noticed() {
    let sample = sample();
    let lit = &sample.pictures.drawn[0].2;
    let noisy = lit.changed(|pixel, color| {
        let noise = 0.05 * Random::new(6, pixel).gauss();
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
    // The camera stands still, so each pixel shows what it showed; normals wobble by two degrees.
    let pairs = same(exact, exact);
    assert!(pairs.len() > 10_000 && pairs.iter().all(|(from, to)| from == to), "nothing moves");
    let wobbling = |step: usize| {
        sample.picture().changed(|pixel, shown| {
            let turn = TAU * Random::new(7 + step as u64, pixel).unit();
            let axis = DVec3::new(turn.cos(), turn.sin(), 0.0);
            Some(Shown { normal: DQuat::from_axis_angle(axis, 2.0_f64.to_radians()) * shown.normal, ..shown })
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
    assert_eq!(still, Change { degrees: 0.0, lightness: 0.0 }, "a picture does not differ from itself");
    let wobble = change(&[wobbling(0), wobbling(1), wobbling(2)]);
    // What the truth of a moving camera changes by, about.
    let truth = Change { degrees: 0.5, lightness: 0.5 };
    notices(&motion_misses(wobble, truth, &limits).join("\n"), &["turning", "flicker"]);
    assert!(motion_misses(truth, truth, &limits).is_empty(), "what changes like the truth is right");
}

fn limits_of_first() -> &'static Limits {
    &LIMITS[0]
}
