//! Commands about this program, this machine and what is around it.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::RunArgs;
use crate::values;

#[derive(Args, Debug)]
pub(crate) struct DemoArgs {
    /// Folder for the pictures; made if it is not there
    #[arg(short, long, value_name = "DIR", default_value = "autosplats-demo")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

const TOPICS_EXAMPLES: &str = "\
Examples:
  autosplats topics zenoh://192.168.1.20
  autosplats topics 'zenoh:///?domain=3' --json
  autosplats zenoh://192.168.1.20/lidar/points --decay 1s";

#[derive(Args, Debug)]
#[command(after_help = TOPICS_EXAMPLES)]
pub(crate) struct TopicsArgs {
    /// Where a router or a node listens: zenoh://HOST[:PORT][/?domain=N]; zenoh:/// looks around on this network
    pub(crate) address: String,
    /// How long to listen at most
    #[arg(long, value_name = "TIME", default_value = "5s", value_parser = values::duration)]
    pub(crate) wait: Duration,
    /// One JSON object a line for each topic on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

#[derive(Args, Debug)]
pub(crate) struct DoctorArgs {
    /// One JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

const COMPLETIONS_HELP: &str = "\
To install:
  bash        autosplats completions bash > ~/.local/share/bash-completion/completions/autosplats
  zsh         autosplats completions zsh > a folder of $fpath, as _autosplats; then start a new shell
  fish        autosplats completions fish > ~/.config/fish/completions/autosplats.fish
  powershell  autosplats completions powershell | Out-String | Invoke-Expression, in the file that $PROFILE names
  elvish      eval (autosplats completions elvish | slurp), in ~/.config/elvish/rc.elv";

#[derive(Args, Debug)]
#[command(after_help = COMPLETIONS_HELP)]
pub(crate) struct CompletionsArgs {
    /// Shell to write for
    #[arg(value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

#[derive(Args, Debug)]
#[command(after_help = "\
To read one page:      autosplats man | man -l -
To install them all:   autosplats man --out ~/.local/share/man/man1")]
pub(crate) struct ManArgs {
    /// Folder for one page per command, made if it is not there; without it the main page goes to standard output
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Replace existing pages
    #[arg(long, requires = "out")]
    pub(crate) force: bool,
}
