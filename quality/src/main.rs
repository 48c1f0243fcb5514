//! `cargo xtask quality`: pictures held against the exact surface.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use autosplats_quality::case::{Case, full, quick};
use autosplats_quality::measure::Angles;
use autosplats_quality::method::{Method, Painter};
use autosplats_quality::page::page;
use autosplats_quality::run::{Outcome, measure};
use autosplats_quality::sheet::{Row, write_all, write_full_size};
use autosplats_quality::subject::Subject;
use autosplats_quality::target::ratio;
use clap::Parser;

/// Holds pictures against the exact surface.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask quality")]
struct Arguments {
    /// The small cases that the tests measure
    #[arg(long)]
    quick: bool,
    /// Only cases whose name contains this
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
    /// Folder for QUALITY.md and its pictures [default: docs of this repository, and nothing for some of the cases]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder for the pictures of each case at full size: the truth, each method's, and what is right and wrong in ours
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
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
    let mut cases = if arguments.quick { quick() } else { full() };
    if let Some(only) = &arguments.only {
        cases.retain(|case| case.name().contains(only));
        ensure!(!cases.is_empty(), "no case has '{only}' in its name");
    }
    let whole = !arguments.quick && arguments.only.is_none();
    let docs = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let out = arguments.out.clone().or_else(|| whole.then(docs));
    let (outcomes, rows) = measure_all(&cases, arguments.pictures.as_deref())?;
    if let Some(out) = out {
        let sheets = write_all(&out.join("quality"), &rows)?;
        let path = out.join("QUALITY.md");
        std::fs::write(&path, page(&outcomes, &sheets)).with_context(|| path.display().to_string())?;
        eprintln!("written {}", path.display());
    }
    Ok(())
}

/// Measures and prints all cases; each subject is made once for all its views.
fn measure_all(cases: &[Case], full_size: Option<&Path>) -> Result<(Vec<Outcome>, Vec<Row>)> {
    let start = Instant::now();
    let mut outcomes = Vec::new();
    let mut rows = Vec::new();
    println!("{HEADER}");
    for same in cases.chunk_by(|one, other| one.recipe == other.recipe) {
        let recipe = same[0].recipe;
        if !recipe.is_available() {
            eprintln!("{}: left out, AUTOSPLATS_DATA has no such mesh", recipe.name());
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
degrees, percent                mean   med    rms   band    <5   <10   flip  depth px   holes   leaks  before    IoU  wider   psnr   flip";

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
        format!("{:.3} of k = {k}", ratio(outcome, Method::Ours, value).unwrap_or(f64::NAN))
    };
    println!("    ours / best fit: mean {}, band {}", best(|angles| angles.mean), best(|angles| angles.band));
    let still = &outcome.still;
    print!("    against many rays: truth of one {:.2} dB, still {:.2}", still.one_ray, still.still);
    still.methods.iter().for_each(|(method, psnr)| print!(", {} {psnr:.2}", method.name()));
    println!();
    if let Some(motion) = &outcome.motion {
        println!("    in motion, truth of many rays            lightness {:6.2}", motion.smooth);
        let truth = [("truth".to_owned(), motion.truth), ("ours, alone".to_owned(), motion.alone)];
        let methods = motion.methods.iter().map(|(method, change)| (method.name(), *change));
        for (name, change) in truth.into_iter().chain(methods) {
            println!("    in motion, {name:<12} normals {:6.2}, lightness {:6.2}", change.degrees, change.lightness);
        }
        let [alone, steady] = motion.degrees_off;
        println!("    in the last picture normals are {alone:.2} off alone, {steady:.2} steady");
    }
}
