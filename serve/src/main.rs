//! Serves a folder, to look at how the command deals with servers.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use autosplats_serve::{FAULTS, Server, Site};

const USAGE: &str = "usage: autosplats-serve FOLDER [PORT [DELAY_MS]]    serves a folder on the loopback [8000, 0 ms]";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize, usual: u16| arguments.get(at).map_or(Some(usual), |text| text.parse().ok());
    let (Some(folder), Some(port), Some(delay)) = (arguments.first(), number(1, 8000), number(2, 0)) else {
        eprintln!(
            "{USAGE}\n\nA fault is the first part of a path: /~busy/a, always; /~busy:2/a, twice at first; /~busy:1-3/a, after the first"
        );
        FAULTS.iter().for_each(|(name, what)| eprintln!("  ~{name:<14}{what}"));
        return ExitCode::from(2);
    };
    let site = Site::new(PathBuf::from(folder), Duration::from_millis(delay.into()), true);
    match Server::on(port, site) {
        Ok(server) => {
            println!("{}", server.address(""));
            loop {
                std::thread::park();
            }
        }
        Err(error) => {
            eprintln!("error: port {port}: {error}");
            ExitCode::FAILURE
        }
    }
}
