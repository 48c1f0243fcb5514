//! What changed between two records of measures.

use std::fmt::{self, Display};

use crate::record::{Measure, Record};

/// Greatest growth of an error in percent that is no regression.
pub const MAX_GROWTH_PERCENT: f64 = 3.0;

/// A value that differs by more than its measure's [`floor`](Measure::floor).
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// The case's name.
    pub case: String,
    /// The measure's name.
    pub measure: String,
    /// The method's name.
    pub method: String,
    /// The value in the first record.
    pub before: f64,
    /// The value in the second record, if there is one.
    pub after: Option<f64>,
    /// Growth of the [`error`](Measure::error): above 0 if worse, infinite from an error of 0 or if the value is gone.
    /// `None` for values that are neither better nor worse.
    pub growth_percent: Option<f64>,
}

impl Change {
    /// Whether the value is worse by more than [`MAX_GROWTH_PERCENT`].
    pub fn is_regression(&self) -> bool {
        self.growth_percent.is_some_and(|growth| growth > MAX_GROWTH_PERCENT)
    }
}

impl Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = match self.growth_percent {
            None => "changed".into(),
            Some(growth) if growth.is_infinite() => "worse".into(),
            Some(growth) if growth > 0.0 => format!("{growth:.1} % worse"),
            Some(growth) => format!("{:.1} % better", -growth),
        };
        let mark = if self.is_regression() { '!' } else { ' ' };
        let Self { case, measure, method, before, after, .. } = self;
        let after = after.map_or("not measured".into(), |after| after.to_string());
        write!(f, "{mark} {verdict:>14}  {case}: {measure} of {method}, {before} -> {after}")
    }
}

/// The differences between two records.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Changed values of cases in both records, the worst last.
    pub changes: Vec<Change>,
    /// Names of cases in the first record alone.
    pub removed: Vec<String>,
    /// Names of cases in the second record alone.
    pub added: Vec<String>,
    commits: [String; 2],
    /// Number of values compared.
    count: usize,
}

impl Comparison {
    /// Compares all values of the cases that both records hold.
    pub fn new(before: &Record, after: &Record) -> Self {
        let mut changes = Vec::new();
        let mut count = 0;
        for (case, measures) in &before.cases {
            let Some(measures_after) = after.cases.get(case) else { continue };
            for (measure, methods) in measures {
                for (method, &value) in methods {
                    count += 1;
                    let value_after = measures_after.get(measure).and_then(|methods| methods.get(method)).copied();
                    changes.extend(change([case, measure, method], value, value_after));
                }
            }
        }
        let growth = |change: &Change| change.growth_percent.unwrap_or(f64::NEG_INFINITY);
        changes.sort_by(|one, other| growth(one).total_cmp(&growth(other)));
        let only = |here: &Record, there: &Record| {
            here.cases.keys().filter(|case| !there.cases.contains_key(*case)).cloned().collect()
        };
        Self {
            changes,
            removed: only(before, after),
            added: only(after, before),
            commits: [before.commit.clone(), after.commit.clone()],
            count,
        }
    }

    /// Number of values that are worse by more than [`MAX_GROWTH_PERCENT`].
    pub fn regressions(&self) -> usize {
        self.changes.iter().filter(|change| change.is_regression()).count()
    }
}

/// The change of a value, if it is greater than the measure's floor. Unknown measures have no direction.
fn change([case, measure, method]: [&String; 3], before: f64, after: Option<f64>) -> Option<Change> {
    // Decimal fractions are inexact: a change of the floor itself is not above it.
    const ROUNDING: f64 = 1e-9;
    let known = Measure::find(measure);
    let floor = known.map_or(0.0, |known| known.floor);
    let error = |value| known.and_then(|known| known.error(method, value));
    let growth_percent = match after {
        Some(after) if (after - before).abs() <= floor + ROUNDING => return None,
        Some(after) => error(before).zip(error(after)).map(|(before, after)| growth(before, after)),
        None => error(before).map(|_| f64::INFINITY),
    };
    let [case, measure, method] = [case, measure, method].map(String::clone);
    Some(Change { case, measure, method, before, after, growth_percent })
}

/// Growth of an error in percent.
fn growth(before: f64, after: f64) -> f64 {
    // 0 / 0 is no number, and no growth.
    if before == after { 0.0 } else { 100.0 * (after / before - 1.0) }
}

impl Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [before, after] = &self.commits;
        let cases = [("removed", &self.removed), ("added", &self.added)];
        for (what, names) in cases.into_iter().filter(|(_, names)| !names.is_empty()) {
            writeln!(f, "{} cases {what}: {}", names.len(), names.join(", "))?;
        }
        self.changes.iter().try_for_each(|change| writeln!(f, "{change}"))?;
        let changed = self.changes.len();
        writeln!(f, "{before} -> {after}: {changed} of {} values changed noticeably.", self.count)?;
        writeln!(f, "{} of them are more than {MAX_GROWTH_PERCENT} % worse.", self.regressions())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A record of one case with these values.
    fn record(values: &[(&str, &str, f64)]) -> Record {
        let mut record = Record { commit: "0123456789ab".into(), cases: [].into() };
        let case = record.cases.entry("bunny:300K front".into()).or_default();
        for &(measure, method, value) in values {
            case.entry(measure.into()).or_default().insert(method.into(), value);
        }
        record
    }

    /// The comparison of one value before and after.
    fn compare(measure: &str, method: &str, before: f64, after: f64) -> Comparison {
        Comparison::new(&record(&[(measure, method, before)]), &record(&[(measure, method, after)]))
    }

    /// Growth of the one change, rounded to percent, and whether it is a regression.
    fn growth_of(measure: &str, method: &str, before: f64, after: f64) -> Option<(f64, bool)> {
        let change = compare(measure, method, before, after).changes.pop()?;
        Some((change.growth_percent.expect("a direction").round(), change.is_regression()))
    }

    #[test]
    fn more_than_3_percent_worse_is_a_regression() {
        let mean = |after| growth_of("normals_mean_deg", "ours", 10.0, after);
        assert_eq!(mean(10.2), Some((2.0, false)), "a little worse");
        assert_eq!(mean(10.4), Some((4.0, true)), "worse");
        assert_eq!(mean(5.0), Some((-50.0, false)), "better");
        assert_eq!(growth_of("psnr_db", "paper", 30.0, 29.8), Some((2.0, false)), "0.2 dB are 2.3 %");
        assert_eq!(growth_of("psnr_db", "paper", 30.0, 29.5), Some((6.0, true)), "0.5 dB are 5.9 %");
        assert_eq!(growth_of("psnr_db", "ours", 29.5, 30.0), Some((-6.0, false)), "more decibels are better");
        assert_eq!(growth_of("iou", "ours", 0.99, 0.98), Some((100.0, true)), "twice as much is missing");
        assert_eq!(growth_of("wider_px", "ours", -0.5, 0.1), Some((-80.0, false)), "nearer to 0");
    }

    #[test]
    fn changes_up_to_the_floor_are_none() {
        assert_eq!(growth_of("holes_percent", "ours", 0.001, 0.002), None, "few pixels, though twice as many");
        assert_eq!(growth_of("holes_percent", "ours", 0.0, 0.05), Some((f64::INFINITY, true)), "from none to some");
        assert_eq!(growth_of("normals_mean_deg", "ours", 0.5, 0.52), None, "0.02° is the floor");
        assert_eq!(growth_of("normals_mean_deg", "ours", 0.5, 0.53), Some((6.0, true)), "above the floor");
    }

    #[test]
    fn what_has_no_direction_changes_and_is_no_regression() {
        for (measure, method) in [("spacing_px", "points"), ("motion_normals_deg", "truth"), ("unknown", "ours")] {
            let comparison = compare(measure, method, 1.0, 2.0);
            assert_eq!((comparison.changes.len(), comparison.regressions()), (1, 0), "{measure} of {method}");
        }
    }

    #[test]
    fn a_value_that_is_gone_is_a_regression_and_a_case_that_is_gone_is_named() {
        let before = record(&[("iou", "ours", 0.99), ("flip", "ours", 0.1)]);
        let comparison = Comparison::new(&before, &record(&[("flip", "ours", 0.1)]));
        assert_eq!(comparison.regressions(), 1, "{comparison}");
        assert!(comparison.to_string().contains("iou of ours, 0.99 -> not measured"), "{comparison}");
        let none = Record { cases: [].into(), ..before.clone() };
        let comparison = Comparison::new(&before, &none);
        assert_eq!((comparison.removed.len(), comparison.regressions()), (1, 0), "{comparison}");
        assert_eq!(Comparison::new(&none, &before).added, ["bunny:300K front"], "the other way round");
    }

    #[test]
    fn the_worst_change_is_printed_last_and_marked() {
        let [before, after] = [[10.0, 0.1], [20.0, 0.2]].map(|[mean, flip]| {
            record(&[("normals_mean_deg", "ours", mean), ("flip", "ours", flip), ("iou", "ours", 1.0 - 0.1 * flip)])
        });
        let text = Comparison::new(&before, &after).to_string();
        let better = Comparison::new(&after, &before).to_string();
        assert!(text.contains("!  100.0 % worse  bunny:300K front: normals_mean_deg of ours, 10 -> 20\n"), "{text}");
        assert!(text.ends_with("3 of 3 values changed noticeably.\n3 of them are more than 3 % worse.\n"), "{text}");
        assert!(better.contains("   50.0 % better  bunny:300K front: flip of ours, 0.2 -> 0.1\n"), "{better}");
        let lines: Vec<_> = compare("flip", "ours", 0.1, 0.1).to_string().lines().map(str::to_owned).collect();
        assert_eq!(lines.len(), 2, "nothing changed: {lines:?}");
    }
}
