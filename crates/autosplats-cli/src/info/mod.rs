//! `autosplats info`: describes files.

mod examine;
mod notes;
mod report;
mod room;
mod spacing;
mod statistics;
mod text;
mod values;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;

use autosplats_formats::ReadOptions;

use self::examine::{Examination, Examiner};
use self::room::Room;
pub(crate) use self::text::wrapped;
use crate::args::InfoArgs;
use crate::console::{Console, json};
use crate::exit::{Exit, Failure};
use crate::parts::check_room;

/// Examines the inputs in parallel and prints the reports in the order typed.
pub(crate) fn run(args: &InfoArgs, console: &Console) -> Result<(), Failure> {
    // All digits are read, so that the report is true of the file.
    check_room(&args.room)?;
    let options = ReadOptions { exact: true, ..args.reading.options() };
    let several = args.inputs.len() > 1;
    // The header counts the points that are left out too.
    let scan = args.scan || options.keep.as_ref().is_some_and(|filter| !filter.is_all());
    let examiner = Examiner::new(options, scan, Room::new(&args.room), console.quiet(several));

    if let [name] = args.inputs.as_slice() {
        // In this thread, and so in the pool of threads that the caller chose.
        let mut printed = Printer { console, json: args.json, several, failures: Vec::new() };
        printed.print(examiner.examine(name))?;
        return printed.end();
    }
    let next = AtomicUsize::new(0);
    let (sender, reports) = channel();
    std::thread::scope(|scope| {
        for _ in 0..rayon::current_num_threads().min(args.inputs.len()) {
            let sender = sender.clone();
            let (next, examiner) = (&next, &examiner);
            scope.spawn(move || {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(name) = args.inputs.get(index) else { break };
                    if sender.send((index, examiner.examine(name))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        let mut waiting = BTreeMap::new();
        let mut printed = Printer { console, json: args.json, several, failures: Vec::new() };
        printed.begin()?;
        for (index, examination) in reports {
            waiting.insert(index, examination);
            while let Some(examination) = waiting.remove(&printed.failures.len()) {
                printed.print(examination)?;
            }
        }
        printed.end()
    })
}

/// Prints reports as they come.
struct Printer<'a> {
    console: &'a Console,
    json: bool,
    several: bool,
    /// For each printed input, why it could not be read.
    failures: Vec<Option<Failure>>,
}

impl Printer<'_> {
    fn begin(&self) -> Result<(), Failure> {
        if self.json && self.several { self.console.print_line("[") } else { Ok(()) }
    }

    fn print(&mut self, Examination { report, failure }: Examination) -> Result<(), Failure> {
        if self.json {
            if !self.failures.is_empty() {
                self.console.print(",\n")?;
            }
            self.console.print(json(&report)?)?;
        } else if report.is_known() {
            let gap = if self.failures.is_empty() { "" } else { "\n" };
            let styled = self.console.data_to_terminal() && std::env::var_os("NO_COLOR").is_none();
            self.console.print(format!("{gap}{}", report.to_text(styled)))?;
        }
        if let Some(failure) = &failure
            && self.several
        {
            self.console.error(&failure.message);
        }
        self.failures.push(failure);
        Ok(())
    }

    fn end(self) -> Result<(), Failure> {
        if self.json {
            self.console.print_line(if self.several { "\n]" } else { "" })?;
        }
        match self.failures.into_iter().flatten().next() {
            None => Ok(()),
            // Each has been told of.
            Some(_) if self.several => Err(Failure::new(Exit::Input, "")),
            Some(failure) => Err(failure),
        }
    }
}
