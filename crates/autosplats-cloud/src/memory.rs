//! How much memory there is.

use std::fs::read_to_string;

use crate::Error;

/// Bytes that can be allocated now without swapping, where the system says so (Linux).
pub fn available_memory() -> Option<u64> {
    let meminfo = read_to_string("/proc/meminfo").ok()?;
    let line = meminfo.lines().find(|line| line.starts_with("MemAvailable:"))?;
    let free = line.split_whitespace().nth(1)?.parse::<u64>().ok()?.checked_mul(1024)?;
    // A container's own limit, if there is one ("max" if not).
    let bytes = |file: &str| read_to_string(file).ok()?.trim().parse::<u64>().ok();
    let limit = bytes("/sys/fs/cgroup/memory.max");
    let used = bytes("/sys/fs/cgroup/memory.current").unwrap_or(0);
    Some(limit.map_or(free, |limit| free.min(limit.saturating_sub(used))))
}

/// Below this nobody asks the system, which takes longer than to read the file.
const SMALL: u64 = 64 << 20;

/// Refuses what needs more memory than there is. Systems promise memory they do not have and then kill whoever touches
/// it, so asking first is the only way to fail with a message.
///
/// # Errors
/// [`Error::OutOfMemory`] with `what` and the `bytes` needed.
pub fn check_memory(what: &str, bytes: u64) -> Result<(), Error> {
    if bytes > SMALL && available_memory().is_some_and(|available| bytes > available) {
        return Err(Error::OutOfMemory { what: what.into(), bytes: usize::try_from(bytes).unwrap_or(usize::MAX) });
    }
    Ok(())
}
