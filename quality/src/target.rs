//! The targets that the project sets for its pictures.

use crate::case::full;
use crate::method::Method;
use crate::record::{POINTS, RecordedCase};

/// Least share of the surface, in percent, that is sampled where the silhouette has a target.
/// The border of sparser points is undefined.
const MIN_SAMPLED_PERCENT: f64 = 85.0;

/// The value of a method's picture of a case, if it has one.
pub type Value = fn(&RecordedCase<'_>, Method) -> Option<f64>;

/// A limit for a value of each case.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// What the target asks for, with the limit.
    pub what: &'static str,
    limit: f64,
    /// Whether greater values are better.
    more: bool,
    /// Decimals to show.
    pub decimals: usize,
    /// The value that is limited.
    pub value: Value,
}

impl Target {
    const fn most(what: &'static str, limit: f64, decimals: usize, value: Value) -> Self {
        Self { what, limit, more: false, decimals, value }
    }

    const fn least(what: &'static str, limit: f64, decimals: usize, value: Value) -> Self {
        Self { what, limit, more: true, decimals, value }
    }

    /// Whether a value is within the limit.
    pub fn is_met(&self, value: f64) -> bool {
        if self.more { value >= self.limit } else { value <= self.limit }
    }

    /// Whether `value` is worse than another.
    pub fn is_worse(&self, value: f64, than: f64) -> bool {
        if self.more { value < than } else { value > than }
    }

    /// Whether a method misses the target in a case. `None` if the target does not apply to the case.
    pub fn is_missed(&self, case: &RecordedCase<'_>, method: Method) -> Option<bool> {
        (self.value)(case, method).map(|value| !self.is_met(value))
    }
}

/// All targets.
pub const TARGETS: [Target; 11] = [
    Target::most("mean error of normals ≤ 1.15 × best fit", 1.15, 2, |case, method| {
        over_best_fit(case, method, "normals_mean_deg", "normals_mean_over_best_fit")
    }),
    Target::most("the same near silhouettes ≤ 1.2 × best fit", 1.2, 2, |case, method| {
        over_best_fit(case, method, "normals_band_deg", "normals_band_over_best_fit")
    }),
    Target::most("flipped normals ≤ 0.1 %", 0.1, 2, |case, method| {
        case.get("normals_flipped_percent", &method.name())
    }),
    Target::most("holes ≤ 0.1 %", 0.1, 3, |case, method| case.get("holes_percent", &method.name())),
    Target::most("leaks ≤ 0.1 %", 0.1, 3, |case, method| case.get("leaks_percent", &method.name())),
    Target::least("silhouette IoU ≥ 0.995 where 85 % are sampled", 0.995, 4, |case, method| {
        let is_sampled = case.get("sampled_percent", POINTS)? >= MIN_SAMPLED_PERCENT;
        case.get("iou", &method.name()).filter(|_| is_sampled)
    }),
    Target::least("PSNR ≥ dots + 4 dB", 4.0, 2, |case, method| gain(case, method, Method::Dots)),
    Target::least("PSNR ≥ paper + 1 dB without noise", 1.0, 2, |case, method| {
        if is_noisy(case) { None } else { gain(case, method, Method::Paper) }
    }),
    Target::least("PSNR ≥ paper + 6 dB with noise", 6.0, 2, |case, method| {
        if is_noisy(case) { gain(case, method, Method::Paper) } else { None }
    }),
    Target::most("change of normals in motion ≤ 1.1 × truth", 1.1, 2, |case, method| {
        over_truth(case, method, "motion_normals_deg")
    }),
    Target::most("change of lightness in motion ≤ 1.1 × truth", 1.1, 2, |case, method| {
        over_truth(case, method, "motion_lightness_255ths")
    }),
];

/// An error of a method's normals over the lowest of the plane fits.
fn over_best_fit(case: &RecordedCase<'_>, method: Method, error: &str, ratio_of_ours: &str) -> Option<f64> {
    let ours = Method::Ours.name();
    Some(case.get(ratio_of_ours, &ours)? * (case.get(error, &method.name())? / case.get(error, &ours)?))
}

/// Decibels that a method is ahead of another.
fn gain(case: &RecordedCase<'_>, method: Method, other: Method) -> Option<f64> {
    Some(case.get("psnr_db", &method.name())? - case.get("psnr_db", &other.name())?)
}

/// A change in motion over that of the true pictures. Only ours have a target: no other method uses earlier pictures.
fn over_truth(case: &RecordedCase<'_>, method: Method, change: &str) -> Option<f64> {
    let ours = case.get(change, &method.name()).filter(|_| method == Method::Ours)?;
    Some(ours / case.get(change, "truth")?)
}

/// Whether points lie beside the surface. Cases that are no longer measured count as free of noise.
fn is_noisy(case: &RecordedCase<'_>) -> bool {
    full().iter().any(|other| other.recipe.is_noisy() && other.name() == case.name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::quick;
    use crate::measure::{Angles, Measures};
    use crate::motion::Change;
    use crate::record::Record;
    use crate::run::Outcome;
    use crate::run::tests::outcome;

    /// The targets that ours misses in one case.
    fn missed(outcome: &Outcome) -> Vec<&'static str> {
        let record = Record::new("0123456789ab".into(), std::slice::from_ref(outcome));
        let (name, values) = record.cases.iter().next().expect("a case");
        let case = RecordedCase { name, values };
        let is_missed = |target: &&Target| target.is_missed(&case, Method::Ours) == Some(true);
        TARGETS.iter().filter(is_missed).map(|target| target.what).collect()
    }

    #[test]
    fn good_meets_all_and_bad_misses() {
        assert_eq!(missed(&outcome(1.0, 1.0, 30.0)), [""; 0], "as good as the best plane fits");
        let wrong = missed(&outcome(1.3, 1.0, 30.0));
        assert_eq!(wrong, [TARGETS[0].what, TARGETS[1].what, TARGETS[9].what], "normals, and how they turn");
        let dark = missed(&outcome(1.0, 1.0, 22.0));
        assert_eq!(dark, ["PSNR ≥ dots + 4 dB", "PSNR ≥ paper + 1 dB without noise"], "colours");
    }

    /// Each defect makes a picture miss its own target, and no other.
    #[test]
    fn each_target_notices_its_own_defect() {
        fn angles(measures: &mut Measures) -> &mut Angles {
            measures.angles.as_mut().expect("normals")
        }
        let ours = |spoil: fn(&mut Measures)| {
            let mut outcome = outcome(1.0, 1.0, 30.0);
            spoil(&mut outcome.measures[0].1);
            outcome
        };
        let flicker = |spoil: fn(&mut Change)| {
            let mut outcome = outcome(1.0, 1.0, 30.0);
            spoil(&mut outcome.motion.as_mut().expect("motion").methods[0].1);
            outcome
        };
        let noisy = |psnr| {
            let case = quick().into_iter().find(|case| case.recipe.is_noisy()).expect("a noisy case");
            Outcome { case, ..outcome(1.0, 1.0, psnr) }
        };
        assert_eq!(missed(&noisy(34.5)), [""; 0], "6.5 dB ahead of the paper's");
        let hardly_sampled = ours(|m| (m.cover.iou, m.cover.sampled) = (0.9, 0.84));
        assert_eq!(missed(&hardly_sampled), [""; 0], "the silhouette of sparse points does not count");
        let spoiled = [
            ("mean error of normals", ours(|m| angles(m).mean = 1.16)),
            ("the same near silhouettes", ours(|m| angles(m).band = 1.21)),
            ("flipped", ours(|m| angles(m).flipped = 0.0011)),
            ("holes", ours(|m| m.cover.holes = 0.0011)),
            ("leaks", ours(|m| m.cover.leaks = 0.0011)),
            ("silhouette IoU", ours(|m| (m.cover.iou, m.cover.sampled) = (0.9949, 0.86))),
            ("PSNR ≥ dots", {
                let mut outcome = ours(|_| ());
                outcome.measures[2].1.psnr = 26.5;
                outcome
            }),
            ("PSNR ≥ paper + 1 dB without noise", outcome(1.0, 1.0, 28.5)),
            ("PSNR ≥ paper + 6 dB with noise", noisy(33.5)),
            ("change of normals", flicker(|change| change.degrees = 1.11)),
            ("change of lightness", flicker(|change| change.lightness = 1.11)),
        ];
        assert_eq!(spoiled.len(), TARGETS.len());
        for ((what, outcome), target) in spoiled.iter().zip(TARGETS) {
            assert!(target.what.starts_with(what), "{what}, {}", target.what);
            assert_eq!(missed(outcome), [target.what]);
        }
    }
}
