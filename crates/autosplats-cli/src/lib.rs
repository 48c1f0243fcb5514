//! The `autosplats` command, callable within a process: renders raw point clouds as lit surfaces.
//!
//! The command is thin: `args` is what was typed; each command turns it into one job for the libraries. Data and
//! messages for people go to the two streams of a [`Console`].

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic where the stream cannot be written")]

mod args;
mod bench;
mod choices;
mod console;
mod convert;
mod demo;
mod device;
mod doctor;
mod exit;
mod first_radius;
mod info;
mod input;
mod interrupt;
mod normals;
mod output;
mod pages;
mod parts;
mod progress;
mod render;
mod signals;
mod threads;
mod topics;
mod values;
mod view;

use std::ffi::OsString;
use std::path::Path;

use autosplats_sources::Source;
use clap::error::ErrorKind;
use clap::{CommandFactory as _, Parser as _};

use crate::args::{Command, CommandLine};
pub use crate::console::Console;
pub use crate::exit::Exit;
use crate::exit::{Failure, suggest};
pub use crate::interrupt::Interrupt;
pub use crate::signals::{Signals, out_of_memory, out_of_threads};
use crate::threads::with_threads;

/// Runs the command with `arguments`, without the program's name, and returns its exit code: 0, or that of an [`Exit`].
///
/// The process stays as it is, except for its threads: the first call starts them, and a later one that asks for
/// another number gets a pool of its own.
pub fn run(arguments: impl IntoIterator<Item = impl Into<OsString>>, console: &Console) -> u8 {
    let words = std::iter::once("autosplats".into()).chain(arguments.into_iter().map(Into::into));
    let words: Vec<OsString> = words.collect();
    let code = match CommandLine::try_parse_from(&words) {
        Err(help) if help.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            console.message(help.render().to_string().trim_end());
            Exit::Usage as u8
        }
        // clap returns --help and --version as errors too.
        Err(answer) if !answer.use_stderr() => {
            exit_code(console.print_line(answer.render().to_string().trim_end()), console)
        }
        Err(error) if error.kind() == ErrorKind::InvalidUtf8 => exit_code(Err(not_utf8(&words)), console),
        Err(error) => exit_code(Err(Failure::usage(one_line(&error))), console),
        Ok(command_line) => exit_code(dispatch(command_line, console), console),
    };
    console.flush();
    console.interrupt().clear();
    code
}

/// Prints an error and returns the exit code.
fn exit_code(outcome: Result<(), Failure>, console: &Console) -> u8 {
    let Err(failure) = outcome else { return 0 };
    // After a request to end, what stops early fails by errors of many kinds.
    let is_requested = console.interrupt().requested();
    let Failure { exit, message } = if is_requested { Failure::interrupted() } else { failure };
    console.last_error(&message);
    exit as u8
}

/// The failure of a name that is no text.
fn not_utf8(words: &[OsString]) -> Failure {
    let word = words.iter().find(|word| word.to_str().is_none()).map(|word| word.display().to_string());
    Failure::usage(format!("{}: this name is not UTF-8; rename the file", word.unwrap_or_default()))
}

fn dispatch(command_line: CommandLine, console: &Console) -> Result<(), Failure> {
    let Some(command) = command_line.command else { return without_command(command_line.rest, console) };
    let Some(run) = command.run() else { return start(command, console) };
    let (threads, console) = (run.threads, console.quiet(run.quiet));
    match command {
        // A window belongs to the thread that opens it.
        Command::View(args) => {
            threads::start_threads(threads)?;
            view::run(&args, &console)
        }
        command => with_threads(threads, || start(command, &console)),
    }
}

fn start(command: Command, console: &Console) -> Result<(), Failure> {
    match command {
        Command::View(args) => view::run(&args, console),
        Command::Render(args) => render::run(*args, console),
        Command::Convert(args) => convert::run(&args, console),
        Command::Normals(args) => normals::run(&args, console),
        Command::Demo(args) => demo::run(&args, console),
        Command::Info(args) => info::run(&args, console),
        Command::Topics(args) => topics::run(&args, console),
        Command::Bench(args) => bench::run(&args, console),
        Command::Doctor(args) => doctor::run(&args, console),
        Command::Completions(args) => pages::completions(&args, console),
        Command::Man(args) => pages::manual(&args, console),
    }
}

/// Views inputs that have no command. A word that is neither an input nor a command is an error with a suggestion.
fn without_command(typed: Vec<String>, console: &Console) -> Result<(), Failure> {
    let first = typed.first().map_or("", String::as_str);
    if first.starts_with('-') || Source::is_address(first) || first.contains('.') || Path::new(first).exists() {
        let words = ["autosplats".into(), "view".into()].into_iter().chain(typed);
        let command_line = CommandLine::try_parse_from(words).map_err(|error| Failure::usage(one_line(&error)))?;
        return dispatch(command_line, console);
    }
    let commands = CommandLine::command();
    let names = commands.get_subcommands().map(clap::Command::get_name);
    Err(Failure::usage(format!("no command is called '{first}'; {} (see --help)", suggest(first, names))))
}

/// The error in one line, without the usage.
fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let paragraphs = text.split("\n\n").filter(|part| !part.starts_with("Usage:") && !part.starts_with("For more"));
    let plain = |part: &str| {
        let part = part.trim().trim_start_matches("error: ").trim_start_matches("tip: ");
        part.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    format!("{} (see --help)", paragraphs.map(plain).collect::<Vec<_>>().join("; "))
}
