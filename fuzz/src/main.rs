//! Feeds mutated files to every reader. A reader must not panic, exceed the limits of time and memory, or write a
//! message of several lines.
//!
//! # How it works
//!
//! Each format has small seed files (see [`seeds`]). [`mod@mutate`] changes a seed, or an earlier input that got a new
//! answer. The same `--seed` on the same number of cores makes the same inputs in the same order. A child process per
//! core takes a share of the inputs. It describes and reads an input from memory, on one thread.
//!
//! Readers turn panics of libraries into errors, and the fuzzer counts these. Any other panic is a finding, and so is
//! exceeding a limit. Findings are written to `target/fuzz`, and the program fails. A process writes each input to a
//! file before trying it. So an input that ends the process, such as by a stack overflow, is there too.

mod meter;
mod mutate;
#[allow(clippy::unwrap_used, reason = "it was written for tests")]
#[path = "../../crates/autosplats-sources/tests/it/common/recording.rs"]
mod recording;
#[allow(dead_code, reason = "tests use the rest")]
#[path = "../../crates/autosplats-sources/tests/it/common/ros.rs"]
mod ros;
mod seeds;
mod target;
#[allow(clippy::unwrap_used, dead_code, reason = "it was written for tests, which use the rest")]
#[path = "../../crates/autosplats-formats/tests/it/common/trees.rs"]
mod trees;

use std::{
    collections::HashSet,
    fs::File,
    io::{Seek as _, SeekFrom, Write as _},
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    process::{Command, ExitCode, Stdio},
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use anyhow::{Context as _, Result, bail, ensure};
use autosplats_cloud::{Error, PointCloud, Progress, Random};
use autosplats_formats::ReadOptions;
use clap::Parser;

use crate::mutate::{mutate, repair_pages};
use crate::seeds::{Seeds, add_corpus, all};

/// Limit of the processor's time for an input: far more than a sound reader needs, far less than it takes to follow a
/// false count.
const TIME: Duration = Duration::from_secs(2);

/// Memory limit per byte of a file, in bytes, beyond `MEMORY`. Compression can put many points into a byte.
const MEMORY_PER_BYTE: usize = 1 << 14;
/// Memory that any file may take, in bytes.
const MEMORY: usize = 16 << 20;

/// Most inputs in the pool: the seeds, and inputs with new answers, which are mutated further.
const POOL: usize = 512;

/// Number of findings after which a format ends.
const ENOUGH: usize = 10;

/// Points that are kept of some inputs.
const KEPT: [&str; 3] = ["usual", "ground,2..5,first", "-noise,-withheld,last"];

/// Feeds changed files to every reader.
#[derive(Debug, Parser)]
struct Arguments {
    /// Formats to try, by the extensions of their seeds [default: all]
    #[arg(long = "reader", value_name = "EXTENSION")]
    readers: Vec<String>,
    /// Seconds for all formats together
    #[arg(long, default_value_t = 60)]
    seconds: u64,
    /// Number of inputs per format, whatever time they take; 3500000 are more than 10^8 over all formats
    #[arg(long, conflicts_with = "seconds")]
    inputs: Option<u64>,
    /// Seed of the random numbers; another seed makes other inputs
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Take the files of a folder, up to 64 KB each, as further seeds
    #[arg(long, value_name = "FOLDER")]
    corpus: Option<PathBuf>,
    /// Share of this process, as INDEX/COUNT
    #[arg(long, hide = true, value_parser = share)]
    share: Option<[u64; 2]>,
}

fn share(text: &str) -> Result<[u64; 2], String> {
    let (index, count) = text.split_once('/').ok_or("INDEX/COUNT")?;
    Ok([index.parse().map_err(|_| "INDEX")?, count.parse().map_err(|_| "COUNT")?])
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let outcome = match arguments.share {
        Some(share) => work(&arguments, share),
        None => start(),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Starts one process per core, so that each measures the time and memory of a single reader.
fn start() -> Result<()> {
    let cores = std::thread::available_parallelism()?.get() as u64;
    let start = Instant::now();
    let children = (0..cores).map(|index| {
        Command::new(std::env::current_exe()?)
            .args(std::env::args_os().skip(1))
            .args(["--share", &format!("{index}/{cores}")])
            .env("RAYON_NUM_THREADS", "1")
            .stdin(Stdio::null())
            .spawn()
    });
    let children = children.collect::<std::io::Result<Vec<_>>>().context("cannot start a process")?;
    let mut failed = 0;
    for (index, mut child) in children.into_iter().enumerate() {
        let status = child.wait()?;
        failed += usize::from(!status.success());
        if status.code().is_none_or(|code| code > 1) {
            eprintln!(
                "process {} of {cores} ended by {status}; its last input: {}",
                index + 1,
                last_input(index)?.display()
            );
        }
    }
    ensure!(failed == 0, "{failed} of {cores} processes found something; see above");
    println!("nothing found in {:.0} s on {cores} cores", start.elapsed().as_secs_f64());
    Ok(())
}

/// Folder for findings.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/fuzz")
}

/// File to which a process writes each input before trying it: length of the name, length of the input, name, input.
fn last_file(share: usize) -> PathBuf {
    folder().join(format!("last-{share}"))
}

/// Copies the input from the file of a process that ended, as a finding, and returns its path.
fn last_input(share: usize) -> Result<PathBuf> {
    let left = std::fs::read(last_file(share))?;
    let number = |at: usize| left.get(at..at + 8).and_then(|raw| raw.try_into().ok()).map(u64::from_le_bytes);
    let (name, len) = (number(0).context("no input")? as usize, number(8).context("no input")? as usize);
    let name_bytes = left.get(16..16 + name).context("no name")?;
    let path = folder().join(format!("last-{share}-{}", String::from_utf8_lossy(name_bytes)));
    std::fs::write(&path, left.get(16 + name..16 + name + len).context("no input")?)?;
    Ok(path)
}

fn work(arguments: &Arguments, share: [u64; 2]) -> Result<()> {
    std::fs::create_dir_all(folder())?;
    // The main thread is the only thread of the pool, so parallel loops run on it.
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global()?;
    let mut formats = all()?;
    if let Some(folder) = &arguments.corpus {
        let added = add_corpus(&mut formats, folder)?;
        if share[0] == 0 {
            println!("{added} files of {} are seeds, too", folder.display());
        }
    }
    if !arguments.readers.is_empty() {
        for reader in &arguments.readers {
            ensure!(formats.iter().any(|seeds| seeds.extension == *reader), "no seeds end in .{reader}");
        }
        formats.retain(|seeds| arguments.readers.iter().any(|reader| reader == seeds.extension));
    }
    let (mut done, mut findings) = (0, 0);
    let count = formats.len() as u32;
    for seeds in formats {
        let limit = match arguments.inputs {
            Some(inputs) => Limit::Inputs(inputs.div_ceil(share[1])),
            None => Limit::Time(Duration::from_secs(arguments.seconds) / count),
        };
        let (inputs, found) = Run::new(&seeds, arguments.seed, share)?.go(&limit)?;
        done += inputs;
        findings += found;
    }
    println!("all formats {}/{}: {done} inputs, {findings} findings", share[0] + 1, share[1]);
    if findings > 0 {
        bail!("{findings} findings");
    }
    Ok(())
}

enum Limit {
    Inputs(u64),
    Time(Duration),
}

/// The inputs of one format, and what the answers were.
struct Run<'a> {
    seeds: &'a Seeds,
    seed: u64,
    share: [u64; 2],
    pool: Vec<Vec<u8>>,
    /// Answers without digits. A new answer shows a new path through the reader.
    answers: HashSet<String>,
    accepted: u64,
    contained: u64,
    slowest: Duration,
    most_memory: usize,
    findings: usize,
    last: File,
}

impl<'a> Run<'a> {
    fn new(seeds: &'a Seeds, seed: u64, share: [u64; 2]) -> Result<Self> {
        Ok(Self {
            seeds,
            seed,
            share,
            pool: seeds.files.clone(),
            answers: HashSet::new(),
            accepted: 0,
            contained: 0,
            slowest: Duration::ZERO,
            most_memory: 0,
            findings: 0,
            last: File::create(last_file(share[0] as usize))?,
        })
    }

    /// Tries inputs up to the limit. Returns their number and that of the findings.
    fn go(mut self, limit: &Limit) -> Result<(u64, usize)> {
        let name = format!("a.{}", self.seeds.extension);
        for (index, file) in self.seeds.files.iter().enumerate().take(self.seeds.own) {
            let read = target::read(Path::new(&name), file, &ReadOptions::default(), false, &());
            read.with_context(|| format!("seed {index} of .{} is not read", self.seeds.extension))?;
        }
        let start = Instant::now();
        let mut done = 0;
        loop {
            let over = match limit {
                Limit::Inputs(inputs) => done >= *inputs,
                Limit::Time(time) => start.elapsed() >= *time,
            };
            if over || self.findings >= ENOUGH {
                break;
            }
            let number = done * self.share[1] + self.share[0];
            self.one(Path::new(&name), number)?;
            done += 1;
        }
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{:>9} {}/{}: {done} inputs, {:.0}/s, {} read, {} answers, {} panics contained, slowest {:.1} ms, memory up \
             to {:.1} MB, {} findings",
            self.seeds.extension,
            self.share[0] + 1,
            self.share[1],
            done as f64 / seconds,
            self.accepted,
            self.answers.len(),
            self.contained,
            self.slowest.as_secs_f64() * 1e3,
            self.most_memory as f64 / 1e6,
            self.findings
        );
        Ok((done, self.findings))
    }

    fn one(&mut self, name: &Path, number: u64) -> Result<()> {
        let mut random = Random::from_state(self.seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ number << 20);
        // Half of the inputs start from a seed, because readers reject a broken file early.
        let from = if random.modulo(2) == 0 { &self.seeds.files } else { &self.pool };
        let mut bytes = from[random.modulo(from.len())].clone();
        mutate(&mut bytes, &self.seeds.files, &mut random);
        if self.seeds.extension == "e57" && random.modulo(8) > 0 {
            repair_pages(&mut bytes);
        }
        let options = ReadOptions {
            exact: random.modulo(4) == 0,
            keep_no_returns: random.modulo(8) == 0,
            whole: random.modulo(8) == 0,
            columns: (random.modulo(16) == 0).then(|| ["x", "y", "z", "-"].map(String::from).into()),
            keep: KEPT.get(random.modulo(4 * KEPT.len())).map(|words| words.parse()).transpose()?,
            ..ReadOptions::default()
        };
        let mesh = random.modulo(4) == 0;
        let watcher = Watcher { chunks: random.modulo(8) == 0, notes: Mutex::default() };

        self.leave(name, &bytes)?;
        let (outcome, time, memory) = meter::measured(|| {
            catch_unwind(AssertUnwindSafe(|| {
                (target::describe(name, &bytes, &options), target::read(name, &bytes, &options, mesh, &watcher))
            }))
        });
        self.slowest = self.slowest.max(time);
        self.most_memory = self.most_memory.max(memory);

        let mut faults = Vec::new();
        let allowed = MEMORY + MEMORY_PER_BYTE.saturating_mul(bytes.len());
        match outcome {
            Err(_) => faults.push("panicked".to_owned()),
            Ok((described, read)) => {
                self.accepted += u64::from(read.is_ok());
                let answers = [described.map(|_| String::new()), read.map(|points| format!("{} points", points > 0))];
                for answer in answers {
                    let answer = answer.unwrap_or_else(|error: Error| error.to_string());
                    if answer.contains(char::is_control) {
                        faults.push(format!("a message of more than one line: {answer:?}"));
                    }
                    self.contained += u64::from(answer.contains("the data are inconsistent"));
                    self.learn(&answer, &bytes);
                }
                for note in watcher.notes.into_inner().unwrap_or_else(PoisonError::into_inner) {
                    if note.contains(char::is_control) {
                        faults.push(format!("a note of more than one line: {note:?}"));
                    }
                    self.learn(&note, &bytes);
                }
            }
        }
        if time > TIME {
            faults.push(format!("took {time:?}"));
        }
        if memory > allowed {
            faults.push(format!("took {memory} bytes of memory for a file of {}", bytes.len()));
        }
        if !faults.is_empty() {
            self.findings += 1;
            let path = keep(self.seeds.extension, number, &bytes)?;
            eprintln!("{}: {} (mesh: {mesh}, {options:?})", path.display(), faults.join("; "));
        }
        Ok(())
    }

    /// Writes an input to the file of this process, in case it ends the process.
    fn leave(&mut self, name: &Path, bytes: &[u8]) -> Result<()> {
        let name = name.as_os_str().as_encoded_bytes();
        let lens = [name.len() as u64, bytes.len() as u64].map(u64::to_le_bytes);
        self.last.seek(SeekFrom::Start(0))?;
        self.last.write_all(&[lens.as_flattened(), name, bytes].concat())?;
        Ok(())
    }

    /// Adds an input to the pool if its answer is new.
    fn learn(&mut self, answer: &str, bytes: &[u8]) {
        // Quoted text comes from the input, so it makes no answer new.
        let unquoted = answer.split('\'').next().unwrap_or_default();
        let kind: String = unquoted.chars().filter(|c| !c.is_ascii_digit()).take(60).collect();
        if self.answers.len() < 1 << 16 && self.answers.insert(kind) && self.pool.len() < POOL {
            self.pool.push(bytes.to_vec());
        }
    }
}

/// Progress that checks what readers report, and may ask for chunks, as the viewer does.
struct Watcher {
    chunks: bool,
    notes: Mutex<Vec<String>>,
}

impl Progress for Watcher {
    fn report(&self, fraction: f32) {
        assert!((0.0..=1.0).contains(&fraction), "progress of {fraction}");
    }

    fn note(&self, note: &str) {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).push(note.into());
    }

    fn wants_chunks(&self) -> bool {
        self.chunks
    }

    fn chunk(&self, points: PointCloud) {
        assert!(!points.is_empty(), "a chunk without points");
    }
}

/// Writes a finding to `folder` and returns its path.
fn keep(extension: &str, number: u64, bytes: &[u8]) -> Result<PathBuf> {
    let path = folder().join(format!("{number}.{extension}"));
    std::fs::write(&path, bytes)?;
    Ok(path)
}
