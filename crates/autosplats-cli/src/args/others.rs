//! Arguments of the commands about this program, this machine and its network.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::RunArgs;
use crate::values;

#[derive(Args, Debug)]
pub(crate) struct DemoArgs {
    /// Folder to write the pictures to; created if missing
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
    /// Address of a router or node, zenoh://HOST[:PORT][/?domain=N]; zenoh:/// searches the local network
    pub(crate) address: String,
    /// Longest time to listen, such as 2s or 500ms
    #[arg(long, value_name = "TIME", default_value = "5s", value_parser = values::duration, allow_hyphen_values = true)]
    pub(crate) wait: Duration,
    /// Print one JSON object per line and topic on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

#[derive(Args, Debug)]
pub(crate) struct DoctorArgs {
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

const COMPLETIONS_HELP: &str = "\
To install:
  bash        autosplats completions bash > ~/.local/share/bash-completion/completions/autosplats
  zsh         autosplats completions zsh > _autosplats, in a folder of $fpath; then start a new shell
  fish        autosplats completions fish > ~/.config/fish/completions/autosplats.fish
  powershell  autosplats completions powershell | Out-String | Invoke-Expression, in the file $PROFILE
  elvish      eval (autosplats completions elvish | slurp), in ~/.config/elvish/rc.elv";

#[derive(Args, Debug)]
#[command(after_help = COMPLETIONS_HELP)]
pub(crate) struct CompletionsArgs {
    /// Shell to write the script for
    #[arg(value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

#[derive(Args, Debug)]
#[command(after_help = "\
To read one page:      autosplats man | man -l -
To install them all:   autosplats man --out ~/.local/share/man/man1")]
pub(crate) struct ManArgs {
    /// Folder to write one page per command to, created if missing; without it the main page goes to standard output
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Replace existing pages
    #[arg(long, requires = "out")]
    pub(crate) force: bool,
}
