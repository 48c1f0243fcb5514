//! `docs/QUALITY.md`, from a record of measures alone.

use crate::method::Method;
use crate::record::{BEST_FIT, Record, RecordedCase};
use crate::table::{Table, number};
use crate::target::{TARGETS, Target};

/// Greatest length of the page in bytes.
pub const MAX_BYTES: usize = 8_000;

const MEANING: &str = "\
## What is measured

- A case is an exact surface with points on it, and a view. `64x2048` are beams and steps of a spinning lidar. Noise and \
the shift between two scans are in percent of the bounding box's diagonal, outliers in percent of the points.
- One ray through each pixel's centre finds the true surface. *Normals* is the mean angle between drawn and true normals.
- *Best fit* is the same for planes fitted to the k nearest neighbours, with the best k of 10, 40, 160 and 640 in each \
case. *Exact points* are our splats without noise and outliers, with true normals.
- *PSNR* compares lit pictures with the lit truth. *Paper* are the paper's settings, *dots* are squares of 3x3 pixels.
- *IoU* compares the covered pixels with the true ones. *Holes* are empty pixels inside the true silhouette, *leaks* \
show what lies behind the surface. Motion is six camera steps of 0.7°.
- Views: *own* is the scene's, *near* and *far* move the eye 3 to 5 times nearer or further. *Behind* is above and behind \
the lidar, *inside* within the cathedral, *parallel* without perspective.
- Points: *uneven* are dense and sparse patches, *striped* are stripes, *gradient* falls to a twentieth along x. \
`scans0.15%` are two scans, shifted by 0.15 % and turned by 0.1°. Silhouettes count only if 85 % of the visible surface \
is sampled.

";

const TARGETS_TITLE: &str = "\
## Targets

*Met* counts the cases within the limit, *exact* those that exact points meet. *Worst* is the worst case's value.

";

const CASES_TITLE: &str = "\
## Cases

*Misses* has the letters of missed targets. [quality/measures.json](quality/measures.json) has all measures of all \
cases; `quality/src/record.rs` lists and defines them.

";

const REPEAT: &str = "\
## Repeat and compare

```sh
cargo xtask quality                # all cases, in ten minutes on two cores; updates this page and the measures
cargo xtask quality --only bunny   # the cases with this word in their names; --quick takes the small ones
cargo xtask quality --compare BEFORE.json AFTER.json
```

Each run writes `measures.json`, this page and sheets of pictures to `target/quality/` (`--out` names another folder). \
Then it compares the measures with the committed ones. If an error grew by more than 3 %, the run fails and leaves the \
committed files as they are. `--from target/quality/measures.json --accept` takes them over without measuring again.

The bunny (Stanford 3D Scanning Repository), the horse (Sumner and Popović) and the dancer (Vlasic et al.) are read from \
the folder `AUTOSPLATS_DATA`.
";

/// The whole page.
pub fn page(record: &Record) -> String {
    let cases: Vec<_> = record.cases.iter().map(|(name, values)| RecordedCase { name, values }).collect();
    let title = format!(
        "# Quality: pictures against exact surfaces\n\nWritten by `cargo xtask quality`. \
         Measured at commit `{}`; times are in [PERFORMANCE.md](PERFORMANCE.md).\n\n",
        record.commit
    );
    [&title, MEANING, TARGETS_TITLE, &targets(&cases), CASES_TITLE, &table(&cases), REPEAT].concat()
}

/// Targets with the letters that name them.
fn lettered() -> impl Iterator<Item = (char, Target)> {
    ('A'..='Z').zip(TARGETS)
}

fn targets(cases: &[RecordedCase<'_>]) -> String {
    let mut table = Table::new(&["target", "met", "worst", "in", "exact"]);
    for (letter, target) in lettered() {
        let values = cases.iter().filter_map(|case| Some((case, (target.value)(case, Method::Ours)?)));
        let values: Vec<_> = values.filter(|(_, value)| value.is_finite()).collect();
        let worst =
            values.iter().copied().reduce(|one, other| if target.is_worse(other.1, one.1) { other } else { one });
        let Some((at_worst, worst)) = worst else { continue };
        let met = values.iter().filter(|(_, value)| target.is_met(*value)).count();
        let exact: Vec<_> = cases.iter().filter_map(|case| target.is_missed(case, Method::Known)).collect();
        let exact_met = exact.iter().filter(|is_missed| !**is_missed).count();
        table.row(&[
            format!("{letter}: {}", target.what),
            format!("{met} of {}", values.len()),
            number(worst, target.decimals),
            at_worst.name.into(),
            if exact.is_empty() { "–".into() } else { format!("{exact_met} of {}", exact.len()) },
        ]);
    }
    table.finish()
}

fn table(cases: &[RecordedCase<'_>]) -> String {
    let mut table = Table::new(&["case", "normals °", "best fit", "PSNR dB", "paper", "IoU", "misses"]);
    for case in cases {
        let ours = Method::Ours.name();
        let paper = Method::Paper.name();
        let value =
            |measure: &str, method: &str, decimals| number(case.get(measure, method).unwrap_or(f64::NAN), decimals);
        let is_missed = |target: Target| target.is_missed(case, Method::Ours) == Some(true);
        table.row(&[
            case.name.into(),
            value("normals_mean_deg", &ours, 2),
            value("normals_mean_deg", BEST_FIT, 2),
            value("psnr_db", &ours, 2),
            value("psnr_db", &paper, 2),
            value("iou", &ours, 4),
            lettered().filter(|(_, target)| is_missed(*target)).map(|(letter, _)| letter).collect(),
        ]);
    }
    table.finish()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::case::full;
    use crate::measure::{Angles, Measures};
    use crate::run::Outcome;
    use crate::run::tests::outcome;

    #[test]
    fn the_page_is_short_even_if_every_case_misses_every_target() {
        let bad = |case| {
            let mut outcome = Outcome { case, ..outcome(88.88, 11.11, 11.11) };
            for (_, measures) in &mut outcome.measures {
                measures.cover.holes = 0.5;
                measures.cover.leaks = 0.5;
                measures.cover.iou = 0.5;
                measures.angles.iter_mut().for_each(|angles| angles.flipped = 0.5);
            }
            outcome.motion.as_mut().expect("motion").methods[0].1.lightness = 2.0;
            outcome
        };
        let outcomes: Vec<_> = full().into_iter().map(bad).collect();
        let page = page(&Record::new("0123456789ab-dirty".into(), &outcomes));
        let row = page.lines().find(|line| line.starts_with("| figure:300K own |")).expect("a row for each case");
        assert_eq!(row, "| figure:300K own | 88.88 | 11.11 | 11.11 | 28.00 | 0.5000 | ABCDEFGHJK |", "without noise");
        assert!(page.len() <= MAX_BYTES, "{} bytes, {MAX_BYTES} allowed:\n{page}", page.len());
    }

    #[test]
    fn the_page_names_the_worst_case() {
        let with_known = |mut outcome: Outcome, mean: f64| {
            let (_, ours) = outcome.measures[0];
            let angles = ours.angles.map(|angles| Angles { mean, ..angles });
            outcome.measures.push((Method::Known, Measures { angles, ..ours }));
            outcome
        };
        // Exact points miss the second case as well, but not the third.
        let outcomes = [(1.0, 1.0), (1.5, 1.4), (2.0, 1.0)];
        let cases = full();
        let outcomes: Vec<_> = outcomes
            .iter()
            .zip(cases)
            .map(|(&(ours, known), case)| with_known(Outcome { case, ..outcome(ours, 1.0, 30.0) }, known))
            .collect();
        let page = page(&Record::new("0123456789ab".into(), &outcomes));
        let row = page.lines().find(|line| line.contains(TARGETS[0].what)).expect("a row for each target");
        let expected = format!("| A: {} | 1 of 3 | 2.00 | {} | 2 of 3 |", TARGETS[0].what, outcomes[2].case.name());
        assert_eq!(row, expected, "two miss");
        assert!(page.contains("commit `0123456789ab`") && !page.contains("NaN"), "{page}");
    }

    #[test]
    fn the_committed_page_is_made_from_the_committed_measures() {
        let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
        let record = Record::read(&docs.join("quality/measures.json")).expect("the committed measures");
        let json = std::fs::read_to_string(docs.join("quality/measures.json")).expect("the committed measures");
        let committed = std::fs::read_to_string(docs.join("QUALITY.md")).expect("the committed page");
        assert_eq!(json, record.to_json(), "measures are laid out by `cargo xtask quality --from`");
        assert_eq!(committed, page(&record), "the page is made by `cargo xtask quality --from`");
    }
}
