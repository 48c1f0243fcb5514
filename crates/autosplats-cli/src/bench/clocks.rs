//! Clocks of a graphics card while it renders, as `nvidia-smi` tells them. An idle card is slow to raise them.

use std::process::{Child, Command, Stdio};

use autosplats::AdapterSummary;
use serde::Serialize;

/// Milliseconds from one reading to the next.
const PERIOD_MS: &str = "50";

/// Clock of a card's processors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Clock {
    /// Median while rendering.
    pub(super) median_mhz: u32,
    /// Highest that the card allows.
    pub(super) most_mhz: u32,
}

/// Reads a card's clock until it is finished.
#[derive(Debug)]
pub(super) struct ClockReader(Option<Child>);

impl ClockReader {
    /// Begins to read the clock of a device, if it is a card with a place on the bus and the program is there.
    pub(super) fn start(adapter: Option<&AdapterSummary>) -> Self {
        let card = adapter.filter(|adapter| !adapter.software && !adapter.pci_bus_id.is_empty());
        let read = |card: &AdapterSummary| {
            Command::new("nvidia-smi")
                .args(["--query-gpu=clocks.sm,clocks.max.sm", "--format=csv,noheader,nounits", "-lms", PERIOD_MS, "-i"])
                .arg(&card.pci_bus_id)
                .stdin(Stdio::null())
                .stdout(Stdio::piped())
                .stderr(Stdio::null())
                .spawn()
                .ok()
        };
        Self(card.and_then(read))
    }

    /// Ends the reading.
    pub(super) fn finish(mut self) -> Option<Clock> {
        let mut child = self.0.take()?;
        // It may have ended by itself, with nothing to tell.
        let _ = child.kill();
        clock(&String::from_utf8_lossy(&child.wait_with_output().ok()?.stdout))
    }
}

/// A bench that fails leaves no program behind.
impl Drop for ClockReader {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// The clock of lines such as `1980, 1980`; the last may be cut off.
fn clock(lines: &str) -> Option<Clock> {
    let whole = lines.rsplit_once('\n')?.0;
    let read = |line: &str| {
        let (now, most) = line.split_once(',')?;
        Some([now.trim().parse::<u32>().ok()?, most.trim().parse().ok()?])
    };
    let mut read: Vec<[u32; 2]> = whole.lines().filter_map(read).collect();
    read.sort_unstable();
    let [median_mhz, most_mhz] = *read.get(read.len() / 2)?;
    Some(Clock { median_mhz, most_mhz })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_whole_lines_counts() {
        let found = clock("345, 1980\n1965, 1980\n1980, 1980\n19");
        assert_eq!(found, Some(Clock { median_mhz: 1965, most_mhz: 1980 }));
        for nothing in ["", "1980, 1980", "No devices were found\n", "[N/A], 1980\n"] {
            assert_eq!(clock(nothing), None, "{nothing}");
        }
    }
}
