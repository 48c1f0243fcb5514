//! Pictures of the built-in scenes against their exact surfaces, with limits.
//!
//! Each cloud is rendered with the default settings, and its pixels are judged and counted. Errors of normals are
//! compared with those of plane fits to the exact nearest neighbours in the whole cloud. `cargo test -p
//! autosplats-quality --test it truth:: -- --nocapture` prints all measures. On failure, or with
//! `AUTOSPLATS_TRUTH_IMAGES` set, the verdicts of each view are written as a picture.

use std::path::Path;

use autosplats::{Reconstruction, ViewDirection};
use autosplats_quality::exact::Exact;
use autosplats_quality::measure::angle;
use autosplats_quality::method::Painter;
use autosplats_quality::picture::Picture;
use autosplats_quality::sheet::verdict_color;
use autosplats_quality::subject::{Recipe, Source, Subject};
use autosplats_quality::verdict::Verdicts;
use autosplats_quality::view::Shot;

/// Least intersection over union of the covered pixels, for pictures with a sampled share of at least [`MIN_SAMPLED`].
/// The border of sparser points is undefined.
const MIN_IOU: f64 = 0.985;
/// Least share of the surface that is sampled where [`MIN_IOU`] applies.
const MIN_SAMPLED: f64 = 0.85;
/// Greatest share of empty pixels at least two pixels inside the true silhouette.
const MAX_HOLES: f64 = 0.001;
/// Greatest share of pixels that show surfaces behind the true one, of covered pixels.
const MAX_LEAKS: f64 = 0.002;
/// Greatest mean error of normals over that of plane fits in the whole cloud. The cathedral is nearest to the limit.
const MAX_NORMAL_RATIO: f64 = 1.105;

/// A subject and the size of its pictures.
struct TestSubject {
    subject: Subject,
    size: [u32; 2],
}

/// A picture with its measures.
struct JudgedPicture {
    exact: Exact,
    picture: Picture,
    verdicts: Verdicts,
    /// Mean angles to the true normals in degrees: of the picture, and of plane fits.
    angles: [f64; 2],
}

impl TestSubject {
    fn new(name: &'static str, count: usize, size: [u32; 2]) -> Self {
        let subject = Subject::new(Recipe::new(Source::Scene(name), count)).expect("a scene of this name");
        Self { subject, size }
    }

    fn exact(&self, shot: Shot) -> Exact {
        let camera = shot.camera(&self.subject, self.size).expect("a camera");
        Exact::trace(&self.subject, &camera, self.size).expect("a camera that can see")
    }

    fn picture(&self, shot: Shot, reconstruction: Reconstruction) -> Picture {
        let camera = shot.camera(&self.subject, self.size).expect("a camera");
        Painter::new(&self.subject).render(reconstruction, &camera, self.size).expect("a frame")
    }

    fn judge(&self, exact: Exact, picture: Picture) -> JudgedPicture {
        let verdicts = Verdicts::new(&exact, &picture, &self.subject);
        let angles = verdicts.normals_and_fits(&exact, &picture, &self.subject);
        JudgedPicture { exact, picture, verdicts, angles }
    }

    /// Measures and prints all `shots`, and checks the limits. Each shot has the least share of its surface that must
    /// be sampled: the herd's meadow is sparser than its horses, and the cathedral has scanner shadows.
    fn meets_the_limits(&self, shots: &[(Shot, f64)]) {
        let mut missed = String::new();
        for &(shot, sampled) in shots {
            let label = format!("{} {}", self.subject.recipe.name(), shot.name());
            let found = self.judge(self.exact(shot), self.picture(shot, Reconstruction::default()));
            println!("{label:<28}{}", found.line());
            let mut misses = found.misses();
            if !(found.verdicts.cover().sampled >= sampled) {
                misses.push("too few points for this picture's size".into());
            }
            if !misses.is_empty() || std::env::var_os("AUTOSPLATS_TRUTH_IMAGES").is_some() {
                found.write(&label.replace([':', ' '], "-"));
            }
            misses.iter().for_each(|miss| missed += &format!("\n{label}: {miss}"));
        }
        assert!(missed.is_empty(), "limits missed: {missed}");
    }
}

impl JudgedPicture {
    fn ratio(&self) -> f64 {
        self.angles[0] / self.angles[1]
    }

    /// The missed limits.
    fn misses(&self) -> Vec<String> {
        let cover = self.verdicts.cover();
        let mut misses = Vec::new();
        // NaN misses a limit.
        if cover.sampled >= MIN_SAMPLED && !(cover.iou >= MIN_IOU) {
            misses.push(format!("silhouette IoU {:.4} is below {MIN_IOU}", cover.iou));
        }
        let limits = [
            ("holes", cover.holes, MAX_HOLES),
            ("leaks", cover.leaks, MAX_LEAKS),
            ("normal error", self.ratio(), MAX_NORMAL_RATIO),
        ];
        for (what, value, most) in limits {
            if !(value <= most) {
                misses.push(format!("{what} {value:.5} is above {most}"));
            }
        }
        misses
    }

    fn line(&self) -> String {
        let cover = self.verdicts.cover();
        let [sampled, holes, leaks, before] =
            [cover.sampled, cover.holes, cover.leaks, cover.before].map(|share| 100.0 * share);
        format!(
            "spacing {:.2} px, sampled {sampled:.2} %, IoU {:.4}, wider {:.2} px, holes {holes:.3} %, leaks {leaks:.3} %, \
             before {before:.3} %, normals {:.2}° and {:.2}°: {:.3}",
            cover.spacing_px,
            cover.iou,
            cover.wider_px,
            self.angles[0],
            self.angles[1],
            self.ratio()
        )
    }

    /// Writes a picture of the verdicts.
    fn write(&self, name: &str) {
        let color = |(pixel, verdict)| verdict_color(verdict, angle(&self.exact, &self.picture, pixel));
        let verdicts = self.verdicts.verdicts.iter().copied().enumerate();
        let [width, height] = [self.exact.width, self.exact.height()].map(|side| side as u32);
        let image = image::RgbImage::from_vec(width, height, verdicts.flat_map(color).collect()).expect("full");
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("truth-{name}.png"));
        image.save(&path).expect("a place to write pictures to");
        println!("verdicts in {}", path.display());
    }
}

#[test]
fn figure() {
    TestSubject::new("figure", 300_000, [1280, 800]).meets_the_limits(&[
        (Shot::Own, 0.85),
        (Shot::Whole(ViewDirection::Iso), 0.85),
        (Shot::Parallel(ViewDirection::Left), 0.85),
    ]);
}

#[test]
fn two_scales() {
    TestSubject::new("two-scales", 1_100_000, [1280, 800]).meets_the_limits(&[
        (Shot::Own, 0.85),
        (Shot::Whole(ViewDirection::Iso), 0.85),
        (Shot::Parallel(ViewDirection::Front), 0.85),
    ]);
}

#[test]
fn statue() {
    TestSubject::new("statue", 800_000, [1600, 1000]).meets_the_limits(&[
        (Shot::Own, 0.85),
        (Shot::Whole(ViewDirection::Iso), 0.85),
        (Shot::Parallel(ViewDirection::Back), 0.85),
    ]);
}

// Two views are not tested, as they miss the limits: see README, *Limits*. Slits between legs and manes close in the
// herd seen from the left. Trimming opens holes in scanner shadows across the cathedral's nave.
#[test]
fn herd() {
    TestSubject::new("herd", 1_000_000, [1280, 800]).meets_the_limits(&[
        (Shot::Own, 0.2),
        (Shot::Whole(ViewDirection::Iso), 0.2),
        (Shot::Parallel(ViewDirection::Top), 0.1),
    ]);
}

#[test]
fn cathedral() {
    let aisle = Shot::From([-3.0, 7.0, 2.0], [14.0, 6.5, 4.0], 60.0);
    TestSubject::new("cathedral", 3_000_000, [960, 600]).meets_the_limits(&[(Shot::Own, 0.35), (aisle, 0.1)]);
}

/// Each measure notices its own defect.
#[test]
fn poor_pictures_miss_the_limits() {
    let test = TestSubject::new("figure", 300_000, [1280, 800]);
    let exact = test.exact(Shot::Own);
    let misses = |picture: &Picture| {
        let found = test.judge(exact.clone(), picture.clone());
        println!("{:<28}{}", "poor", found.line());
        found.misses().join("\n")
    };

    let thin = misses(&test.picture(Shot::Own, Reconstruction { splat_scale: 0.3, ..Reconstruction::default() }));
    assert!(thin.contains("holes"), "splats too small to touch leave holes, found: {thin}");
    assert!(thin.contains("leaks"), "splats too small to touch show the far side, found: {thin}");

    let picture = test.picture(Shot::Own, Reconstruction::default());
    let beside = misses(&picture.shifted(6));
    assert!(beside.contains("IoU"), "a shifted picture has another silhouette, found: {beside}");
    let wrong = misses(&picture.with_normals_of(&picture.shifted(6)));
    assert!(wrong.contains("normal"), "shifted normals are wrong, found: {wrong}");
}
