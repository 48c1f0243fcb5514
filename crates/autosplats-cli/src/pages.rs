//! `autosplats completions` and `autosplats man`: shell scripts and manual pages, generated from the command line's
//! definition.

use std::io::Write as _;

use clap::{Command, CommandFactory as _};
use clap_mangen::Man;

use crate::args::{CommandLine, CompletionsArgs, ManArgs};
use crate::console::Console;
use crate::exit::{Exit, Failure};
use crate::output::{ReadFiles, check_target, create_folder, forced, write_file};

/// Prints the completion script of a shell.
pub(crate) fn completions(args: &CompletionsArgs, console: &Console) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut CommandLine::command(), "autosplats", &mut script);
    console.print(script)
}

/// Prints the main page, or writes all pages into a folder.
pub(crate) fn manual(args: &ManArgs, console: &Console) -> Result<(), Failure> {
    let pages = pages();
    let Some(folder) = &args.out else {
        return console.print(render(&pages[0].1)?);
    };
    create_folder(folder)?;
    let paths: Vec<_> = pages.iter().map(|(name, _)| folder.join(format!("{name}.1"))).collect();
    // Every target is checked before the first is written, so that a refusal leaves no partial set.
    for path in &paths {
        check_target(forced(path, args.force), &ReadFiles::default())?;
    }
    for (path, (_, page)) in paths.iter().zip(&pages) {
        let page = render(page)?;
        write_file(forced(path, args.force), console, |writer| writer.write_all(&page))?;
        console.print_line(path.display())?;
    }
    Ok(())
}

/// Pages of the program and of all commands, each with its name.
fn pages() -> Vec<(String, Command)> {
    let mut program = CommandLine::command().disable_help_subcommand(true);
    program.build();
    let mut pages = vec![("autosplats".to_owned(), program)];
    let mut next = 0;
    while next < pages.len() {
        let (name, command) = pages[next].clone();
        let commands = command.get_subcommands().filter(|command| command.get_name() != "help");
        pages.extend(commands.map(|command| {
            (format!("{name}-{}", command.get_name()), command.clone().version(env!("CARGO_PKG_VERSION")))
        }));
        next += 1;
    }
    pages
}

fn render(page: &Command) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    Man::new(page.clone()).render(&mut bytes).map_err(|error| Failure::new(Exit::Output, error))?;
    Ok(bytes)
}
