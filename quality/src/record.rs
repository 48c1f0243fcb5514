//! The measures of all cases as numbers in a file: `docs/quality/measures.json`.
//!
//! # How it works
//! A [`Record`] maps case, measure and method to a value. All three are sorted by name, and values are rounded, so that
//! the difference of two files is short. One line of a file holds one measure of one case. [`MEASURES`] lists the
//! measures: where each comes from, its decimals, and which values are better.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result};
use serde::{Deserialize, Serialize};

use crate::measure::{Angles, Measures, Swept};
use crate::method::{FIT_KS, Method};
use crate::motion::Change;
use crate::run::Outcome;
use crate::verdict::Cover;

/// Name of the plane fits whose normals have the lowest mean error.
pub const BEST_FIT: &str = "best fit";
/// Name under which values stand that depend on the points and the view alone.
pub const POINTS: &str = "points";
/// Names of true pictures. Their values are neither good nor bad.
const TRUTHS: [&str; 3] = ["truth", "smooth", "one ray"];

/// The measures of one case: measure, then method, then value.
pub type Values = BTreeMap<String, BTreeMap<String, f64>>;

/// The measures of all cases.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// The measured commit: its abbreviated hash, followed by `-dirty` if files differed from the commit.
    pub commit: String,
    /// The measures of each case, by the case's name.
    pub cases: BTreeMap<String, Values>,
}

impl Record {
    /// Rounds what was measured at `commit`.
    pub fn new(commit: String, outcomes: &[Outcome]) -> Self {
        Self { commit, cases: outcomes.iter().map(|outcome| (outcome.case.name(), values(outcome))).collect() }
    }

    /// Reads a record.
    ///
    /// # Errors
    /// The file cannot be read or is not a record.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        serde_json::from_str(&text).with_context(|| format!("{} is not a record of measures", path.display()))
    }

    /// The record as JSON: one line for each measure of each case.
    pub fn to_json(&self) -> String {
        let cases = self.cases.iter().map(|(case, values)| {
            let lines = values.iter().map(|(measure, methods)| format!("      {}: {}", json(measure), json(methods)));
            format!("    {}: {{\n{}\n    }}", json(case), lines.collect::<Vec<_>>().join(",\n"))
        });
        let cases = cases.collect::<Vec<_>>().join(",\n");
        format!("{{\n  \"commit\": {},\n  \"cases\": {{\n{cases}\n  }}\n}}\n", json(&self.commit))
    }
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("strings and finite numbers are JSON")
}

/// A case of a record.
#[derive(Clone, Copy, Debug)]
pub struct RecordedCase<'a> {
    /// The case's name.
    pub name: &'a str,
    /// The case's measures.
    pub values: &'a Values,
}

impl RecordedCase<'_> {
    /// The value of a measure for a method, if there is one.
    pub fn get(&self, measure: &str, method: &str) -> Option<f64> {
        self.values.get(measure)?.get(method).copied()
    }
}

/// Which values of a measure are better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Better {
    /// Lower values. The best is 0.
    Lower,
    /// Values nearer to this one.
    Nearest(f64),
    /// Higher values: peak signal-to-noise ratios in decibels.
    HigherDecibels,
    /// The measure has no direction.
    Neither,
}

/// A measure of a record.
#[derive(Clone, Copy, Debug)]
pub struct Measure {
    /// Name. Its last word is the unit.
    pub name: &'static str,
    /// Decimals that a record keeps.
    pub decimals: usize,
    /// Which values are better.
    pub better: Better,
    /// Greatest change, in the measure's unit, that counts as none.
    pub floor: f64,
    /// Values of an outcome, by method. Those that are not finite stay out of a record.
    values: fn(&Outcome) -> Vec<(String, f64)>,
}

impl Measure {
    /// The measure of this name.
    pub fn find(name: &str) -> Option<&'static Self> {
        MEASURES.iter().find(|measure| measure.name == name)
    }

    /// How far a method's value is from the best one, such that ratios make sense. `None` if there is no best one.
    /// Decibels become root mean square errors: 0.26 dB are 3 %.
    pub fn error(&self, method: &str, value: f64) -> Option<f64> {
        if TRUTHS.contains(&method) {
            return None;
        }
        match self.better {
            Better::Lower => Some(value),
            Better::Nearest(best) => Some((value - best).abs()),
            Better::HigherDecibels => Some(10.0_f64.powf(value / -20.0)),
            Better::Neither => None,
        }
    }
}

/// A measure whose lower values are better.
const fn lower(name: &'static str, decimals: usize, floor: f64, values: fn(&Outcome) -> Vec<(String, f64)>) -> Measure {
    Measure { name, decimals, better: Better::Lower, floor, values }
}

/// A measure whose values are better the nearer they are to `best`.
const fn nearest(
    best: f64,
    name: &'static str,
    decimals: usize,
    floor: f64,
    values: fn(&Outcome) -> Vec<(String, f64)>,
) -> Measure {
    Measure { name, decimals, better: Better::Nearest(best), floor, values }
}

/// A measure in decibels, with two decimals.
const fn decibels(name: &'static str, floor: f64, values: fn(&Outcome) -> Vec<(String, f64)>) -> Measure {
    Measure { name, decimals: 2, better: Better::HigherDecibels, floor, values }
}

/// A measure without a direction, any change of which is reported.
const fn neither(name: &'static str, decimals: usize, values: fn(&Outcome) -> Vec<(String, f64)>) -> Measure {
    Measure { name, decimals, better: Better::Neither, floor: 0.0, values }
}

const OURS: &[Method] = &[Method::Ours];
const OURS_AND_PAPER: &[Method] = &[Method::Ours, Method::Paper];
const WITH_DOTS: &[Method] = &[Method::Ours, Method::Paper, Method::Dots];
const WITH_KNOWN: &[Method] = &[Method::Ours, Method::Paper, Method::Known];
const ALL_BUT_FITS: &[Method] = &[Method::Ours, Method::Paper, Method::Dots, Method::Known];

/// All measures. Each is defined at the field that it is read from, in [`Angles`], [`Cover`], [`Swept`], [`Measures`],
/// [`Still`](crate::still::Still) and [`Motion`](crate::run::Motion).
pub const MEASURES: &[Measure] = &[
    lower("normals_mean_deg", 2, 0.02, means_of_normals),
    lower("normals_median_deg", 2, 0.02, |outcome| angles(outcome, OURS, |angles| angles.median)),
    lower("normals_rms_deg", 2, 0.05, |outcome| angles(outcome, OURS, |angles| angles.rms)),
    nearest(100.0, "normals_below_5_percent", 1, 0.2, |outcome| angles(outcome, OURS, |angles| 100.0 * angles.below_5)),
    nearest(100.0, "normals_below_10_percent", 1, 0.2, |outcome| {
        angles(outcome, OURS, |angles| 100.0 * angles.below_10)
    }),
    lower("normals_above_90_percent", 2, 0.02, |outcome| {
        angles(outcome, OURS_AND_PAPER, |angles| 100.0 * angles.above_90)
    }),
    lower("normals_flipped_percent", 3, 0.02, |outcome| angles(outcome, WITH_KNOWN, |angles| 100.0 * angles.flipped)),
    lower("normals_band_deg", 2, 0.03, |outcome| angles(outcome, WITH_KNOWN, |angles| angles.band)),
    lower("normals_mean_over_best_fit", 3, 0.02, |outcome| over_best_fit(outcome, |angles| angles.mean)),
    lower("normals_band_over_best_fit", 3, 0.02, |outcome| over_best_fit(outcome, |angles| angles.band)),
    neither("best_fit_neighbors", 0, best_fit_neighbors),
    neither("spacing_px", 2, |outcome| of_points(outcome, |measures| Some(measures.cover.spacing_px))),
    neither("sampled_percent", 1, |outcome| of_points(outcome, |measures| Some(100.0 * measures.cover.sampled))),
    lower("holes_percent", 3, 0.01, |outcome| cover(outcome, WITH_KNOWN, |cover| 100.0 * cover.holes)),
    lower("leaks_percent", 3, 0.01, |outcome| cover(outcome, WITH_KNOWN, |cover| 100.0 * cover.leaks)),
    lower("before_percent", 3, 0.02, |outcome| cover(outcome, OURS_AND_PAPER, |cover| 100.0 * cover.before)),
    nearest(1.0, "iou", 4, 0.0005, |outcome| cover(outcome, ALL_BUT_FITS, |cover| cover.iou)),
    nearest(0.0, "wider_px", 2, 0.03, |outcome| cover(outcome, OURS_AND_PAPER, |cover| cover.wider_px)),
    neither("swept_seen_percent", 1, |outcome| {
        of_points(outcome, |measures| measures.swept.map(|swept| 100.0 * swept.seen))
    }),
    nearest(100.0, "swept_closed_percent", 2, 0.1, |outcome| swept(outcome, |swept| 100.0 * swept.closed)),
    nearest(100.0, "swept_right_percent", 2, 0.1, |outcome| swept(outcome, |swept| 100.0 * swept.right)),
    lower("swept_over_percent", 2, 0.1, |outcome| swept(outcome, |swept| 100.0 * swept.over)),
    decibels("psnr_db", 0.1, |outcome| with_best_fit(outcome, |measures| measures.psnr)),
    lower("flip", 3, 0.002, |outcome| with_best_fit(outcome, |measures| measures.flip)),
    lower("depth_px", 2, 0.03, |outcome| of(outcome, WITH_DOTS, |measures| Some(measures.depth_px))),
    decibels("psnr_16_rays_db", 0.1, psnr_16_rays),
    lower("motion_normals_deg", 2, 0.03, |outcome| motion(outcome, |change| change.degrees, &[])),
    lower("motion_lightness_255ths", 2, 0.03, lightness),
    lower("motion_last_normals_deg", 2, 0.03, last_normals),
];

/// The rounded measures of an outcome.
fn values(outcome: &Outcome) -> Values {
    let of_measure = |measure: &Measure| {
        let values = (measure.values)(outcome).into_iter().filter(|(_, value)| value.is_finite());
        values.map(|(method, value)| (method, rounded(value, measure.decimals))).collect::<BTreeMap<_, _>>()
    };
    let all = MEASURES.iter().map(|measure| (measure.name.to_owned(), of_measure(measure)));
    all.filter(|(_, values)| !values.is_empty()).collect()
}

/// The value as text with this many decimals has it. Zero has no sign.
fn rounded(value: f64, decimals: usize) -> f64 {
    format!("{value:.decimals$}").parse::<f64>().expect("a number as text is a number") + 0.0
}

/// Values of some methods' pictures.
fn of(outcome: &Outcome, methods: &[Method], value: impl Fn(&Measures) -> Option<f64>) -> Vec<(String, f64)> {
    methods.iter().filter_map(|&method| Some((method.name(), value(outcome.of(method)?)?))).collect()
}

fn angles(outcome: &Outcome, methods: &[Method], value: fn(&Angles) -> f64) -> Vec<(String, f64)> {
    of(outcome, methods, |measures| measures.angles.as_ref().map(value))
}

fn cover(outcome: &Outcome, methods: &[Method], value: fn(&Cover) -> f64) -> Vec<(String, f64)> {
    of(outcome, methods, |measures| Some(value(&measures.cover)))
}

fn swept(outcome: &Outcome, value: fn(&Swept) -> f64) -> Vec<(String, f64)> {
    of(outcome, WITH_DOTS, |measures| measures.swept.as_ref().map(value))
}

/// A value that is the same for all methods.
fn of_points(outcome: &Outcome, value: fn(&Measures) -> Option<f64>) -> Vec<(String, f64)> {
    of(outcome, OURS, value).into_iter().map(|(_, value)| (POINTS.to_owned(), value)).collect()
}

fn means_of_normals(outcome: &Outcome) -> Vec<(String, f64)> {
    let methods: Vec<_> = WITH_KNOWN.iter().copied().chain(FIT_KS.map(Method::Fit)).collect();
    let mut means = angles(outcome, &methods, |angles| angles.mean);
    means.extend(outcome.best_fit(|angles| angles.mean).map(|(_, mean)| (BEST_FIT.to_owned(), mean)));
    means
}

fn over_best_fit(outcome: &Outcome, value: fn(&Angles) -> f64) -> Vec<(String, f64)> {
    outcome.over_best_fit(Method::Ours, value).map(|ratio| (Method::Ours.name(), ratio)).into_iter().collect()
}

/// Numbers of neighbours of the best plane fits: over all pixels, and near silhouettes.
fn best_fit_neighbors(outcome: &Outcome) -> Vec<(String, f64)> {
    let best = [("mean", outcome.best_fit(|angles| angles.mean)), ("band", outcome.best_fit(|angles| angles.band))];
    best.into_iter().filter_map(|(name, best)| Some((name.to_owned(), best?.0 as f64))).collect()
}

/// Values of all pictures, of the plane fits only those with the best normals.
fn with_best_fit(outcome: &Outcome, value: fn(&Measures) -> f64) -> Vec<(String, f64)> {
    let mut values = of(outcome, ALL_BUT_FITS, |measures| Some(value(measures)));
    let best = outcome.best_fit(|angles| angles.mean).and_then(|(k, _)| outcome.of(Method::Fit(k)));
    values.extend(best.map(|best| (BEST_FIT.to_owned(), value(best))));
    values
}

fn psnr_16_rays(outcome: &Outcome) -> Vec<(String, f64)> {
    let still = &outcome.still;
    let methods = still.methods.iter().filter(|(method, _)| ALL_BUT_FITS.contains(method));
    let mut values: Vec<_> = methods.map(|(method, psnr)| (method.name(), *psnr)).collect();
    values.extend([("one ray".to_owned(), still.one_ray), ("still".to_owned(), still.still)]);
    values
}

/// Changes in motion, if the camera moves, and further values.
fn motion(outcome: &Outcome, value: fn(&Change) -> f64, more: &[(&str, f64)]) -> Vec<(String, f64)> {
    let Some(motion) = &outcome.motion else { return Vec::new() };
    let mut values: Vec<_> = motion.methods.iter().map(|(method, change)| (method.name(), value(change))).collect();
    let truth_and_alone = [("truth", value(&motion.truth)), ("alone", value(&motion.alone))];
    values.extend(truth_and_alone.iter().chain(more).map(|&(name, value)| (name.to_owned(), value)));
    values
}

fn lightness(outcome: &Outcome) -> Vec<(String, f64)> {
    let smooth = outcome.motion.as_ref().map_or(f64::NAN, |motion| motion.smooth);
    motion(outcome, |change| change.lightness, &[("smooth", smooth)])
}

fn last_normals(outcome: &Outcome) -> Vec<(String, f64)> {
    let Some(motion) = &outcome.motion else { return Vec::new() };
    let [alone, steady] = motion.last_normal_errors;
    vec![("alone".to_owned(), alone), (Method::Ours.name(), steady)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::tests::outcome;

    fn record() -> Record {
        Record::new("0123456789ab".into(), &[outcome(1.0, 1.25, 30.0)])
    }

    #[test]
    fn a_record_is_read_as_it_was_written() {
        let record = record();
        let json = record.to_json();
        let read: Record = serde_json::from_str(&json).expect("a record");
        assert_eq!(read, record, "{json}");
    }

    #[test]
    fn values_stand_where_their_names_say() {
        let record = record();
        let (name, values) = record.cases.iter().next().expect("a case");
        let case = RecordedCase { name, values };
        let found = [
            case.get("normals_mean_deg", "ours"),
            case.get("normals_mean_deg", BEST_FIT),
            case.get("normals_mean_deg", "fit 10"),
            case.get("normals_mean_over_best_fit", "ours"),
            case.get("best_fit_neighbors", "mean"),
            case.get("sampled_percent", POINTS),
            case.get("psnr_db", BEST_FIT),
            case.get("psnr_16_rays_db", "still"),
            case.get("motion_normals_deg", "truth"),
            case.get("motion_last_normals_deg", "alone"),
            case.get("swept_closed_percent", "ours"),
            case.get("normals_mean_deg", "dots"),
        ];
        let expected = [1.0, 1.25, 2.5, 0.8, 40.0, 100.0, 28.0, 33.0, 1.0, 1.0].map(Some);
        assert_eq!(found[..10], expected, "{values:?}");
        assert_eq!(found[10..], [None, None], "points are not swept, and dots have no normals");
    }

    #[test]
    fn one_changed_value_changes_one_line() {
        let json = |psnr| Record::new("0123456789ab".into(), &[outcome(1.0, 1.0, psnr)]).to_json();
        let [before, after] = [json(30.0), json(30.004)];
        assert_eq!(before, after, "digits beyond those kept do not show");
        let changed = json(30.5);
        let lines = before.lines().zip(changed.lines()).filter(|(one, other)| one != other);
        // The picture alone, and among those against many rays.
        assert_eq!(lines.count(), 2, "{changed}");
        assert_eq!(before.lines().count(), changed.lines().count(), "{changed}");
    }

    #[test]
    fn rounding_keeps_no_sign_of_zero() {
        let values =
            [(-0.004, 2), (1.26, 1), (99.996, 2), (-0.006, 2)].map(|(value, decimals)| rounded(value, decimals));
        assert_eq!(values, [0.0, 1.3, 100.0, -0.01], "rounded as text is");
        assert!(values[0].is_sign_positive(), "zero has no sign");
    }

    #[test]
    fn names_of_measures_differ() {
        let names: std::collections::BTreeSet<_> = MEASURES.iter().map(|measure| measure.name).collect();
        assert_eq!(names.len(), MEASURES.len(), "each name is one measure's");
    }
}
