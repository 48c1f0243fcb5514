//! Renders of the built-in scenes against their exact surfaces, at the limits the project sets itself.
//!
//! The cloud is rendered with the default settings, each pixel of it judged, and the verdicts counted. Normals compete with
//! plane fits on the exact nearest neighbours in the whole cloud. `cargo test -p autosplats-quality --test it truth:: --
//! --nocapture` prints what was measured; with `AUTOSPLATS_TRUTH_IMAGES` set, or on failure, the verdicts of each view are
//! written as a picture.

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

/// Least intersection over union of the covered pixels, of pictures whose surface is sampled densely enough nearly
/// everywhere ([`SAMPLED`]); where a surface thins out, its border is anybody's guess.
const IOU: f64 = 0.985;
const SAMPLED: f64 = 0.85;
/// Most empty pixels, of those at least two pixels inside the true silhouette.
const HOLES: f64 = 0.001;
/// Most pixels that show what lies behind the surface, of those covered.
const LEAKS: f64 = 0.002;
/// Mean error of the normals, over that of plane fits in the whole cloud. The cathedral has 1.101, and had 1.099 while the
/// worst places were holes.
const NORMALS: f64 = 1.105;

/// A subject and the size of its pictures.
struct Test {
    subject: Subject,
    size: [u32; 2],
}

/// What is measured of a picture.
struct Found {
    exact: Exact,
    picture: Picture,
    verdicts: Verdicts,
    /// Mean angle to the true normal in degrees, of ours and of the reference.
    angles: [f64; 2],
}

impl Test {
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

    fn judge(&self, exact: Exact, picture: Picture) -> Found {
        let verdicts = Verdicts::new(&exact, &picture, &self.subject);
        let angles = verdicts.normals_and_fits(&exact, &picture, &self.subject);
        Found { exact, picture, verdicts, angles }
    }

    /// Measures all `shots`, prints them as a table and holds each against the limits. With each shot comes the least share
    /// of the surface there that must be sampled densely enough to count: the herd's meadow is sparser than its horses, and
    /// no scanner in the cathedral saw everything.
    fn meets_the_limits(&self, shots: &[(Shot, f64)]) {
        let mut missed = String::new();
        for &(shot, sampled) in shots {
            let label = format!("{} {}", self.subject.recipe.name(), shot.name());
            let found = self.judge(self.exact(shot), self.picture(shot, Reconstruction::default()));
            println!("{label:<28}{}", found.line());
            let mut misses = found.misses();
            if !(found.verdicts.cover().sampled >= sampled) {
                misses.push("too few points for this size".into());
            }
            if !misses.is_empty() || std::env::var_os("AUTOSPLATS_TRUTH_IMAGES").is_some() {
                found.write(&label.replace([':', ' '], "-"));
            }
            misses.iter().for_each(|miss| missed += &format!("\n{label}: {miss}"));
        }
        assert!(missed.is_empty(), "limits missed: {missed}");
    }
}

impl Found {
    fn ratio(&self) -> f64 {
        self.angles[0] / self.angles[1]
    }

    /// What is beyond its limit.
    fn misses(&self) -> Vec<String> {
        let cover = self.verdicts.cover();
        let mut misses = Vec::new();
        // Written so that a value that is no number misses.
        if cover.sampled >= SAMPLED && !(cover.iou >= IOU) {
            misses.push(format!("silhouette IoU {:.4} is below {IOU}", cover.iou));
        }
        let limits =
            [("holes", cover.holes, HOLES), ("leaks", cover.leaks, LEAKS), ("normal error", self.ratio(), NORMALS)];
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
    Test::new("figure", 300_000, [1280, 800]).meets_the_limits(&[
        (Shot::Own, 0.85),
        (Shot::Whole(ViewDirection::Iso), 0.85),
        (Shot::Parallel(ViewDirection::Left), 0.85),
    ]);
}

#[test]
fn two_scales() {
    Test::new("two-scales", 1_100_000, [1280, 800]).meets_the_limits(&[
        (Shot::Own, 0.85),
        (Shot::Whole(ViewDirection::Iso), 0.85),
        (Shot::Parallel(ViewDirection::Front), 0.85),
    ]);
}

#[test]
fn statue() {
    Test::new("statue", 800_000, [1600, 1000]).meets_the_limits(&[
        (Shot::Own, 0.85),
        (Shot::Whole(ViewDirection::Iso), 0.85),
        (Shot::Parallel(ViewDirection::Back), 0.85),
    ]);
}

// Not held to the limits, as ARCHITECTURE.md says: the herd from the left, whose slits between legs and manes close, and
// the cathedral's nave across scanner shadows, where trimming opens holes.
#[test]
fn herd() {
    Test::new("herd", 1_000_000, [1280, 800]).meets_the_limits(&[
        (Shot::Own, 0.2),
        (Shot::Whole(ViewDirection::Iso), 0.2),
        (Shot::Parallel(ViewDirection::Top), 0.1),
    ]);
}

#[test]
fn cathedral() {
    let aisle = Shot::From([-3.0, 7.0, 2.0], [14.0, 6.5, 4.0], 60.0);
    Test::new("cathedral", 3_000_000, [960, 600]).meets_the_limits(&[(Shot::Own, 0.35), (aisle, 0.1)]);
}

/// The measures notice what they are meant to notice.
#[test]
fn poor_pictures_miss_the_limits() {
    let test = Test::new("figure", 300_000, [1280, 800]);
    let exact = test.exact(Shot::Own);
    let misses = |picture: &Picture| {
        let found = test.judge(exact.clone(), picture.clone());
        println!("{:<28}{}", "poor", found.line());
        found.misses().join("\n")
    };

    let thin = misses(&test.picture(Shot::Own, Reconstruction { splat_scale: 0.3, ..Reconstruction::default() }));
    assert!(thin.contains("holes"), "splats too small to meet each other leave holes, not only: {thin}");
    assert!(thin.contains("leaks"), "and show the far side, not only: {thin}");

    let picture = test.picture(Shot::Own, Reconstruction::default());
    let beside = misses(&picture.shifted(6));
    assert!(beside.contains("IoU"), "a picture beside its place has another silhouette, not only: {beside}");
    let wrong = misses(&picture.with_normals_of(&picture.shifted(6)));
    assert!(wrong.contains("normal"), "normals beside their place are wrong, not only: {wrong}");
}
