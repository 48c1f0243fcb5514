//! The `autosplats` command: renders raw point clouds as lit surfaces.
//!
//! The command is thin: [`args`] is what was typed; each command turns it into one job for the library. Data goes to
//! standard output, messages for people to standard error.

mod args;
mod bench;
mod choices;
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
mod progress;
mod render;
mod threads;
mod topics;
mod values;
mod view;

use std::path::Path;
use std::process::ExitCode;

use autosplats_sources::Source;
use clap::error::ErrorKind;
use clap::{CommandFactory as _, Parser as _};

use crate::args::{Command, CommandLine};
use crate::exit::{Exit, Failure, suggest};

fn main() -> ExitCode {
    silence_drivers();
    interrupt::install();
    let outcome = match CommandLine::try_parse() {
        Ok(command_line) => run(command_line),
        // clap returns --help and --version as errors too.
        Err(answer) if !answer.use_stderr() => output::print_line(answer.render().to_string().trim_end()),
        Err(help) if help.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            eprint!("{}", help.render());
            return ExitCode::from(Exit::Usage as u8);
        }
        Err(error) => Err(Failure::usage(one_line(&error))),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure { exit, message }) => {
            eprintln!("error: {}", message.lines().map(str::trim).collect::<Vec<_>>().join(" "));
            ExitCode::from(exit as u8)
        }
    }
}

/// Keeps Mesa's device selection from printing to standard error, where the command's own messages go. Without a
/// session, Mesa cannot ask Wayland for the screen's device and reports that. A choice that the user made stays.
#[allow(unsafe_code, reason = "the environment can be changed in no other way")]
fn silence_drivers() {
    const CHOICE: &str = "NODEVICE_SELECT";
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() && std::env::var_os(CHOICE).is_none()
    {
        // SAFETY: this is the first statement of the program, and no other thread exists yet.
        unsafe { std::env::set_var(CHOICE, "1") };
    }
}

fn run(command_line: CommandLine) -> Result<(), Failure> {
    match command_line.command {
        Some(Command::View(args)) => view::run(&args),
        Some(Command::Render(args)) => render::run(*args),
        Some(Command::Convert(args)) => convert::run(&args),
        Some(Command::Normals(args)) => normals::run(&args),
        Some(Command::Demo(args)) => demo::run(&args),
        Some(Command::Info(args)) => info::run(&args),
        Some(Command::Topics(args)) => topics::run(&args),
        Some(Command::Bench(args)) => bench::run(&args),
        Some(Command::Doctor(args)) => doctor::run(&args),
        Some(Command::Completions(args)) => pages::completions(&args),
        Some(Command::Man(args)) => pages::manual(&args),
        None => without_command(command_line.rest),
    }
}

/// Views inputs that have no command. A word that is neither an input nor a command is an error with a suggestion.
fn without_command(typed: Vec<String>) -> Result<(), Failure> {
    let first = typed.first().map_or("", String::as_str);
    if first.starts_with('-') || Source::is_address(first) || first.contains('.') || Path::new(first).exists() {
        let words = ["autosplats".into(), "view".into()].into_iter().chain(typed);
        return CommandLine::try_parse_from(words).map_err(|error| Failure::usage(one_line(&error))).and_then(run);
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
