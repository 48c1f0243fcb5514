//! `cargo xtask quality`: measures pictures against the exact surface.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use autosplats_quality::case::{Case, full, quick};
use autosplats_quality::compare::{Comparison, MAX_GROWTH_PERCENT};
use autosplats_quality::measure::Angles;
use autosplats_quality::method::{Method, Painter};
use autosplats_quality::page::page;
use autosplats_quality::record::Record;
use autosplats_quality::run::{Outcome, measure};
use autosplats_quality::sheet::{Row, write_all, write_full_size};
use autosplats_quality::subject::Subject;
use clap::Parser;

/// Measures pictures against the exact surface and compares the measures with the committed ones.
///
/// If every case is measured and no error grew by more than 3 %, docs/QUALITY.md and docs/quality/measures.json are
/// written anew.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask quality")]
struct Arguments {
    /// Measure only the small cases, which the tests measure too
    #[arg(long)]
    quick: bool,
    /// Measure only cases whose names contain NAME
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
    /// Folder for measures.json, QUALITY.md and sheets of pictures, instead of target/quality; docs stay unchanged
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder for full-size pictures of each case: the truth, each method's, and what is right and wrong in ours
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Take the measures from FILE and measure nothing
    #[arg(long, value_name = "FILE", conflicts_with_all = ["quick", "only", "pictures"])]
    from: Option<PathBuf>,
    /// Accept errors that grew by more than 3 %
    #[arg(long)]
    accept: bool,
    /// Print what changed between two files of measures; fail if an error grew by more than 3 %
    #[arg(long, num_args = 2, value_names = ["BEFORE", "AFTER"], exclusive = true)]
    compare: Option<Vec<PathBuf>>,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    if let Some([before, after]) = arguments.compare.as_deref() {
        let comparison = Comparison::new(&Record::read(before)?, &Record::read(after)?);
        print!("{comparison}");
        return refuse_regressions(&comparison);
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let docs = root.join("docs");
    // Read first, so that a missing file is noticed before ten minutes of measuring.
    let committed = Record::read(&docs.join("quality/measures.json"))?;
    let out = arguments.out.clone().unwrap_or_else(|| root.join("target/quality"));
    let record = match &arguments.from {
        Some(path) => Record::read(path)?,
        None => measured(arguments, &root, &out)?,
    };
    write(&out.join("measures.json"), &record.to_json())?;
    write(&out.join("QUALITY.md"), &page(&record))?;
    let comparison = Comparison::new(&committed, &record);
    print!("{comparison}");
    if !arguments.accept {
        refuse_regressions(&comparison).context("not accepted (--accept does)")?;
    }
    let unmeasured = full().iter().filter(|case| !record.cases.contains_key(&case.name())).count();
    if arguments.out.is_some() {
        return Ok(());
    }
    if unmeasured > 0 {
        eprintln!("docs/QUALITY.md is unchanged: {unmeasured} cases are not measured");
        return Ok(());
    }
    write(&docs.join("quality/measures.json"), &record.to_json())?;
    write(&docs.join("QUALITY.md"), &page(&record))
}

/// Measures the cases that the arguments name, and writes sheets of their pictures into `out`.
fn measured(arguments: &Arguments, root: &Path, out: &Path) -> Result<Record> {
    let mut cases = if arguments.quick { quick() } else { full() };
    if let Some(only) = &arguments.only {
        cases.retain(|case| case.name().contains(only));
        ensure!(!cases.is_empty(), "no case has '{only}' in its name");
    }
    // Read first, as the commit may change while measuring.
    let commit = commit(root);
    let (outcomes, rows) = measure_all(&cases, arguments.pictures.as_deref())?;
    let sheets = write_all(out, &rows)?;
    eprintln!("{} sheets of pictures in {}", sheets.len(), out.display());
    Ok(Record::new(commit, &outcomes))
}

/// Abbreviated hash of the commit that is checked out, followed by `-dirty` if files differ from the commit.
fn commit(root: &Path) -> String {
    let describe = ["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"];
    let output = Command::new("git").current_dir(root).args(describe).output();
    let output = output.ok().filter(|output| output.status.success());
    output.map_or("unknown".into(), |output| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn write(path: &Path, text: &str) -> Result<()> {
    let folder = path.parent().context("a file has a folder")?;
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    std::fs::write(path, text).with_context(|| path.display().to_string())?;
    eprintln!("written {}", path.display());
    Ok(())
}

/// # Errors
/// A value is worse by more than [`MAX_GROWTH_PERCENT`].
fn refuse_regressions(comparison: &Comparison) -> Result<()> {
    let count = comparison.regressions();
    ensure!(count == 0, "{count} errors grew by more than {MAX_GROWTH_PERCENT} %");
    Ok(())
}

/// Measures and prints all cases. A subject is made once for all its views.
fn measure_all(cases: &[Case], full_size: Option<&Path>) -> Result<(Vec<Outcome>, Vec<Row>)> {
    let start = Instant::now();
    let mut outcomes = Vec::new();
    let mut rows = Vec::new();
    println!("{HEADER}");
    for same in cases.chunk_by(|one, other| one.recipe == other.recipe) {
        let recipe = same[0].recipe;
        if !recipe.is_available() {
            eprintln!("{}: skipped, its mesh is not in the folder AUTOSPLATS_DATA", recipe.name());
            continue;
        }
        eprintln!("{:4.0} s  {}", start.elapsed().as_secs_f64(), recipe.name());
        let subject = Subject::new(recipe)?;
        let mut painter = Painter::new(&subject);
        for case in same {
            eprintln!(
                "{:4.0} s  {} ({} of {})",
                start.elapsed().as_secs_f64(),
                case.name(),
                outcomes.len() + 1,
                cases.len()
            );
            let (outcome, pictures) = measure(case, &subject, &mut painter, &Method::ALL)?;
            print(&outcome);
            if let Some(folder) = full_size {
                write_full_size(folder, case, &subject, &pictures)?;
            }
            if case.sheet {
                rows.push(Row::new(case, &pictures));
            }
            outcomes.push(outcome);
        }
    }
    eprintln!("{:4.0} s", start.elapsed().as_secs_f64());
    Ok((outcomes, rows))
}

const HEADER: &str = "\
degrees, percent                mean   med    rms   band    <5   <10   flip  depth px   holes   leaks  before    IoU  wider   PSNR   FLIP";

fn print(outcome: &Outcome) {
    let first = outcome.measures[0].1.cover;
    println!("{}: spacing {:.2} px, sampled {:.1} %", outcome.case.name(), first.spacing_px, 100.0 * first.sampled);
    for (method, measures) in &outcome.measures {
        let none = Angles {
            mean: f64::NAN,
            median: f64::NAN,
            rms: f64::NAN,
            below_5: f64::NAN,
            below_10: f64::NAN,
            above_90: f64::NAN,
            flipped: f64::NAN,
            band: f64::NAN,
        };
        let angles = measures.angles.unwrap_or(none);
        let [below_5, below_10, flipped] = [angles.below_5, angles.below_10, angles.flipped].map(|share| 100.0 * share);
        let cover = measures.cover;
        let [holes, leaks, before] = [cover.holes, cover.leaks, cover.before].map(|share| 100.0 * share);
        println!(
            "    {:<24}{:8.2}{:6.2}{:7.2}{:7.2}{below_5:6.1}{below_10:6.1}{flipped:7.3}{:10.2}{holes:8.3}{leaks:8.3}\
             {before:8.3}{:7.4}{:7.2}{:7.2}{:7.3}",
            method.name(),
            angles.mean,
            angles.median,
            angles.rms,
            angles.band,
            measures.depth_px,
            cover.iou,
            cover.wider_px,
            measures.psnr,
            measures.flip
        );
    }
    for (method, measures) in &outcome.measures {
        if let Some(swept) = measures.swept {
            let [seen, closed, right, over] = [swept.seen, swept.closed, swept.right, swept.over].map(|s| 100.0 * s);
            let name = method.name();
            println!("    swept {seen:.1} %, {name:<12} closed {closed:6.2}, right {right:6.2}, over {over:6.2}");
        }
    }
    let best = |value: fn(&Angles) -> f64| {
        let k = outcome.best_fit(value).map_or(0, |(k, _)| k);
        format!("{:.3} of k = {k}", outcome.over_best_fit(Method::Ours, value).unwrap_or(f64::NAN))
    };
    println!("    ours / best fit: mean {}, band {}", best(|angles| angles.mean), best(|angles| angles.band));
    let still = &outcome.still;
    print!("    PSNR against 16 rays: one ray {:.2} dB, still {:.2}", still.one_ray, still.still);
    still.methods.iter().for_each(|(method, psnr)| print!(", {} {psnr:.2}", method.name()));
    println!();
    if let Some(motion) = &outcome.motion {
        println!("    in motion, truth of 16 rays             lightness {:6.2}", motion.smooth);
        let truth = [("truth".to_owned(), motion.truth), ("ours, alone".to_owned(), motion.alone)];
        let methods = motion.methods.iter().map(|(method, change)| (method.name(), *change));
        for (name, change) in truth.into_iter().chain(methods) {
            println!("    in motion, {name:<12} normals {:6.2}, lightness {:6.2}", change.degrees, change.lightness);
        }
        let [alone, steady] = motion.last_normal_errors;
        println!("    error of normals in the last picture: {alone:.2} alone, {steady:.2} from earlier pictures");
    }
}
