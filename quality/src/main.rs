//! `cargo xtask quality`: pictures held against the exact surface.

use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Result, ensure};
use autosplats_quality::case::{full, quick};
use autosplats_quality::method::{Method, Painter};
use autosplats_quality::run::{Outcome, measure};
use autosplats_quality::subject::Subject;
use clap::Parser;

/// Holds pictures against the exact surface.
#[derive(Debug, Parser)]
struct Arguments {
    /// The small cases that the tests measure
    #[arg(long)]
    quick: bool,
    /// Only cases whose name contains this; prints, writes nothing
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
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
    }
    ensure!(!cases.is_empty(), "no case has such a name");
    let mut left = cases.as_slice();
    println!("{HEADER}");
    while let Some(first) = left.first() {
        let same = left.iter().take_while(|case| case.recipe == first.recipe).count();
        let (cases, rest) = left.split_at(same);
        left = rest;
        if !first.recipe.is_available() {
            eprintln!("{}: left out, its mesh is not there", first.recipe.name());
            continue;
        }
        let start = Instant::now();
        let subject = Subject::new(first.recipe)?;
        let mut painter = Painter::new(&subject);
        for case in cases {
            let (outcome, _) = measure(case, &subject, &mut painter, &Method::ALL)?;
            print(&outcome);
            eprintln!("{}: {:.1} s", case.name(), start.elapsed().as_secs_f64());
        }
    }
    Ok(())
}

const HEADER: &str = "case / method                                 mean°  med°   rms°  band°  <5°%  <10°%  flip%  depth px  holes%  leaks%  before%    IoU  wider   psnr";

fn print(outcome: &Outcome) {
    let first = outcome.measures[0].1.cover;
    println!("{}: spacing {:.2} px, sampled {:.1} %", outcome.case.name(), first.spacing_px, 100.0 * first.sampled);
    for (method, m) in &outcome.measures {
        let angles = m.angles.map_or_else(
            || format!("{:>6} {:>5} {:>6} {:>6} {:>5} {:>6} {:>6}", "-", "-", "-", "-", "-", "-", "-"),
            |a| {
                format!(
                    "{:6.2} {:5.2} {:6.2} {:6.2} {:5.1} {:6.1} {:6.3}",
                    a.mean,
                    a.median,
                    a.rms,
                    a.band,
                    100.0 * a.below_5,
                    100.0 * a.below_10,
                    100.0 * a.flipped
                )
            },
        );
        let c = m.cover;
        println!(
            "    {:<40} {angles} {:9.3} {:7.3} {:7.3} {:8.3} {:6.4} {:6.2} {:6.2}",
            method.name(),
            m.depth_px,
            100.0 * c.holes,
            100.0 * c.leaks,
            100.0 * c.before,
            c.iou,
            c.wider_px,
            m.psnr
        );
    }
    let ratio = |value: fn(&autosplats_quality::measure::Angles) -> f64| {
        let ours = outcome.of(Method::Ours).and_then(|m| m.angles.as_ref()).map(value);
        ours.zip(outcome.best_fit(value))
            .map_or(String::new(), |(ours, (k, best))| format!("{:.3} of k = {k}", ours / best))
    };
    println!("    ours / best fit: mean {}, band {}", ratio(|a| a.mean), ratio(|a| a.band));
}
