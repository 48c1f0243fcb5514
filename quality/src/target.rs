//! What the project wants of its pictures.

use crate::measure::Angles;
use crate::method::Method;
use crate::motion::Change;
use crate::run::Outcome;

/// Share of the surface that must be sampled for its silhouette to count.
const SAMPLED: f64 = 0.85;

/// The value of a method's picture of a case, if it has one.
pub type Value = fn(&Outcome, Method) -> Option<f64>;

/// A limit, and how to tell on which side of it a case is.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// What is asked for, with the limit.
    pub what: &'static str,
    limit: f64,
    /// Whether more is better.
    more: bool,
    /// Decimals worth showing.
    pub decimals: usize,
    /// What is limited.
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

    /// The worse of two values.
    pub fn is_worse(&self, value: f64, than: f64) -> bool {
        if self.more { value < than } else { value > than }
    }
}

/// All targets.
pub const TARGETS: [Target; 11] = [
    Target::most("mean error of normals ≤ 1.15 × best fixed k", 1.15, 3, |outcome, method| {
        ratio(outcome, method, |angles| angles.mean)
    }),
    Target::most("the same near silhouettes ≤ 1.2 × best fixed k", 1.2, 3, |outcome, method| {
        ratio(outcome, method, |angles| angles.band)
    }),
    Target::most("flipped normals < 0.1 % of pixels", 0.1, 3, |outcome, method| {
        outcome.of(method)?.angles.map(|a| 100.0 * a.flipped)
    }),
    Target::most("holes ≤ 0.1 %", 0.1, 3, |outcome, method| Some(100.0 * outcome.of(method)?.cover.holes)),
    Target::most("leaks ≤ 0.1 %", 0.1, 3, |outcome, method| Some(100.0 * outcome.of(method)?.cover.leaks)),
    Target::least("silhouette IoU ≥ 0.995 where 85 % are sampled", 0.995, 4, |outcome, method| {
        let cover = outcome.of(method)?.cover;
        (cover.sampled >= SAMPLED).then_some(cover.iou)
    }),
    Target::least("PSNR ≥ dots + 4 dB", 4.0, 2, |outcome, method| gain(outcome, method, Method::Dots)),
    Target::least("PSNR ≥ paper + 1 dB without noise", 1.0, 2, |outcome, method| {
        if outcome.case.recipe.is_noisy() { None } else { gain(outcome, method, Method::Paper) }
    }),
    Target::least("PSNR ≥ paper + 6 dB with noise", 6.0, 2, |outcome, method| {
        if outcome.case.recipe.is_noisy() { gain(outcome, method, Method::Paper) } else { None }
    }),
    Target::most("change of normals in motion ≤ truth + 10 %", 1.1, 3, |outcome, method| {
        change(outcome, method, |change| change.degrees)
    }),
    Target::most("change of lightness in motion ≤ truth + 10 %", 1.1, 3, |outcome, method| {
        change(outcome, method, |change| change.lightness)
    }),
];

/// An error of a method's normals over that of the best plane fits.
pub fn ratio(outcome: &Outcome, method: Method, value: fn(&Angles) -> f64) -> Option<f64> {
    Some(value(outcome.of(method)?.angles.as_ref()?) / outcome.best_fit(value)?.1)
}

/// Decibels that a method is ahead of another.
fn gain(outcome: &Outcome, method: Method, other: Method) -> Option<f64> {
    Some(outcome.of(method)?.psnr - outcome.of(other)?.psnr)
}

/// A change in our pictures over that in the true ones. Of no other method, as no other follows the pictures before.
fn change(outcome: &Outcome, method: Method, value: fn(&Change) -> f64) -> Option<f64> {
    let motion = outcome.motion.as_ref().filter(|_| method == Method::Ours)?;
    let (_, ours) = motion.methods.iter().find(|(other, _)| *other == method)?;
    Some(value(ours) / value(&motion.truth))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::quick;
    use crate::measure::{Measures, Swept};
    use crate::page::page;
    use crate::run::Motion;
    use crate::still::Still;
    use crate::verdict::Cover;

    /// A case that we measured like this, the paper and dots worse, and plane fits like this.
    fn outcome(ours: f64, fit: f64, psnr: f64) -> Outcome {
        let cover =
            Cover { spacing_px: 1.0, sampled: 1.0, iou: 0.999, wider_px: 0.0, holes: 0.0, leaks: 0.0, before: 0.0 };
        let measures = |mean: f64, psnr| {
            let angles = Angles {
                mean,
                median: mean,
                rms: mean,
                below_5: 1.0,
                below_10: 1.0,
                above_90: 0.0,
                flipped: 0.0,
                band: mean,
            };
            Measures { cover, swept: None, angles: Some(angles), depth_px: 0.1, psnr, flip: 0.1 }
        };
        let dots = Measures { angles: None, ..measures(0.0, 20.0) };
        let methods = vec![
            (Method::Ours, measures(ours, psnr)),
            (Method::Paper, measures(9.0, 28.0)),
            (Method::Dots, dots),
            (Method::Fit(10), measures(2.0 * fit, 28.0)),
            (Method::Fit(40), measures(fit, 28.0)),
        ];
        let change = |degrees| Change { degrees, lightness: 1.0 };
        let motion = Motion {
            truth: change(1.0),
            smooth: 1.0,
            methods: vec![(Method::Ours, change(ours))],
            alone: change(ours),
            degrees_off: [1.0; 2],
        };
        let still = Still { one_ray: 40.0, still: 33.0, methods: vec![(Method::Ours, psnr)] };
        Outcome { case: quick()[0], measures: methods, still, motion: Some(motion) }
    }

    fn missed(outcome: &Outcome) -> Vec<&'static str> {
        let is_missed =
            |target: &&Target| (target.value)(outcome, Method::Ours).is_some_and(|value| !target.is_met(value));
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

    /// Each target is missed by what is bad in its way, and by nothing else.
    #[test]
    fn each_is_missed_by_what_it_is_for() {
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

    #[test]
    fn the_page_says_the_worst() {
        let with_known = |mut outcome: Outcome, mean: f64| {
            let (_, ours) = outcome.measures[0];
            let angles = ours.angles.map(|angles| Angles { mean, ..angles });
            outcome.measures.push((Method::Known, Measures { angles, ..ours }));
            outcome
        };
        // The second is missed by what is known as well, the third not.
        let outcomes = [(1.0, 1.0), (1.5, 1.4), (2.0, 1.0)];
        let outcomes = outcomes.map(|(ours, known)| with_known(outcome(ours, 1.0, 30.0), known));
        let page = page(&outcomes, &["figure".into()]);
        let line = page.lines().find(|line| line.contains(TARGETS[0].what)).expect("a line for each target");
        assert!(line.contains("| 1 of 3 | 2.000 |") && line.ends_with("| missed | 2 of 3 | 1 | 0 |"), "{line}");
        assert!(page.contains("![figure](quality/figure.png)") && !page.contains("NaN"), "{page}");
        assert!(!page.contains("## Swept points"), "no section about what there is none of");
    }

    #[test]
    fn the_page_tells_what_is_closed() {
        let mut outcome = outcome(1.0, 1.0, 30.0);
        outcome.measures[0].1.swept = Some(Swept { seen: 0.5, closed: 0.875, right: 0.75, over: 0.125 });
        let page = page(&[outcome], &[]);
        assert!(page.contains("| 50.0 | 87.50 | – | – | 75.00 | – | – | 12.50 | – | – |"), "{page}");
    }
}
